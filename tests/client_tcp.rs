//! The client on a TCP stream: many requests at once, and responses that arrive out of
//! order, in pieces, twice, or with garbage between them, and which fields must match.

#[path = "common/stream.rs"]
mod stream;

use mbm::client::{Client, RequestState, Tcp};
use mbm::engine::{Counter, Frame};
use mbm::error::{Error, Status};
use mbm::frame::tcp;
use mbm::pdu::functions::FunctionSpec;
use proptest::prelude::*;
use stream::wire::{Lent, Task};
use stream::{client, poll, read, requests, response, TcpIp};

fn assert_right(task: &Task) {
    assert_eq!(task.state.status, Status::OK);
    assert_eq!(task.received(), task.state.transaction.to_be_bytes());
}

#[test]
fn all_requests_are_in_flight_at_once_and_answered_in_any_order() {
    let (end, mut client) = client();
    for number in 1..=16 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    assert_eq!(
        client.queue(read(1, 17)).unwrap_err().error(),
        Error::QueueFull
    );
    assert!(poll(&end, &mut client).is_empty());
    let sent = requests(&end.sent());
    assert_eq!(sent.len(), 16);
    let all: Vec<u8> = sent
        .iter()
        .rev()
        .flat_map(|request| response(*request))
        .collect();
    end.deliver(0, &all);
    let ended = poll(&end, &mut client);
    assert_eq!(ended.len(), 16);
    for (task, number) in ended.iter().zip((1..=16).rev()) {
        assert_right(task);
        assert_eq!(task.state.transaction, number);
    }
}

#[test]
fn a_response_may_arrive_and_a_request_may_leave_byte_by_byte() {
    let (end, mut client) = client();
    end.0.borrow_mut().piece = Some(1);
    assert!(client.queue(read(1, 7)).is_ok());
    let mut request = Vec::new();
    while request.len() < 12 {
        assert!(poll(&end, &mut client).is_empty());
        request.extend(end.sent());
    }
    for byte in response(requests(&request)[0]) {
        assert!(poll(&end, &mut client).is_empty());
        end.deliver(0, &[byte]);
    }
    assert_right(&poll(&end, &mut client)[0]);
}

#[test]
fn a_response_with_an_unknown_transaction_identifier_is_dropped_and_counted() {
    let (end, mut client) = client();
    let counters = client.line.storage.counters.clone();
    assert!(client.queue(read(1, 7)).is_ok());
    poll(&end, &mut client);
    let (wire, unit, address) = requests(&end.sent())[0];
    end.deliver(0, &response((wire.wrapping_add(1), unit, address)));
    end.deliver(0, &response((wire, unit, address)));
    // A second response to the same request.
    end.deliver(0, &response((wire, unit, address)));
    assert!(poll(&end, &mut client).is_empty());
    assert_right(&poll(&end, &mut client)[0]);
    assert!(client.queue(read(1, 8)).is_ok());
    poll(&end, &mut client);
    assert!(poll(&end, &mut client).is_empty());
    assert_eq!(counters.borrow()[Counter::ForeignFrames as usize], 2);
}

#[test]
fn a_response_of_another_unit_is_not_taken() {
    let (end, mut client) = client();
    assert!(client.queue(read(1, 7)).is_ok());
    poll(&end, &mut client);
    let (wire, _, address) = requests(&end.sent())[0];
    end.deliver(0, &response((wire, 2, address)));
    assert!(poll(&end, &mut client).is_empty());
    end.pass(2_000_000);
    assert_eq!(
        poll(&end, &mut client)[0].state.status,
        Status::INVALID_SLAVE_ID
    );
}

#[test]
fn a_response_that_does_not_match_the_request_fails_at_once() {
    for (pdu, status) in [
        (&[4, 2, 0, 7][..], Status::INVALID_FUNCTION),
        (&[3, 4, 0, 7, 0, 8], Status::MALFORMED_REPLY),
        (&[3, 2, 0, 7, 0], Status::MALFORMED_REPLY),
        (&[3, 2, 0], Status::MALFORMED_REPLY),
        (&[3], Status::MALFORMED_REPLY),
        (&[0x83, 0], Status::MALFORMED_REPLY),
        (&[0x83, 2], Status::ILLEGAL_DATA_ADDRESS),
    ] {
        let (end, mut client) = client();
        assert!(client.queue(read(1, 7)).is_ok());
        poll(&end, &mut client);
        let (wire, unit, _) = requests(&end.sent())[0];
        let [a, b] = wire.to_be_bytes();
        let mut frame = vec![a, b, 0, 0, 0, pdu.len() as u8 + 1, unit];
        frame.extend(pdu);
        end.deliver(0, &frame);
        assert_eq!(
            poll(&end, &mut client)[0].state.status,
            status,
            "{pdu:02X?}"
        );
    }
}

#[test]
fn a_server_id_longer_than_its_byte_count_is_taken_whole() {
    for (pdu, status) in [
        (&[0x11, 2, 1, 2, 0xFF, 7, 8][..], Status::OK),
        (&[0x11, 5, 1, 2, 0xFF, 7, 8], Status::OK),
        (&[0x11, 6, 1, 2, 0xFF, 7, 8], Status::MALFORMED_REPLY),
        (&[0x11], Status::MALFORMED_REPLY),
        (&[0x91, 2, 1], Status::MALFORMED_REPLY),
    ] {
        let (end, mut client) = client();
        let form = |state: &mut RequestState| state.set(FunctionSpec::REPORT_SERVER_ID, 0, 0);
        assert!(client.queue(Task::new(1, 7, &[], form)).is_ok());
        poll(&end, &mut client);
        let [a, b] = tcp::header(&end.sent()).unwrap().transaction.to_be_bytes();
        let head = [a, b, 0, 0, 0, pdu.len() as u8 + 1, 1];
        end.deliver(0, &[&head, pdu].concat());
        let task = &poll(&end, &mut client)[0];
        assert_eq!(task.state.status, status, "{pdu:02X?}");
        if status == Status::OK {
            assert_eq!(task.received(), [1, 2, 0xFF, 7, 8]);
        }
    }
}

#[test]
fn frames_are_found_again_after_garbage() {
    for garbage in [
        &[0xFF; 3][..],
        &[0, 1, 0, 1, 2, 3, 4, 5, 6, 7],
        &[0; 40],
        // These bytes look like the header of a long frame.
        &[0x12, 0x34, 0, 0, 0, 0xFE, 1, 3],
    ] {
        let (end, mut client) = client();
        assert!(client.queue(read(1, 7)).is_ok());
        poll(&end, &mut client);
        end.deliver(0, garbage);
        end.deliver(0, &response(requests(&end.sent())[0]));
        let mut ended = Vec::new();
        for _ in 0..30 {
            ended.extend(poll(&end, &mut client));
            end.pass(100_000);
        }
        assert_right(&ended[0]);
        // The client finds the next frame at once.
        assert!(client.queue(read(1, 8)).is_ok());
        poll(&end, &mut client);
        end.deliver(0, &response(requests(&end.sent())[0]));
        assert_right(&poll(&end, &mut client)[0]);
    }
}

#[test]
fn two_pending_requests_cannot_have_the_same_number() {
    let (end, mut client) = client();
    assert!(client.queue(read(1, 7)).is_ok());
    let refused = client.queue(read(2, 7)).unwrap_err();
    assert_eq!(refused.error(), Error::DuplicateTransaction);
    assert_eq!(refused.0.state.status, Status::DUPLICATE_TRANSACTION);
    assert!(client.queue(read(1, 0)).is_ok());
    assert!(client.queue(read(1, 0)).is_ok());
    poll(&end, &mut client);
    assert_eq!(requests(&end.sent()).len(), 3);
}

/// The transaction identifier has 16 bits. A client that runs for days uses each value
/// again.
#[test]
fn a_transaction_identifier_is_not_used_again_while_its_request_is_pending() {
    for others in [1, 15] {
        let (end, mut client) = client();
        for number in 1..=(16 - others) {
            assert!(client.queue(read(9, number)).is_ok());
        }
        assert!(poll(&end, &mut client).is_empty());
        let pending = requests(&end.sent());
        let mut used = std::collections::HashSet::new();
        let mut count = 0u32;
        while count < 65_536 + 600 {
            for number in 0..others {
                assert!(client.queue(read(1, 100 + number)).is_ok());
            }
            assert!(poll(&end, &mut client).is_empty());
            for request in requests(&end.sent()) {
                assert!(pending.iter().all(|held| held.0 != request.0));
                used.insert(request.0);
                end.deliver(0, &response(request));
                count += 1;
            }
            let mut ended = Vec::new();
            while ended.len() < usize::from(others) {
                ended.extend(poll(&end, &mut client));
            }
            ended.iter().for_each(assert_right);
        }
        assert!(used.len() > 60_000);
        for request in pending {
            end.deliver(0, &response(request));
            assert_right(&poll(&end, &mut client)[0]);
        }
    }
}

/// In TCP frames unit 0 is no broadcast (messaging on TCP/IP guide V1.0b, 4.4.1.2).
#[test]
fn unit_0_answers_over_tcp() {
    let (end, mut client) = client();
    assert!(client.queue(read(0, 7)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    let sent = requests(&end.sent());
    assert_eq!(sent[0].1, 0);
    end.deliver(0, &response(sent[0]));
    assert_right(&poll(&end, &mut client)[0]);
    let write = Task::new(0, 1, &[], |state| {
        state.set(FunctionSpec::WRITE_SINGLE_REGISTER, 1, 2)
    });
    assert!(client.queue(write).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    // It waits for the response.
    let request = end.sent();
    assert_eq!(request[6..], [0, 6, 0, 1, 0, 2]);
    assert!(poll(&end, &mut client).is_empty());
    end.deliver(0, &request);
    assert_eq!(poll(&end, &mut client)[0].state.status, Status::OK);
}

/// Devices that take one request at a time lose the others.
#[test]
fn one_request_is_in_flight_unless_the_program_allows_more() {
    let (end, _) = client();
    let mut client: TcpIp = Client::new(Tcp::new(end.clone(), Lent::default()));
    for number in 1..=3 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    for _ in 1..=3 {
        assert!(poll(&end, &mut client).is_empty());
        let sent = requests(&end.sent());
        assert_eq!(sent.len(), 1);
        assert!(poll(&end, &mut client).is_empty());
        assert!(end.sent().is_empty());
        end.deliver(0, &response(sent[0]));
        assert_right(&poll(&end, &mut client)[0]);
    }
}

#[test]
fn no_more_requests_are_in_flight_than_the_limit_allows() {
    let (end, mut client) = client();
    client.line.set_in_flight(2);
    for number in 1..=5 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    let mut ended = 0;
    for number in [2, 2, 1] {
        ended += poll(&end, &mut client).len();
        let sent = requests(&end.sent());
        assert_eq!(sent.len(), number);
        for request in sent {
            end.deliver(0, &response(request));
        }
        ended += poll(&end, &mut client).len();
        ended += poll(&end, &mut client).len();
    }
    assert_eq!(ended, 5);
}

#[test]
fn requests_that_do_not_fit_into_a_small_buffer_are_sent_later() {
    let (end, mut client) = client();
    client.line.storage.outgoing = vec![0; 30];
    client.line.storage.frame = Frame::new(vec![0; 12]);
    for number in 1..=5 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    let mut ended = 0;
    for _ in 0..20 {
        for task in poll(&end, &mut client) {
            assert_right(&task);
            ended += 1;
        }
        for request in requests(&end.sent()) {
            end.deliver(0, &response(request));
        }
    }
    assert_eq!(ended, 5);
}

/// More bytes than the buffer holds have arrived while the program was busy.
#[test]
fn a_late_poll_reads_all_bytes_that_have_arrived_before_it_checks_deadlines() {
    let (end, mut client) = client();
    let counters = client.line.storage.counters.clone();
    client.line.storage.frame = Frame::new(vec![0; 16]);
    for number in 1..=5 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    assert!(poll(&end, &mut client).is_empty());
    // The pieces end in the middle of responses.
    let all: Vec<u8> = requests(&end.sent())
        .into_iter()
        .flat_map(response)
        .collect();
    for piece in all.chunks(7) {
        end.deliver(0, piece);
    }
    end.pass(3_000_000);
    let ended = poll(&end, &mut client);
    assert_eq!(ended.len(), 5);
    ended.iter().for_each(assert_right);
    assert_eq!(counters.borrow()[Counter::Resynchronisations as usize], 0);
}

/// A poll ends although a noisy line has more bytes to read.
#[test]
fn endless_noise_does_not_keep_a_request_from_timing_out() {
    let (end, mut client) = client();
    assert!(client.queue(read(1, 1)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    for _ in 0..5000 {
        end.deliver(0, &[0xA5; 7]);
    }
    end.pass(3_000_000);
    let ended = poll(&end, &mut client);
    assert_eq!(ended.len(), 1);
    assert_eq!(ended[0].state.status, Status::RESPONSE_TIMED_OUT);
}

#[test]
fn a_request_that_waits_for_buffer_space_follows_one_that_was_sent_in_pieces() {
    let (end, mut client) = client();
    client.line.storage.outgoing = vec![0; 12];
    end.0.borrow_mut().piece = Some(6);
    for number in 1..=3 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    let mut sent = Vec::new();
    for _ in 0..6 {
        assert!(poll(&end, &mut client).is_empty());
        sent.extend(end.sent());
    }
    assert_eq!(requests(&sent).len(), 3);
}

#[test]
fn a_response_longer_than_the_buffer_is_skipped_and_reported() {
    let (end, mut client) = client();
    client.line.storage.frame = Frame::new(vec![0; 12]);
    assert!(client.queue(read(1, 7)).is_ok());
    let long = Task::new(1, 8, &[], |state| {
        state.set(FunctionSpec::READ_HOLDING_REGISTERS, 8, 20)
    });
    assert!(client.queue(long).is_ok());
    poll(&end, &mut client);
    let sent = requests(&end.sent());
    let [a, b] = sent[1].0.to_be_bytes();
    let mut frame = vec![a, b, 0, 0, 0, 43, 1, 3, 40];
    frame.extend([0xA5; 40]);
    end.deliver(0, &frame);
    end.deliver(0, &response(sent[0]));
    let mut ended = Vec::new();
    for _ in 0..10 {
        ended.extend(poll(&end, &mut client));
    }
    assert_eq!(ended[0].state.status, Status::BUFFER_TOO_SMALL);
    assert_right(&ended[1]);
}

#[test]
fn bytes_of_a_skipped_frame_are_not_taken_for_the_response() {
    let (end, mut client) = client();
    client.line.storage.frame = Frame::new(vec![0; 24]);
    assert!(client.queue(read(1, 7)).is_ok());
    poll(&end, &mut client);
    let (wire, unit, address) = requests(&end.sent())[0];
    let [a, b] = wire.wrapping_add(1).to_be_bytes();
    let mut frame = vec![a, b, 0, 0, 0, 43, unit, 3, 40];
    frame.resize(24, 0);
    frame.extend(response((wire, unit, 0xBAD)));
    frame.resize(49, 0);
    end.deliver(0, &frame);
    end.deliver(0, &response((wire, unit, address)));
    let mut ended = Vec::new();
    for _ in 0..10 {
        ended.extend(poll(&end, &mut client));
    }
    assert_eq!(ended.len(), 1);
    assert_right(&ended[0]);
}

#[test]
fn a_lost_link_ends_all_requests() {
    let (end, mut client) = client();
    for number in 1..=5 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    poll(&end, &mut client);
    end.0.borrow_mut().dead = true;
    let ended = poll(&end, &mut client);
    assert_eq!(ended.len(), 5);
    assert!(ended
        .iter()
        .all(|task| task.state.status == Status::LINK_LOST));
    assert!(!client.is_connected());
}

#[test]
fn a_reconnect_discards_a_half_received_response() {
    let (end, mut client) = client();
    assert!(client.queue(read(1, 1)).is_ok());
    poll(&end, &mut client);
    let sent = requests(&end.sent());
    end.deliver(0, &response(sent[0])[..9]);
    poll(&end, &mut client);
    assert!(client.queue(read(1, 2)).is_ok());
    client.reconnect();
    let ended = poll(&end, &mut client);
    assert_eq!(
        (ended[0].state.transaction, ended[0].state.status),
        (1, Status::LINK_LOST)
    );
    let sent = requests(&end.sent());
    assert_eq!(sent[0].2, 2);
    end.deliver(0, &response(sent[0]));
    assert_right(&poll(&end, &mut client)[0]);
}

/// A device may keep a connection open and answer no more on it.
#[test]
fn a_program_sees_how_many_requests_in_a_row_were_unanswered() {
    let (end, mut client) = client();
    client.policy().retries = 1;
    for round in 0..3 {
        assert!(client.queue(read(1, 1)).is_ok());
        poll(&end, &mut client);
        for expected in [1, 2] {
            assert_eq!(client.unanswered(), expected - 1);
            end.pass(2_000_000);
            poll(&end, &mut client);
            poll(&end, &mut client);
            assert_eq!(client.unanswered(), expected);
        }
        if round == 1 {
            client.reconnect();
            assert_eq!(client.unanswered(), 0);
        }
        end.sent();
        assert!(client.queue(read(1, 2)).is_ok());
        poll(&end, &mut client);
        end.deliver(0, &response(requests(&end.sent())[0]));
        assert_right(&poll(&end, &mut client)[0]);
        assert_eq!(client.unanswered(), 0);
    }
}

/// Two requests time out. While they were in flight, another one was answered.
#[test]
fn requests_that_were_in_flight_while_a_byte_came_do_not_count_as_unanswered() {
    let (end, mut client) = client();
    for number in 1..=3 {
        assert!(client.queue(read(1, number)).is_ok());
    }
    poll(&end, &mut client);
    end.deliver(0, &response(requests(&end.sent())[1]));
    assert_right(&poll(&end, &mut client)[0]);
    end.pass(2_000_000);
    assert_eq!(poll(&end, &mut client).len(), 2);
    assert_eq!(client.unanswered(), 0);
}

#[test]
fn a_cancelled_request_frees_its_place_for_the_next() {
    let (end, mut client) = client();
    client.line.set_in_flight(1);
    assert!(client.queue(read(1, 1)).is_ok());
    assert!(client.queue(read(1, 2)).is_ok());
    poll(&end, &mut client);
    let first = requests(&end.sent())[0];
    assert!(client.cancel(|task| task.state.transaction == 1).is_some());
    end.deliver(0, &response(first));
    assert!(poll(&end, &mut client).is_empty());
    end.deliver(0, &response(requests(&end.sent())[0]));
    // The response to the cancelled request is dropped.
    assert!(poll(&end, &mut client).is_empty());
    assert_right(&poll(&end, &mut client)[0]);
}

#[test]
fn a_port_that_never_accepts_a_byte_is_a_connection_that_was_not_made_in_time() {
    let (end, mut client) = client();
    for _ in 0..2 {
        end.0.borrow_mut().stuck = true;
        assert!(client.queue(read(1, 1)).is_ok());
        poll(&end, &mut client);
        end.pass(2_000_000);
        let status = poll(&end, &mut client)[0].state.status;
        assert_eq!(status, Status::CONNECT_TIMED_OUT);

        // Once it has accepted one, there is a connection.
        end.0.borrow_mut().stuck = false;
        assert!(client.queue(read(1, 1)).is_ok());
        poll(&end, &mut client);
        end.deliver(0, &response(requests(&end.sent())[0]));
        assert_right(&poll(&end, &mut client)[0]);
        end.0.borrow_mut().stuck = true;
        assert!(client.queue(read(1, 1)).is_ok());
        poll(&end, &mut client);
        end.pass(2_000_000);
        assert_eq!(poll(&end, &mut client)[0].state.status, Status::LINE_BUSY);
        client.reconnect();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Responses arrive in any order and in any pieces, some twice, some never, with garbage
    /// between them. Each request ends once: with its own data, or with a failure.
    #[test]
    fn every_request_ends_once_and_with_its_own_data(
        script in prop::collection::vec((any::<u8>(), any::<u8>(), 0u8..12), 200),
    ) {
        let (end, mut client) = client();
        let mut held: Vec<Vec<u8>> = Vec::new();
        let (mut next, mut ended) = (0u16, Vec::new());
        for (order, piece, fault) in script {
            if client.queue(read(1 + order % 3, next + 1)).is_ok() {
                next += 1;
            }
            held.extend(requests(&end.sent()).into_iter().map(response));
            if !held.is_empty() {
                let frame = held.swap_remove(usize::from(order) % held.len());
                match fault {
                    0 => {}
                    1 => { end.deliver(0, &frame); end.deliver(0, &frame); }
                    2 => { end.deliver(0, &vec![order | 1; usize::from(piece % 20)]); held.push(frame); }
                    3 => {}
                    _ => {
                        let (front, back) = frame.split_at(usize::from(piece) % frame.len());
                        end.deliver(0, front);
                        end.deliver(0, back);
                    }
                }
            }
            end.0.borrow_mut().incoming.retain(|(_, bytes)| !bytes.is_empty());
            end.pass(50_000);
            ended.extend(poll(&end, &mut client));
        }
        held.clear();
        for _ in 0..200 {
            end.pass(50_000);
            ended.extend(poll(&end, &mut client));
        }
        prop_assert_eq!(client.pending(), 0);
        prop_assert_eq!(ended.len(), usize::from(next));
        let mut numbers: Vec<u16> = ended.iter().map(|task| task.state.transaction).collect();
        numbers.sort_unstable();
        prop_assert_eq!(numbers, (1..=next).collect::<Vec<_>>());
        for task in ended {
            match task.state.status {
                Status::OK => assert_right(&task),
                other => prop_assert!(other.is_failure()),
            }
        }
    }
}

// --- which fields of a response must match the request, be it the first in flight or a later one ---

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
