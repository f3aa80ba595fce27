//! The response to the first request in the queue of a TCP client. The client has a faster
//! path for it, which must give the same result as the general one.

#[path = "common/stream.rs"]
mod stream;

use stream::{client, poll, read, requests, response};

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
