//! Which fields of a response must match the request, be it the first in flight or a later one.

#[path = "common/stream.rs"]
mod stream;

use mbm::client::RequestState;
use mbm::error::Status;
use stream::{client, poll, read, requests, response};

#[test]
fn a_file_record_response_whose_lengths_differ_from_the_request_is_malformed() {
    let groups = [6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 1];
    let right = [0x14, 10, 5, 6, 1, 2, 3, 4, 3, 6, 5, 6];
    let others: [&[u8]; 6] = [
        // The two lengths swapped; one group; three groups; a group that is too long.
        &[0x14, 10, 3, 6, 1, 2, 5, 6, 3, 4, 5, 6],
        &[0x14, 6, 5, 6, 1, 2, 3, 4],
        &[0x14, 14, 5, 6, 1, 2, 3, 4, 3, 6, 5, 6, 3, 6, 7, 8],
        &[0x14, 12, 5, 6, 1, 2, 3, 4, 5, 6, 5, 6, 7, 8],
        // Another reference type; a missing byte.
        &[0x14, 10, 5, 6, 1, 2, 3, 4, 3, 7, 5, 6],
        &[0x14, 9, 5, 6, 1, 2, 3, 4, 3, 6, 5],
    ];
    let mut state = RequestState::NONE;
    assert_eq!(state.read_file_records(14), Status::OK);
    let validate = |response: &[u8]| state.validate(response, |index| groups[index]);
    assert_eq!(validate(&right), Status::OK);
    assert_eq!(validate(&[0x94, 2]), Status::ILLEGAL_DATA_ADDRESS);
    for response in others {
        assert_eq!(
            validate(response),
            Status::MALFORMED_REPLY,
            "{response:02X?}"
        );
    }
}

#[test]
fn a_response_has_the_same_result_for_the_first_request_and_for_a_later_one() {
    let right = response((0, 1, 7));
    let mut all = vec![right.clone()];
    for at in 2..right.len() {
        for change in [1, 0x80] {
            let mut other = right.clone();
            other[at] ^= change;
            all.push(other);
        }
    }
    for (length, shape) in [
        (4, [3, 2, 0].as_slice()),
        (6, &[3, 2, 0, 7, 0]),
        (3, &[0x83, 2]),
    ] {
        let mut other = vec![0, 0, 0, 0, 0, length, 1];
        other.extend(shape);
        all.push(other);
    }
    for answer in all {
        let [first, later] = [0, 1].map(|others| {
            let (end, mut client) = client();
            for number in 0..=others {
                assert!(client.queue(read(1, 7 + others - number)).is_ok());
            }
            poll(&end, &mut client);
            let wire = requests(&end.sent())[usize::from(others)].0;
            let mut answer = answer.clone();
            answer[..2].copy_from_slice(&wire.to_be_bytes());
            end.deliver(0, &answer);
            let mut ended = Vec::new();
            for _ in 0..10 {
                ended.extend(poll(&end, &mut client));
                end.pass(500_000);
            }
            let task = ended.iter().find(|task| task.state.transaction == 7);
            let task = task.unwrap();
            (
                task.state.status,
                task.state.exception,
                task.received().to_vec(),
            )
        });
        assert_eq!(first, later, "{answer:?}");
    }
}
