//! A lenient client on a serial line: replies with more data than requested, and replies to writes
//! that repeat something else.

#[path = "common/frame.rs"]
mod frame;
#[path = "common/wire.rs"]
mod wire;

use mbm::client::{Client, RequestState, Serial};
use mbm::engine::Counter;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::functions::FunctionSpec;
use wire::{End, Lent, Task};

type Line = Client<Serial<End, Lent, Task>, Task, 4>;

fn client() -> (End, Line) {
    let end = End::default();
    let mut client: Line = Client::new(Serial::new(end.clone(), Lent::default()));
    client.line.set_lenient(true);
    (end, client)
}

fn frame(unit: u8, pdu: &[u8]) -> Vec<u8> {
    frame::framed(Framing::Rtu, 0, unit, pdu)
}

fn read(address: u16, quantity: u16) -> Task {
    Task::new(17, 1, &[], |state| {
        state.set(FunctionSpec::READ_HOLDING_REGISTERS, address, quantity)
    })
}

/// Sends the request, and delivers `bytes` a millisecond later. Returns the request when it has
/// ended, and how long that took, in microseconds.
fn ask(end: &End, client: &mut Line, task: Task, bytes: &[u8]) -> (Task, u32) {
    assert!(client.queue(task).is_ok());
    while end.sent().is_empty() {
        assert!(client.poll(end.now()).is_none());
        end.pass(100);
    }
    end.deliver(1_000, bytes);
    let start = end.now();
    for _ in 0..100_000 {
        if let Some(task) = client.poll(end.now()) {
            return (task, end.now().wrapping_sub(start));
        }
        end.pass(100);
    }
    panic!("no task ended");
}

#[test]
fn a_read_takes_the_first_data_of_a_reply_with_too_many_after_the_silence() {
    for (quantity, pdu, wanted) in [
        (1, &[3, 4, 0, 5, 9, 9][..], &[0, 5][..]),
        (1, &[3, 6, 0, 5, 9, 9, 9, 9], &[0, 5]),
        (2, &[3, 8, 0, 5, 0, 6, 9, 9, 9, 9], &[0, 5, 0, 6]),
        (1, &[3, 2, 0, 5], &[0, 5]),
    ] {
        let (end, mut client) = client();
        let counters = client.line.storage.counters.clone();
        for _ in 0..3 {
            let (task, time) = ask(&end, &mut client, read(0, quantity), &frame(17, pdu));
            assert_eq!(task.state.status, Status::OK, "{pdu:02X?}");
            assert_eq!(task.received(), wanted);
            assert!(time < 10_000, "{time}");
        }
        assert_eq!(counters.borrow()[Counter::ForeignFrames as usize], 0);
        assert_eq!(counters.borrow()[Counter::Replies as usize], 3);
    }
}

#[test]
fn a_read_of_bits_takes_those_that_were_requested() {
    let (end, mut client) = client();
    let task = Task::new(17, 1, &[], |state| {
        state.set(FunctionSpec::READ_COILS, 0, 3)
    });
    let (task, _) = ask(&end, &mut client, task, &frame(17, &[1, 2, 0xFF, 0xFF]));
    assert_eq!(task.state.status, Status::OK);
    assert_eq!(task.received(), [7]);
}

#[test]
fn a_reply_that_comes_after_noise_or_byte_by_byte_is_found() {
    let (end, mut client) = client();
    let reply = frame(17, &[3, 4, 0, 5, 9, 9]);
    for noise in [&[0u8][..], &[17], &[17, 3], &[0xFF; 9]] {
        let (task, _) = ask(&end, &mut client, read(0, 1), &[noise, &reply].concat());
        assert_eq!(task.state.status, Status::OK, "{noise:02X?}");
        assert_eq!(task.received(), [0, 5]);
    }
    assert!(client.queue(read(0, 1)).is_ok());
    while end.sent().is_empty() {
        assert!(client.poll(end.now()).is_none());
        end.pass(100);
    }
    for byte in reply {
        end.deliver(0, &[byte]);
        assert!(client.poll(end.now()).is_none());
        end.pass(1_000);
    }
    end.pass(4_000);
    assert_eq!(client.poll(end.now()).unwrap().received(), [0, 5]);
}

#[test]
fn what_deviates_in_another_way_is_not_taken() {
    for (pdu, status) in [
        // Fewer data, half a register, another count than there are bytes.
        (&[3, 2, 0, 5][..], Status::MALFORMED_REPLY),
        (&[3, 5, 0, 5, 0, 6, 7], Status::MALFORMED_REPLY),
        (&[3, 8, 0, 5, 0, 6], Status::MALFORMED_REPLY),
        (&[4, 6, 0, 5, 0, 6, 0, 7], Status::INVALID_FUNCTION),
        (&[0x83, 2], Status::ILLEGAL_DATA_ADDRESS),
    ] {
        let (end, mut client) = client();
        let (task, _) = ask(&end, &mut client, read(0, 2), &frame(17, pdu));
        assert_eq!(task.state.status, status, "{pdu:02X?}");
    }
    let (end, mut client) = client();
    let mut damaged = frame(17, &[3, 4, 0, 5, 9, 9]);
    damaged[5] ^= 1;
    let (task, _) = ask(&end, &mut client, read(0, 1), &damaged);
    assert!(task.state.status.is_failure());
}

/// The request for address 3xx (hex) has the form of a reply with three bytes of data.
#[test]
fn the_echo_of_the_request_is_no_reply() {
    for address in [0x0300, 0x0301, 0x03FF] {
        let (end, mut client) = client();
        let [high, low] = u16::to_be_bytes(address);
        let echo = frame(17, &[3, high, low, 0, 1]);
        let reply = frame(17, &[3, 4, 0, 5, 9, 9]);
        let (task, _) = ask(&end, &mut client, read(address, 1), &[echo, reply].concat());
        assert_eq!(task.state.status, Status::OK);
        assert_eq!(task.received(), [0, 5]);
        let bits = Task::new(17, 1, &[], |state| {
            state.set(FunctionSpec::READ_COILS, address, 1)
        });
        let echo = frame(17, &[1, high, low, 0, 1]);
        let (task, _) = ask(&end, &mut client, bits, &echo);
        assert!(task.state.status.is_failure());
    }
}

#[test]
fn a_right_reply_after_it_wins() {
    let (end, mut client) = client();
    let bytes = [frame(17, &[3, 4, 0, 9, 0, 9]), frame(17, &[3, 2, 0, 5])].concat();
    let (task, _) = ask(&end, &mut client, read(0, 1), &bytes);
    assert_eq!(task.received(), [0, 5]);
    let bytes = [frame(17, &[3, 4, 0, 9, 0, 9]), frame(17, &[0x83, 2])].concat();
    let (task, _) = ask(&end, &mut client, read(0, 1), &bytes);
    assert_eq!(task.state.status, Status::ILLEGAL_DATA_ADDRESS);
}

#[test]
fn the_reply_to_a_write_may_repeat_another_address_or_value() {
    type Build = fn(&mut RequestState) -> Status;
    let single: Build = |state| state.set(FunctionSpec::WRITE_SINGLE_REGISTER, 1, 2);
    let several: Build = |state| state.set(FunctionSpec::WRITE_MULTIPLE_REGISTERS, 1, 2);
    for (build, pdu, status) in [
        (single, &[6, 0, 1, 0, 3][..], Status::OK),
        (single, &[6, 0, 9, 0, 2], Status::OK),
        (several, &[0x10, 0, 1, 0, 1], Status::OK),
        (several, &[0x10, 0, 0, 0, 2], Status::OK),
        (several, &[0x10, 0, 0, 0, 2, 0], Status::MALFORMED_REPLY),
    ] {
        let (end, mut client) = client();
        let task = Task::new(17, 1, &[0, 7, 0, 8], build);
        let (task, _) = ask(&end, &mut client, task, &frame(17, pdu));
        assert_eq!(task.state.status, status, "{pdu:02X?}");
    }
}

/// The unit owes a reply after a timeout: what comes first may be that one.
#[test]
fn a_late_reply_that_deviates_is_held_as_a_right_one_is() {
    let (end, mut client) = client();
    let (task, _) = ask(&end, &mut client, read(0, 1), &[]);
    assert_eq!(task.state.status, Status::RESPONSE_TIMED_OUT);
    let late = frame(17, &[3, 4, 0, 9, 0, 9]);
    let own = frame(17, &[3, 4, 0, 5, 9, 9]);
    let (task, _) = ask(&end, &mut client, read(0, 1), &[late, own].concat());
    assert_eq!(task.state.status, Status::OK);
    assert_eq!(task.received(), [0, 5]);
    // In time again: the next ones are taken after the silence.
    let (task, time) = ask(
        &end,
        &mut client,
        read(0, 1),
        &frame(17, &[3, 4, 0, 6, 9, 9]),
    );
    assert_eq!(task.received(), [0, 6]);
    assert!(time < 10_000);
}

#[test]
fn it_is_strict_again_once_it_is_switched_off_and_in_ascii() {
    let (end, mut client) = client();
    client.line.set_lenient(false);
    let pdu = [3, 4, 0, 5, 9, 9];
    let (task, _) = ask(&end, &mut client, read(0, 1), &frame(17, &pdu));
    assert_eq!(task.state.status, Status::MALFORMED_REPLY);
    client.line.set_lenient(true);
    client.line.set_ascii();
    let reply = frame::framed(Framing::Ascii, 0, 17, &pdu);
    let (task, _) = ask(&end, &mut client, read(0, 1), &reply);
    assert_eq!(task.state.status, Status::MALFORMED_REPLY);
}
