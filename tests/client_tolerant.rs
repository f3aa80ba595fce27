//! The client on a TCP stream to a device that answers with another unit or transaction identifier,
//! with more data than it was asked for, or that needs time between requests.

#[allow(dead_code)]
#[path = "common/stream.rs"]
mod stream;

use mbm::client::{Client, RequestState, TolerantTcp, ACCEPT_TRANSACTION, ACCEPT_UNIT};
use mbm::engine::Counter;
use mbm::error::Status;
use mbm::pdu::functions::FunctionSpec;
use proptest::prelude::*;
use stream::wire::{End, Lent, Task};
use stream::{poll, read, requests, response};

type Tolerant = Client<TolerantTcp<End, Lent>, Task, 16>;

/// The default response timeout, and the quiet time.
const TIMEOUT: u32 = 2_000_000;
const QUIET: u32 = 100_000;

fn client(accept: u8) -> (End, Tolerant) {
    let end = End::default();
    let mut client: Tolerant = Client::new(TolerantTcp::new(end.clone(), Lent::default()));
    assert!(client.line.set_accept(accept));
    (end, client)
}

/// Queues a read of an address, and returns the request as it was sent.
fn ask(end: &End, client: &mut Tolerant, unit: u8, address: u16) -> (u16, u8, u16) {
    assert!(client.queue(read(unit, address)).is_ok());
    assert!(poll(end, client).is_empty());
    requests(&end.sent())[0]
}

fn only(mut ended: Vec<Task>) -> Task {
    assert_eq!(ended.len(), 1);
    ended.remove(0)
}

fn assert_right(task: &Task) {
    assert_eq!(task.state.status, Status::OK);
    assert_eq!(task.received(), task.state.transaction.to_be_bytes());
}

#[test]
fn a_response_with_any_transaction_identifier_is_accepted() {
    for theirs in [0, 1, 0x1234, u16::MAX] {
        let (end, mut client) = client(ACCEPT_TRANSACTION);
        for address in 5..9 {
            let (_, unit, address) = ask(&end, &mut client, 1, address);
            end.deliver(0, &response((theirs, unit, address)));
            assert_right(&only(poll(&end, &mut client)));
        }
    }
}

#[test]
fn a_response_of_any_unit_is_accepted_with_many_requests_in_flight() {
    let (end, mut client) = client(ACCEPT_UNIT);
    assert!(client.line.tcp.set_in_flight(16));
    for address in 1..=16 {
        assert!(client.queue(read(3, address)).is_ok());
    }
    assert!(poll(&end, &mut client).is_empty());
    for (wire, _, address) in requests(&end.sent()).into_iter().rev() {
        end.deliver(0, &response((wire, 0, address)));
    }
    let mut ended = Vec::new();
    for _ in 0..16 {
        ended.extend(poll(&end, &mut client));
    }
    assert_eq!(ended.len(), 16);
    ended.iter().for_each(assert_right);
}

#[test]
fn each_is_accepted_only_if_it_was_set() {
    for (accept, wire, unit) in [
        (0, 9, 1),
        (0, 0, 2),
        (ACCEPT_UNIT, 9, 1),
        (ACCEPT_UNIT, 9, 2),
        (ACCEPT_TRANSACTION, 0, 2),
    ] {
        let (end, mut client) = client(accept);
        let counters = client.line.tcp.storage.counters.clone();
        let (_, _, address) = ask(&end, &mut client, 1, 5);
        end.deliver(0, &response((wire, unit, address)));
        assert!(poll(&end, &mut client).is_empty());
        assert_eq!(counters.borrow()[Counter::ForeignFrames as usize], 1);
        end.pass(TIMEOUT);
        assert!(only(poll(&end, &mut client)).state.status.is_failure());
    }
}

#[test]
fn a_frame_that_does_not_answer_the_request_is_passed_over_and_the_right_one_taken() {
    for pdu in [
        &[4, 2, 0, 9][..],
        &[3, 4, 0, 9, 0, 9],
        &[3, 2, 0],
        &[0x84, 2],
        &[0x83],
    ] {
        let (end, mut client) = client(ACCEPT_TRANSACTION | ACCEPT_UNIT);
        let asked = ask(&end, &mut client, 1, 5);
        let mut frame = vec![0, 77, 0, 0, 0, pdu.len() as u8 + 1, 9];
        frame.extend(pdu);
        end.deliver(0, &frame);
        assert!(poll(&end, &mut client).is_empty(), "{pdu:02X?}");
        end.deliver(0, &response((78, 9, asked.2)));
        assert_right(&only(poll(&end, &mut client)));
    }
}

#[test]
fn an_exception_with_another_transaction_identifier_is_the_result() {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    ask(&end, &mut client, 1, 5);
    end.deliver(0, &[0, 99, 0, 0, 0, 3, 1, 0x83, 2]);
    let ended = only(poll(&end, &mut client));
    assert_eq!(ended.state.status, Status::ILLEGAL_DATA_ADDRESS);
    assert_eq!(ended.state.exception, 2);
}

/// The device answers the first request only when the second one would be in flight.
#[test]
fn a_late_response_is_not_taken_for_that_to_the_next_request() {
    for late_by in [1, TIMEOUT / 2, TIMEOUT + QUIET - 1] {
        let (end, mut client) = client(ACCEPT_TRANSACTION);
        let first = ask(&end, &mut client, 1, 5);
        assert!(client.queue(read(1, 6)).is_ok());
        end.pass(TIMEOUT);
        let ended = only(poll(&end, &mut client));
        assert_eq!(ended.state.status, Status::RESPONSE_TIMED_OUT);
        // The next one waits.
        assert!(end.sent().is_empty());
        end.pass(late_by - 1);
        assert!(poll(&end, &mut client).is_empty());
        assert!(end.sent().is_empty());
        end.deliver(0, &response((0, first.1, first.2)));
        end.pass(1);
        assert!(poll(&end, &mut client).is_empty());
        // That was what the device owed: the next one is sent at once.
        end.pass(1);
        assert!(poll(&end, &mut client).is_empty());
        let second = requests(&end.sent())[0];
        assert_eq!(second.2, 6);
        end.deliver(0, &response((0, second.1, second.2)));
        assert_right(&only(poll(&end, &mut client)));
    }
}

#[test]
fn after_silence_the_next_request_is_sent_once_a_late_response_cannot_come() {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    ask(&end, &mut client, 1, 5);
    end.pass(TIMEOUT);
    only(poll(&end, &mut client));
    assert!(client.queue(read(1, 6)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    assert_eq!(client.poll_delay(end.now()), TIMEOUT + QUIET);
    end.pass(TIMEOUT + QUIET - 1);
    assert!(poll(&end, &mut client).is_empty());
    assert!(end.sent().is_empty());
    end.pass(1);
    assert!(poll(&end, &mut client).is_empty());
    let second = requests(&end.sent())[0];
    end.deliver(0, &response((0, second.1, second.2)));
    assert_right(&only(poll(&end, &mut client)));
}

#[test]
fn a_repetition_waits_as_the_next_request_does() {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    client.policy().retries = 1;
    ask(&end, &mut client, 1, 5);
    end.pass(TIMEOUT);
    assert!(poll(&end, &mut client).is_empty());
    assert!(poll(&end, &mut client).is_empty());
    assert!(end.sent().is_empty());
    assert_eq!(client.poll_delay(end.now()), TIMEOUT + QUIET);
    end.pass(TIMEOUT + QUIET);
    assert!(poll(&end, &mut client).is_empty());
    let again = requests(&end.sent())[0];
    end.deliver(0, &response((0, again.1, again.2)));
    assert_right(&only(poll(&end, &mut client)));
}

#[test]
fn after_a_cancelled_request_the_next_one_waits_too() {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    let first = ask(&end, &mut client, 1, 5);
    assert!(client.cancel(|task| task.state.transaction == 5).is_some());
    assert!(client.queue(read(1, 6)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    assert!(end.sent().is_empty());
    end.deliver(0, &response((0, first.1, first.2)));
    assert!(poll(&end, &mut client).is_empty());
    assert!(poll(&end, &mut client).is_empty());
    assert_eq!(requests(&end.sent())[0].2, 6);
}

#[test]
fn over_a_new_connection_no_late_response_comes_so_the_next_request_is_sent_at_once() {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    ask(&end, &mut client, 1, 5);
    end.pass(TIMEOUT);
    only(poll(&end, &mut client));
    client.reconnect();
    let second = ask(&end, &mut client, 1, 6);
    end.deliver(0, &response((0, second.1, second.2)));
    assert_right(&only(poll(&end, &mut client)));
}

#[test]
fn what_has_arrived_before_a_request_is_sent_is_no_response_to_it() {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    let first = ask(&end, &mut client, 1, 5);
    // The device sends its response twice.
    end.deliver(0, &response((0, first.1, first.2)));
    end.deliver(0, &response((0, first.1, first.2)));
    assert_right(&only(poll(&end, &mut client)));
    let second = ask(&end, &mut client, 1, 6);
    assert!(poll(&end, &mut client).is_empty());
    end.deliver(0, &response((0, second.1, second.2)));
    assert_right(&only(poll(&end, &mut client)));
}

#[test]
fn a_response_is_found_after_garbage_although_its_identifier_is_another() {
    for garbage in [
        &[0xFF; 3][..],
        &[0, 1, 0, 1, 2, 3, 4, 5, 6, 7],
        &[0x12, 0x34, 0, 0, 0, 0xFE, 1, 3],
    ] {
        let (end, mut client) = client(ACCEPT_TRANSACTION);
        let asked = ask(&end, &mut client, 1, 5);
        end.deliver(0, garbage);
        end.deliver(0, &response((0, asked.1, asked.2)));
        let mut ended = Vec::new();
        for _ in 0..60 {
            ended.extend(poll(&end, &mut client));
            end.pass(100_000);
        }
        assert_right(&ended[0]);
        let next = ask(&end, &mut client, 1, 6);
        end.deliver(0, &response((0, next.1, next.2)));
        assert_right(&only(poll(&end, &mut client)));
    }
}

#[test]
fn a_device_that_repeats_the_identifier_is_answered_as_without_the_setting() {
    let (end, mut client) = client(ACCEPT_TRANSACTION | ACCEPT_UNIT);
    for address in 1..300 {
        let asked = ask(&end, &mut client, 1, address);
        end.deliver(0, &response(asked));
        assert_right(&only(poll(&end, &mut client)));
    }
}

#[test]
fn another_identifier_and_a_message_wait_need_one_request_in_flight() {
    let (_, mut client) = client(0);
    let line = &mut client.line;
    assert!(line.tcp.set_in_flight(2));
    assert!(!line.set_accept(ACCEPT_TRANSACTION));
    assert!(!line.set_message_wait(1));
    assert!(line.set_accept(ACCEPT_UNIT));
    assert!(line.tcp.set_in_flight(1));
    assert!(line.set_accept(ACCEPT_TRANSACTION));
    assert!(!line.tcp.set_in_flight(2));
    assert!(line.set_message_wait(1));
    assert!(line.set_accept(0));
    assert!(!line.tcp.set_in_flight(2));
    assert!(line.set_message_wait(0));
    assert!(line.tcp.set_in_flight(2));
    assert!(!line.set_accept(4));
}

#[test]
fn a_message_wait_passes_between_the_end_of_a_request_and_the_next() {
    let (end, mut client) = client(0);
    assert!(client.line.set_message_wait(30_000));
    // The first one is sent at once.
    for address in 1..4 {
        assert!(client.queue(read(1, address)).is_ok());
    }
    for address in 1..4 {
        assert!(poll(&end, &mut client).is_empty());
        let asked = requests(&end.sent());
        assert_eq!(asked.len(), 1);
        assert_eq!(asked[0].2, address);
        end.pass(500);
        end.deliver(0, &response(asked[0]));
        assert_right(&only(poll(&end, &mut client)));
        assert!(end.sent().is_empty());
        if address < 3 {
            assert_eq!(client.poll_delay(end.now()), 30_000);
        }
        end.pass(29_999);
        assert!(poll(&end, &mut client).is_empty());
        assert!(end.sent().is_empty());
        end.pass(1);
    }
    // A request that is queued after the wait is sent at once.
    end.pass(3_000_000_000);
    ask(&end, &mut client, 1, 9);
    // After a timeout it counts from there.
    end.pass(TIMEOUT);
    only(poll(&end, &mut client));
    assert!(client.queue(read(1, 10)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    assert!(end.sent().is_empty());
    end.pass(30_000);
    assert!(poll(&end, &mut client).is_empty());
    assert_eq!(requests(&end.sent()).len(), 1);
}

/// The answer of a device to a request of 12 bytes: header, PDU.
fn answer(request: &[u8], pdu: &[u8]) -> Vec<u8> {
    let mut frame = request[..4].to_vec();
    frame.extend([0, pdu.len() as u8 + 1, request[6]]);
    frame.extend(pdu);
    frame
}

fn write(build: fn(&mut RequestState) -> Status) -> Task {
    Task::new(1, 5, &[0, 7, 0, 8], build)
}

#[test]
fn a_lenient_client_takes_the_first_data_of_a_read_that_are_too_many() {
    let (end, mut client) = client(0);
    client.line.set_lenient(true);
    for (pdu, status) in [
        (&[3, 4, 0, 5, 9, 9][..], Status::OK),
        (&[3, 2, 0, 5], Status::OK),
        // Half a register, too few, another count than there are bytes, another function.
        (&[3, 3, 0, 5, 9], Status::MALFORMED_REPLY),
        (&[3, 1, 0], Status::MALFORMED_REPLY),
        (&[3, 4, 0, 5], Status::MALFORMED_REPLY),
        (&[3, 2, 0, 5, 9, 9], Status::MALFORMED_REPLY),
        (&[4, 4, 0, 5, 9, 9], Status::INVALID_FUNCTION),
        (&[0x83, 2], Status::ILLEGAL_DATA_ADDRESS),
    ] {
        assert!(client.queue(read(1, 5)).is_ok());
        assert!(poll(&end, &mut client).is_empty());
        end.deliver(0, &answer(&end.sent(), pdu));
        let task = only(poll(&end, &mut client));
        assert_eq!(task.state.status, status, "{pdu:02X?}");
        if status == Status::OK {
            assert_eq!(task.received(), [0, 5]);
        }
    }
}

#[test]
fn a_lenient_client_takes_the_response_to_a_write_that_repeats_something_else() {
    let single = |state: &mut RequestState| state.set(FunctionSpec::WRITE_SINGLE_REGISTER, 1, 2);
    for (is_lenient, pdu, status) in [
        (true, &[6, 0, 1, 0, 3][..], Status::OK),
        (true, &[6, 0, 9, 0, 2], Status::OK),
        (true, &[6, 0, 1, 0], Status::MALFORMED_REPLY),
        (true, &[6, 0, 1, 0, 2, 0], Status::MALFORMED_REPLY),
        (true, &[5, 0, 1, 0, 2], Status::INVALID_FUNCTION),
        (false, &[6, 0, 1, 0, 3], Status::MALFORMED_REPLY),
    ] {
        let (end, mut client) = client(0);
        client.line.set_lenient(is_lenient);
        assert!(client.queue(write(single)).is_ok());
        assert!(poll(&end, &mut client).is_empty());
        end.deliver(0, &answer(&end.sent(), pdu));
        let task = only(poll(&end, &mut client));
        assert_eq!(task.state.status, status, "{pdu:02X?}");
    }
}

/// What a device with identifiers of its own does with a request.
#[derive(Clone, Copy, Debug)]
enum Does {
    /// Answers after this part of the response timeout, in percent.
    Answers(u32),
    Nothing,
    Twice,
}

fn does(slowest: u32) -> impl Strategy<Value = Does> {
    prop_oneof![
        6 => (0..slowest).prop_map(Does::Answers),
        1 => Just(Does::Nothing),
        1 => Just(Does::Twice),
    ]
}

/// Runs requests against such a device; each reads an address, which is its value. Returns how many
/// were answered. No answer may be that to another request. `reconnects`: after each failure the
/// connection is a new one.
fn run(script: &[Does], reconnects: bool) -> usize {
    let (end, mut client) = client(ACCEPT_TRANSACTION);
    let mut answered = 0;
    for (number, does) in script.iter().enumerate() {
        let address = 1 + number as u16;
        assert!(client.queue(read(1, address)).is_ok());
        let mut is_asked = false;
        let start = end.now();
        loop {
            if let Some(task) = poll(&end, &mut client).pop() {
                if task.state.status == Status::OK {
                    assert_right(&task);
                    answered += 1;
                } else if reconnects {
                    end.0.borrow_mut().incoming.clear();
                    client.reconnect();
                }
                break;
            }
            for request in requests(&end.sent()) {
                assert!(!is_asked);
                is_asked = true;
                let bytes = response((0, request.1, request.2));
                match *does {
                    Does::Answers(percent) => end.deliver(TIMEOUT / 100 * percent, &bytes),
                    Does::Nothing => {}
                    Does::Twice => {
                        end.deliver(0, &bytes);
                        end.deliver(0, &bytes);
                    }
                }
            }
            end.pass(5_000);
            // A request ends in bounded time: it may wait for two timeouts before it is sent.
            assert!(end.now().wrapping_sub(start) < 4 * TIMEOUT);
        }
    }
    answered
}

proptest! {
    #[test]
    fn no_response_is_that_to_another_request_if_it_comes_within_two_timeouts(
        script in prop::collection::vec(does(199), 1..40),
    ) {
        run(&script, false);
    }

    #[test]
    fn over_new_connections_after_failures_no_response_is_that_to_another_request(
        script in prop::collection::vec(does(1000), 1..40),
    ) {
        run(&script, true);
    }

    #[test]
    fn a_device_that_answers_in_time_again_is_understood_again(
        script in prop::collection::vec(does(199), 1..10),
    ) {
        let mut whole = script.clone();
        whole.extend([Does::Answers(10); 5]);
        let before = run(&script, false);
        prop_assert_eq!(run(&whole, false), before + 5);
    }
}
