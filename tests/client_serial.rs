//! The client on a serial line: every function, and how requests end.

#[path = "common/exchanges.rs"]
mod exchanges;
#[path = "common/frame.rs"]
mod frame;
#[path = "common/wire.rs"]
mod wire;

use exchanges::CASES;
use mbm::client::{Client, RequestState, Serial};
use mbm::engine::{Frame, MicrosSetting};
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::custom::Rule;
use mbm::pdu::functions::FunctionSpec;
use wire::{End, Lent, Task};

type Transport = Client<Serial<End, Lent, Task>, Task, 4>;

fn rtu_client() -> (End, Transport) {
    let end = End::default();
    (end.clone(), Client::new(Serial::new(end, Lent::default())))
}

fn ascii_client() -> (End, Transport) {
    let end = End::default();
    (
        end.clone(),
        Client::new(Serial::ascii(end, Lent::default())),
    )
}

/// Polls every 100 us until a task ends, for at most ten seconds.
fn run(end: &End, client: &mut Transport) -> Task {
    for _ in 0..100_000 {
        if let Some(task) = client.poll(end.now()) {
            return task;
        }
        end.pass(100);
    }
    panic!("no task ended");
}

/// Polls until the client has sent bytes, and returns them.
fn sent(end: &End, client: &mut Transport) -> Vec<u8> {
    for _ in 0..3_000 {
        assert!(client.poll(end.now()).is_none());
        let bytes = end.sent();
        if !bytes.is_empty() {
            return bytes;
        }
        end.pass(100);
    }
    panic!("nothing was sent");
}

fn frame(unit: u8, pdu: &[u8]) -> Vec<u8> {
    frame::framed(Framing::Rtu, 0, unit, pdu)
}

fn characters(unit: u8, pdu: &[u8]) -> Vec<u8> {
    frame::framed(Framing::Ascii, 0, unit, pdu)
}

#[test]
fn every_function_is_sent_and_answered_in_rtu() {
    for (build, data, request, response, received) in CASES {
        let (end, mut client) = rtu_client();
        assert!(client.queue(Task::new(17, 1, data, build)).is_ok());
        assert_eq!(sent(&end, &mut client), frame(17, request));
        // The reply arrives in two pieces, with a pause longer than t3.5 between them.
        let reply = frame(17, response);
        end.deliver(1_000, &reply[..3]);
        end.deliver(9_000, &reply[3..]);
        let task = run(&end, &mut client);
        assert_eq!(task.state.status, Status::OK, "{request:02X?}");
        assert_eq!(task.received(), *received, "{request:02X?}");
    }
}

#[test]
fn a_response_of_unknown_length_may_be_as_long_as_a_frame() {
    for length in 250..=253 {
        let (end, mut client) = rtu_client();
        let build: fn(&mut RequestState) -> Status = |o| o.custom(0x43, 0, Rule::Silence);
        assert!(client.queue(Task::new(17, 1, &[], build)).is_ok());
        sent(&end, &mut client);
        let mut response = vec![0x5A; length];
        response[0] = 0x43;
        let reply = frame(17, &response);
        end.deliver(1_000, &reply[..100]);
        end.deliver(2_000, &reply[100..]);
        let task = run(&end, &mut client);
        assert_eq!(task.state.status, Status::OK, "{length}");
        assert_eq!(task.received(), &response[1..]);
    }
}

/// The data of a user-defined 08 do not distinguish its replies, as those of Return Query Data do.
#[test]
fn a_late_reply_to_a_function_08_of_the_program_is_not_taken() {
    let (end, mut client) = rtu_client();
    let build: fn(&mut RequestState) -> Status = |o| o.custom(8, 2, Rule::Fixed(5));
    for status in [Status::RESPONSE_TIMED_OUT, Status::OK] {
        let task = Task::new(17, 1, &[0, 0x0B], build);
        assert!(client.queue(task).is_ok());
        sent(&end, &mut client);
        if status == Status::OK {
            end.deliver(1_000, &frame(17, &[8, 0, 0x0B, 0, 1]));
            end.deliver(9_000, &frame(17, &[8, 0, 0x0B, 0, 2]));
        }
        let task = run(&end, &mut client);
        assert_eq!(task.state.status, status);
        if status == Status::OK {
            assert_eq!(task.received(), [0, 0x0B, 0, 2]);
        }
    }
}

#[test]
fn every_function_is_sent_and_answered_in_ascii() {
    for (build, data, request, response, received) in CASES {
        let (end, mut client) = ascii_client();
        assert!(client.queue(Task::new(17, 1, data, build)).is_ok());
        assert_eq!(sent(&end, &mut client), characters(17, request));
        end.deliver(1_000, b"\xFF:11");
        end.deliver(1_000, &characters(18, response));
        end.deliver(2_000, &characters(17, response));
        let task = run(&end, &mut client);
        assert_eq!(task.state.status, Status::OK, "{request:02X?}");
        assert_eq!(task.received(), *received, "{request:02X?}");
    }
}

#[test]
fn an_exception_is_reported_for_every_function() {
    for (build, data, request, ..) in CASES {
        let (end, mut client) = rtu_client();
        assert!(client.queue(Task::new(17, 1, data, build)).is_ok());
        sent(&end, &mut client);
        end.deliver(1_000, &frame(17, &[request[0] | 0x80, 6]));
        let task = run(&end, &mut client);
        assert_eq!(task.state.status.code(), 6);
        assert_eq!(task.state.exception, 6);
        assert_eq!(task.reply[0], 0xEE);
    }
}

#[test]
fn a_response_that_does_not_match_the_request_is_malformed() {
    for (build, data, request, response, _) in CASES {
        for at in 1..response.len() {
            let (end, mut client) = rtu_client();
            assert!(client.queue(Task::new(17, 1, data, build)).is_ok());
            sent(&end, &mut client);
            let mut wrong = response.to_vec();
            wrong[at] ^= 0x40;
            end.deliver(1_000, &frame(17, &wrong));
            let task = run(&end, &mut client);
            let free = task.state.status == Status::OK;
            if free {
                // Only data that the device chooses may differ.
                assert!(!matches!(request[0], 5 | 6 | 0x0F | 0x10 | 0x15 | 0x16));
                assert!(at >= usize::from(task.state.data_at()));
            } else {
                assert!(
                    matches!(
                        task.state.status,
                        Status::MALFORMED_REPLY | Status::RESPONSE_TIMED_OUT
                    ),
                    "{request:02X?} {at} {:?}",
                    task.state.status
                );
            }
        }
    }
}

fn read(unit: u8, transaction: u16) -> Task {
    Task::new(unit, transaction, &[], |state| {
        state.set(FunctionSpec::READ_HOLDING_REGISTERS, 0, 1)
    })
}

#[test]
fn requests_are_sent_one_after_the_other_and_in_order() {
    let (end, mut client) = rtu_client();
    for number in 1..=4 {
        assert!(client.queue(read(number as u8, number)).is_ok());
    }
    let refused = client.queue(read(9, 9)).err().unwrap();
    assert_eq!(refused.error(), Status::QUEUE_FULL);
    for number in 1..=4u8 {
        let request = sent(&end, &mut client);
        assert_eq!(request[0], number);
        // Nothing else is sent while this one is in flight.
        end.pass(5_000);
        assert!(client.poll(end.now()).is_none());
        assert!(end.sent().is_empty());
        end.deliver(0, &frame(number, &[3, 2, 0, number]));
        let task = run(&end, &mut client);
        assert_eq!(
            (task.state.transaction, task.received()),
            (number.into(), &[0, number][..])
        );
    }
    assert_eq!(client.pending(), 0);
    assert_eq!(client.poll_delay(end.now()), u32::MAX);
}

#[test]
fn only_writes_are_broadcast_and_they_take_the_turnaround_delay() {
    let (end, mut client) = rtu_client();
    for (build, data, request, ..) in CASES {
        let broadcast = matches!(request[0], 5 | 6 | 0x0F | 0x10 | 0x15 | 0x16);
        match client.queue(Task::new(0, 0, data, build)) {
            Ok(()) => {
                assert!(broadcast);
                assert_eq!(sent(&end, &mut client)[0], 0);
                let begun = end.now();
                assert_eq!(run(&end, &mut client).state.status, Status::OK);
                assert!((100_000..101_000).contains(&(end.now() - begun)));
            }
            Err(task) => {
                assert!(!broadcast);
                assert_eq!(task.error(), Status::BROADCAST_NOT_ALLOWED);
            }
        }
    }
    for sub_function in 0..0x15 {
        let task = Task::new(0, 0, &[0, 0], |state| state.diagnostics(sub_function, 1));
        let queued = client.queue(task).is_ok();
        assert_eq!(queued, matches!(sub_function, 1 | 4 | 0x0A | 0x14));
        if queued {
            run(&end, &mut client);
        }
    }
}

#[test]
fn force_listen_only_mode_ends_without_a_response() {
    let (end, mut client) = rtu_client();
    let task = Task::new(17, 0, &[0, 0], |state| state.diagnostics(4, 1));
    assert!(client.queue(task).is_ok());
    assert_eq!(run(&end, &mut client).state.status, Status::OK);
    assert!(end.now() < 110_000);
}

#[test]
fn a_lost_link_ends_the_active_request_and_the_queued_ones() {
    let (end, mut client) = rtu_client();
    for number in 1..=3 {
        assert!(client.queue(read(number as u8, number)).is_ok());
    }
    sent(&end, &mut client);
    assert!(client.is_connected());
    end.0.borrow_mut().dead = true;
    for number in 1..=3 {
        let task = client.poll(end.now()).unwrap();
        assert_eq!(task.state.status, Status::LINK_LOST);
        assert_eq!(task.state.transaction, number);
    }
    assert!(client.poll(end.now()).is_none());
    assert!(!client.is_connected());
    end.0.borrow_mut().dead = false;
    client.reconnect();
    assert!(client.is_connected());
}

#[test]
fn a_reconnect_ends_only_the_active_request() {
    let (end, mut client) = rtu_client();
    for number in 1..=2 {
        assert!(client.queue(read(number as u8, number)).is_ok());
    }
    sent(&end, &mut client);
    end.deliver(0, &[1, 3]);
    assert!(client.poll(end.now()).is_none());
    client.reconnect();
    let task = run(&end, &mut client);
    assert_eq!(
        (task.state.transaction, task.state.status),
        (1, Status::LINK_LOST)
    );
    assert_eq!(sent(&end, &mut client)[0], 2);
}

#[test]
fn a_request_can_be_cancelled_while_it_is_active_or_queued() {
    let (end, mut client) = rtu_client();
    for number in 1..=3 {
        assert!(client.queue(read(number as u8, number)).is_ok());
    }
    sent(&end, &mut client);
    for number in [1, 3] {
        let task = client
            .cancel(|task| task.state.transaction == number)
            .unwrap();
        assert_eq!(task.state.status, Status::CANCELLED);
        assert!(client
            .cancel(|task| task.state.transaction == number)
            .is_none());
    }
    assert_eq!(sent(&end, &mut client)[0], 2);
    assert_eq!(client.pending(), 1);
}

#[test]
fn a_suspended_client_sends_nothing() {
    let (end, mut client) = rtu_client();
    assert!(client.suspend());
    assert!(!client.suspend());
    assert!(client.queue(read(1, 1)).is_ok());
    end.pass(50_000);
    assert!(client.poll(end.now()).is_none());
    assert_eq!(client.poll_delay(end.now()), u32::MAX);
    assert!(end.sent().is_empty());
    client.take_back();
    sent(&end, &mut client);
    assert!(!client.suspend());
}

#[test]
fn a_reply_longer_than_the_capacity_of_the_request_ends_with_buffer_too_small() {
    let (end, mut client) = rtu_client();
    let mut task = Task::new(1, 1, &[], |state| {
        state.set(FunctionSpec::REPORT_SERVER_ID, 0, 0)
    });
    task.state.capacity = 2;
    assert!(client.queue(task).is_ok());
    sent(&end, &mut client);
    end.deliver(0, &frame(1, &[0x11, 3, 1, 2, 3]));
    let task = run(&end, &mut client);
    assert_eq!(task.state.status, Status::BUFFER_TOO_SMALL);
    assert_eq!((task.state.length, task.reply[0]), (0, 0xEE));
}

#[test]
fn a_request_longer_than_the_frame_buffer_has_no_exception_of_the_request_before() {
    let end = End::default();
    let storage = Lent {
        frame: Frame::new(vec![0; 8]),
        ..Lent::default()
    };
    let mut client: Transport = Client::new(Serial::new(end.clone(), storage));
    let read = Task::new(1, 1, &[], |state| {
        state.set(FunctionSpec::READ_EXCEPTION_STATUS, 0, 0)
    });
    assert!(client.queue(read).is_ok());
    sent(&end, &mut client);
    end.deliver(0, &frame(1, &[0x87, 4]));
    assert_eq!(run(&end, &mut client).state.exception, 4);
    let write = Task::new(1, 1, &[0; 4], |state| {
        state.set(FunctionSpec::WRITE_MULTIPLE_REGISTERS, 0, 2)
    });
    assert!(client.queue(write).is_ok());
    let task = run(&end, &mut client);
    assert_eq!(
        (task.state.status, task.state.exception),
        (Status::BUFFER_TOO_SMALL, 0)
    );
}

/// The device answers in order, but its first reply arrives after the timeout. That late
/// reply looks like the reply to the next request.
fn a_late_reply_is_passed_over(line: (End, Transport), encode: fn(u8, &[u8]) -> Vec<u8>) {
    let (end, mut client) = line;
    client.line.settings.response_timeout = MicrosSetting::new(500_000);
    let reply = |value: u8| encode(17, &[3, 2, 0, value]);
    assert!(client.queue(read(17, 1)).is_ok());
    assert_eq!(
        run(&end, &mut client).state.status,
        Status::RESPONSE_TIMED_OUT
    );
    for value in 1..5 {
        assert!(client.queue(read(17, 1)).is_ok());
        sent(&end, &mut client);
        if value == 1 {
            end.deliver(150_000, &reply(0));
        }
        end.deliver(30_000, &reply(value));
        let task = run(&end, &mut client);
        assert_eq!(task.state.status, Status::OK);
        assert_eq!(task.received(), [0, value]);
    }
}

#[test]
fn a_late_reply_in_rtu_frames_is_not_the_answer_to_a_later_request() {
    a_late_reply_is_passed_over(rtu_client(), frame);
}

#[test]
fn a_late_reply_in_ascii_frames_is_not_the_answer_to_a_later_request() {
    a_late_reply_is_passed_over(ascii_client(), characters);
}

/// Reads the exception status of unit 2 while `line` arrives in ASCII framing; returns the
/// ended task.
fn ended_in_ascii(line: &[u8]) -> Task {
    let (end, mut client) = ascii_client();
    client.line.storage.frame = Frame::new(vec![0; 40]);
    let build: fn(&mut RequestState) -> Status =
        |o| o.set(FunctionSpec::READ_EXCEPTION_STATUS, 0, 0);
    assert!(client.queue(Task::new(2, 1, &[], build)).is_ok());
    sent(&end, &mut client);
    // The characters arrive one by one.
    for (index, character) in line.iter().enumerate() {
        end.deliver(1_000 * index as u32, &[*character]);
    }
    run(&end, &mut client)
}

#[test]
fn an_ascii_frame_is_found_after_noise_and_after_a_truncated_frame() {
    for line in [&b":02075A9D\r\n"[..], b"\xFF12\r\n:0207:02075A9D\r\n"] {
        let task = ended_in_ascii(line);
        assert_eq!(
            (task.state.status, task.received()),
            (Status::OK, &[0x5A][..])
        );
    }
}

#[test]
fn the_most_specific_fault_on_an_ascii_line_becomes_the_status() {
    for (line, status) in [
        (&b":03075A9C\r\n"[..], Status::INVALID_SLAVE_ID),
        (b":02085A9C\r\n", Status::INVALID_FUNCTION),
        (b":0207005A9D\r\n", Status::MALFORMED_REPLY),
        (b":02075A9E\r\n", Status::INVALID_CRC),
        (&[b':'; 50], Status::RESPONSE_TIMED_OUT),
        (
            b":02070000000000000000000000000000000000000000000000",
            Status::BUFFER_TOO_SMALL,
        ),
    ] {
        assert_eq!(ended_in_ascii(line).state.status, status, "{line:?}");
    }
}

/// Sends a read of the unit and cancels it. Returns how many microseconds passed until it was sent.
fn send_and_cancel(end: &End, client: &mut Transport, unit: u8) -> u32 {
    let began = end.now();
    let read: fn(&mut RequestState) -> Status = |o| o.set(FunctionSpec::READ_COILS, 0, 8);
    assert!(client.queue(Task::new(unit, 1, &[], read)).is_ok());
    // At most the silence after which a unit is clean: 4.1 s.
    for _ in 0..42_000 {
        assert!(client.poll(end.now()).is_none());
        if !end.sent().is_empty() {
            break;
        }
        end.pass(100);
    }
    assert!(client.cancel(|_| true).is_some());
    end.now() - began
}

/// There are more units than records, so all wait, but not for ever.
#[test]
fn units_are_remembered_exactly_again_after_too_many_were_cancelled() {
    let (end, mut client) = rtu_client();
    let longest = |end: &End, client: &mut Transport| {
        (1..=12)
            .map(|unit| send_and_cancel(end, client, unit))
            .max()
    };
    assert!(longest(&end, &mut client) >= Some(1_000_000));
    for _ in 0..3 {
        end.pass(10_000_000);
        // After each cancelled request the line is left alone for the quiet time.
        for unit in 1..=10 {
            assert!(send_and_cancel(&end, &mut client, unit) <= 110_000);
        }
        end.pass(200_000);
        assert!(send_and_cancel(&end, &mut client, 1) >= 1_000_000);
        end.pass(10_000_000);
    }
}

/// Queues a read of the unit's exception status, with a timeout of its own.
fn queue_read(client: &mut Transport, unit: u8, timeout_ms: u32) {
    let read: fn(&mut RequestState) -> Status =
        |o| o.set(FunctionSpec::READ_EXCEPTION_STATUS, 0, 0);
    let mut task = Task::new(unit, 1, &[], read);
    task.state.timeout_ms = timeout_ms;
    assert!(client.queue(task).is_ok());
}

/// Unit 1 answers the first read only after the second one of it was sent, and this one as well. The
/// second read must have the second answer, whatever timeouts it and a read of unit 2 have.
fn second_answer_after_a_late_one(timeout_ms: u32, is_other_read: bool) -> Task {
    let (end, mut client) = rtu_client();
    queue_read(&mut client, 1, 1000);
    assert_eq!(
        run(&end, &mut client).state.status,
        Status::RESPONSE_TIMED_OUT
    );
    if is_other_read {
        queue_read(&mut client, 2, 20);
        let status = run(&end, &mut client).state.status;
        assert_eq!(status, Status::RESPONSE_TIMED_OUT);
    }
    end.sent();
    queue_read(&mut client, 1, timeout_ms);
    sent(&end, &mut client);
    end.deliver(2_000, &frame(1, &[7, 0x11]));
    end.deliver(10_000, &frame(1, &[7, 0x22]));
    run(&end, &mut client)
}

#[test]
fn a_request_with_a_shorter_timeout_takes_no_late_reply_to_an_earlier_one() {
    let task = second_answer_after_a_late_one(20, false);
    assert_eq!(
        (task.state.status, task.received()),
        (Status::OK, &[0x22][..])
    );
}

#[test]
fn a_short_timeout_of_one_unit_does_not_end_the_memory_of_another() {
    let task = second_answer_after_a_late_one(1000, true);
    assert_eq!(
        (task.state.status, task.received()),
        (Status::OK, &[0x22][..])
    );
}

/// The next request to a unit waits after a cancelled one, until the reply to that one comes.
fn is_sent_once_the_reply_has_come(client: &mut Transport, end: &End, before: &[u8], reply: &[u8]) {
    queue_read(client, 1, 1000);
    sent(end, client);
    assert!(client.cancel(|_| true).is_some());
    queue_read(client, 2, 1000);
    sent(end, client);
    // The other unit answers at once, and the late reply follows it at once.
    end.deliver(100, before);
    assert_eq!(run(end, client).state.status, Status::OK);
    queue_read(client, 1, 1000);
    end.deliver(1_000, reply);
    let began = end.now();
    sent(end, client);
    assert!(end.now() - began < 20_000);
}

#[test]
fn a_unit_is_clean_once_its_late_reply_has_come_behind_that_of_another_unit() {
    let (end, mut client) = rtu_client();
    let reply = |unit| frame(unit, &[7, 0x11]);
    is_sent_once_the_reply_has_come(&mut client, &end, &reply(2), &reply(1));
}

#[test]
fn a_unit_on_an_ascii_line_is_clean_once_its_late_reply_has_come() {
    let (end, mut client) = ascii_client();
    let reply = |unit| characters(unit, &[7, 0x11]);
    is_sent_once_the_reply_has_come(&mut client, &end, &reply(2), &reply(1));
}

#[test]
fn a_pause_of_any_length_makes_a_unit_clean() {
    // Up to the wrap of the clock after 71.6 minutes.
    for pause_ms in (3_000..4_294_900).step_by(7_919) {
        let (end, mut client) = rtu_client();
        queue_read(&mut client, 1, 1000);
        sent(&end, &mut client);
        assert!(client.cancel(|_| true).is_some());
        end.pass(pause_ms * 1000);
        queue_read(&mut client, 1, 1000);
        let began = end.now();
        sent(&end, &mut client);
        let waited = end.now().wrapping_sub(began);
        assert!(waited < 300_000, "{pause_ms} ms of pause: {waited} us");
    }
}
