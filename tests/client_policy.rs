//! When a client sends a request, when it retries, and how it records each unit.

#[path = "common/wire.rs"]
mod wire;

use mbm::client::{Backoff, Client, Policy, Serial, Tcp, Transport, UnitRecord};
use mbm::error::Status;
use mbm::pdu::functions::FunctionSpec;
use wire::{End, Lent, Task};

fn read(unit: u8) -> Task {
    Task::new(unit, 0, &[], |state| {
        state.set(FunctionSpec::READ_HOLDING_REGISTERS, 0, 1)
    })
}

/// Polls at the times that `poll_delay` returns until the task has ended. Returns when
/// requests were sent, and the task.
fn send_times<L: Transport<Task>>(end: &End, client: &mut Client<L, Task, 4>) -> (Vec<u32>, Task) {
    let mut send_times = Vec::new();
    for _ in 0..10_000 {
        if let Some(task) = client.poll(end.now()) {
            return (send_times, task);
        }
        if !end.sent().is_empty() {
            send_times.push(end.now());
        }
        end.pass(client.poll_delay(end.now()).clamp(1, 5_000_000));
    }
    panic!("no task ended");
}

fn policy(backoff: Backoff, wait: u32, retries: u8) -> Policy {
    let mut policy = Policy::DEFAULT;
    policy.waits.set_backoff(backoff, wait, 1_000_000.max(wait));
    policy.retries = retries;
    policy
}

fn exponential() -> Policy {
    policy(Backoff::Exponential, 300_000, 4)
}

fn serial(lent: Lent) -> (End, Client<Serial<End, Lent, Task>, Task, 4>) {
    let end = End::default();
    (end.clone(), Client::new(Serial::new(end, lent)))
}

fn tcp(lent: Lent) -> (End, Client<Tcp<End, Lent>, Task, 4>) {
    let end = End::default();
    let mut client = Client::new(Tcp::new(end.clone(), lent));
    client.line.set_in_flight(4);
    (end, client)
}

/// The pauses between sent requests, less the response timeout of two seconds.
fn pauses(send_times: &[u32]) -> Vec<u32> {
    send_times
        .windows(2)
        .map(|pair| pair[1].wrapping_sub(pair[0]) - 2_000_000)
        .collect()
}

#[test]
fn each_retry_waits_for_the_backoff() {
    let (end, mut client) = tcp(Lent::default());
    *client.policy() = exponential();
    assert!(client.queue(read(1)).is_ok());
    let (send_times, task) = send_times(&end, &mut client);
    assert_eq!(task.state.status, Status::RESPONSE_TIMED_OUT);
    assert_eq!(
        pauses(&send_times),
        [300_000, 600_000, 1_000_000, 1_000_000]
    );
}

#[test]
fn each_retry_on_a_serial_line_waits_for_the_backoff() {
    let (end, mut client) = serial(Lent::default());
    *client.policy() = exponential();
    assert!(client.queue(read(1)).is_ok());
    let (send_times, task) = send_times(&end, &mut client);
    assert_eq!(task.state.status, Status::RESPONSE_TIMED_OUT);
    let expected = [300_000, 600_000, 1_000_000, 1_000_000];
    for (pause, expected) in pauses(&send_times).iter().zip(expected) {
        assert!(pause.abs_diff(expected) < 100, "{pause} {expected}");
    }
}

#[test]
fn jitter_shortens_the_backoff() {
    let lent = Lent {
        random: 1 << 31,
        ..Lent::default()
    };
    let (end, mut client) = tcp(lent);
    *client.policy() = policy(Backoff::Fixed, 300_000, 4);
    client.policy().waits.jitter = 128;
    assert!(client.queue(read(1)).is_ok());
    let (send_times, _) = send_times(&end, &mut client);
    assert_eq!(pauses(&send_times), [225_000; 4]);
}

#[test]
fn without_retries_a_request_is_sent_once() {
    let (end, mut client) = tcp(Lent::default());
    assert!(client.queue(read(1)).is_ok());
    let (send_times, task) = send_times(&end, &mut client);
    assert_eq!(
        (send_times.len(), task.state.status),
        (1, Status::RESPONSE_TIMED_OUT)
    );
    assert_eq!(end.now(), 2_000_000);
}

#[test]
fn other_requests_are_sent_while_one_waits_for_its_retry() {
    let (end, mut client) = serial(Lent::default());
    *client.policy() = policy(Backoff::Fixed, 10_000_000, 1);
    assert!(client.queue(read(1)).is_ok());
    assert!(client.queue(read(2)).is_ok());
    let mut order = Vec::new();
    for _ in 0..100_000 {
        let ended = client.poll(end.now());
        order.extend(end.sent().first().copied());
        if ended.is_some_and(|task| task.state.unit == 1) {
            break;
        }
        end.pass(client.poll_delay(end.now()).clamp(1, 1_000_000));
    }
    assert_eq!(order, [1, 2, 1]);
}

#[test]
fn the_delay_between_requests_to_one_unit_does_not_delay_other_units() {
    let units = vec![UnitRecord::new(1, 3_000_000)];
    let (end, mut client) = tcp(Lent {
        units,
        ..Lent::default()
    });
    client.line.set_in_flight(1);
    for unit in [1, 1, 2] {
        assert!(client.queue(read(unit)).is_ok());
    }
    let mut sent = Vec::new();
    while client.pending() > 0 {
        while client.poll(end.now()).is_some() {}
        if let Some(unit) = end.sent().get(6) {
            sent.push((*unit, end.now()));
        }
        end.pass(client.poll_delay(end.now()).clamp(1, 1_000_000));
    }
    // No unit replies, so each request ends after two seconds.
    assert_eq!(sent, [(1, 0), (2, 2_000_000), (1, 5_000_000)]);
}

#[test]
fn outcomes_of_requests_are_counted_for_each_unit() {
    let units = vec![UnitRecord::new(9, 0), UnitRecord::new(1, 0)];
    let (end, mut client) = tcp(Lent {
        units,
        ..Lent::default()
    });
    client.policy().retries = 2;
    assert!(client.queue(read(1)).is_ok());
    send_times(&end, &mut client);
    for pdu in [&[3, 2, 0, 7][..], &[0x83, 4]] {
        assert!(client.queue(read(1)).is_ok());
        assert!(client.poll(end.now()).is_none());
        let request = end.sent();
        let mut frame = vec![request[0], request[1], 0, 0, 0, pdu.len() as u8 + 1, 1];
        frame.extend(pdu);
        end.deliver(0, &frame);
        assert!(client.poll(end.now()).is_some());
    }
    let unit = client.line.storage.units[1];
    assert_eq!(
        (unit.requests, unit.replies, unit.exceptions, unit.retries),
        (3, 2, 1, 2)
    );
    assert_eq!(unit.status, 4);
    assert_eq!(client.line.storage.units[0].requests, 0);
}

#[test]
fn a_jump_of_the_clock_ends_a_wait_but_loses_no_reply() {
    let (end, mut client) = serial(Lent::default());
    assert!(client.queue(read(1)).is_ok());
    for _ in 0..100 {
        assert!(client.poll(end.now()).is_none());
        end.pass(100);
    }
    assert!(!end.sent().is_empty());
    end.deliver(0, &[1, 3, 2, 0, 7, 0xF9, 0x86]);
    // The clock jumps ahead by 15 minutes. The reply that has arrived is still taken.
    end.pass(900_000_000);
    let task = client.poll(end.now()).unwrap();
    assert_eq!(
        (task.state.status, task.received()),
        (Status::OK, &[0, 7][..])
    );
    // The clock jumps back by one minute. The wait ends, and does not last 71 minutes.
    assert!(client.queue(read(1)).is_ok());
    let queued = end.now();
    while end.sent().is_empty() {
        assert!(client.poll(end.now()).is_none());
        end.pass(100);
        assert!(end.now().wrapping_sub(queued) < 1_000_000);
    }
    assert!(client.poll(end.now()).is_none());
    end.pass(0u32.wrapping_sub(60_000_000));
    let task = client.poll(end.now()).unwrap();
    assert_eq!(task.state.status, Status::RESPONSE_TIMED_OUT);
}

#[test]
fn the_backoff_is_right_when_the_clock_wraps() {
    let (end, mut client) = tcp(Lent::default());
    end.pass(u32::MAX - 3_000_000);
    *client.policy() = exponential();
    assert!(client.queue(read(1)).is_ok());
    let (send_times, _) = send_times(&end, &mut client);
    assert_eq!(
        pauses(&send_times),
        [300_000, 600_000, 1_000_000, 1_000_000]
    );
}
