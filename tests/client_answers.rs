//! Which fields of a response must match the request.

use mbm::client::RequestState;
use mbm::error::Status;

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
