//! The client where the port takes no bytes, or brings some that nobody waits for.

#[allow(dead_code)]
#[path = "common/wire.rs"]
mod wire;

use mbm::client::{Backoff, Client, Line, Serial, Tcp};
use mbm::error::Status;
use mbm::pdu::outline::Form;
use wire::{End, Lent, Task};

type TcpIp = Client<Tcp<End, Lent>, Task, 16>;
type Rtu = Client<Serial<End, Lent, Task>, Task, 16>;

const TIMEOUT: u32 = 2_000_000;
/// Bytes of a request.
const REQUEST: usize = 12;

fn client() -> (End, TcpIp) {
    let end = End::default();
    (end.clone(), Client::new(Tcp::new(end, Lent::default())))
}

fn read(transaction: u16) -> Task {
    Task::new(1, transaction, &[], |outline| {
        outline.set(Form::READ_HOLDING_REGISTERS, transaction, 1)
    })
}

/// Polls once as C does, and gives back who ended and how.
fn poll<L: Line<Task>>(end: &End, client: &mut Client<L, Task, 16>) -> Vec<(u16, Status)> {
    let mut ended = Vec::new();
    while let Some(task) = client.poll(end.now(), ended.is_empty()) {
        ended.push((task.ticket.transaction, task.ticket.status));
    }
    ended
}

/// The addresses that were asked for since the last call.
fn asked(end: &End) -> Vec<u16> {
    let sent = end.sent();
    assert_eq!(sent.len() % REQUEST, 0);
    let address = |frame: &[u8]| u16::from_be_bytes([frame[8], frame[9]]);
    sent.chunks(REQUEST).map(address).collect()
}

fn stick(end: &End, stuck: bool) {
    end.0.borrow_mut().stuck = stuck;
}

#[test]
fn those_that_wait_for_room_end_too_where_the_port_takes_nothing() {
    let (end, mut client) = client();
    client.line.means.outgoing = vec![0; REQUEST];
    stick(&end, true);
    for number in 1..=3 {
        assert!(client.queue(read(number)).is_ok());
    }
    let mut ended = Vec::new();
    for _ in 0..10 {
        ended.extend(poll(&end, &mut client));
        end.pass(TIMEOUT / 2);
    }
    let busy = |number| (number, Status::LINE_BUSY);
    assert_eq!(ended, [busy(1), busy(2), busy(3)]);
}

#[test]
fn those_behind_half_a_request_end_too_where_the_port_takes_no_more() {
    let (end, mut client) = client();
    client.line.means.outgoing = vec![0; REQUEST];
    end.0.borrow_mut().piece = Some(5);
    for number in 1..=3 {
        assert!(client.queue(read(number)).is_ok());
    }
    poll(&end, &mut client);
    stick(&end, true);
    let mut ended = Vec::new();
    for _ in 0..10 {
        ended.extend(poll(&end, &mut client));
        end.pass(TIMEOUT / 2);
    }
    let busy = |number| (number, Status::LINE_BUSY);
    assert_eq!(ended, [busy(1), busy(2), busy(3)]);
    // The rest of the half is sent, so that the next is found behind it.
    stick(&end, false);
    assert!(client.queue(read(4)).is_ok());
    for _ in 0..10 {
        assert!(poll(&end, &mut client).is_empty());
    }
    assert_eq!(asked(&end), [1, 4]);
}

#[test]
fn those_that_wait_for_room_go_as_soon_as_there_is_some() {
    let (end, mut client) = client();
    client.line.means.outgoing = vec![0; REQUEST];
    end.0.borrow_mut().piece = Some(5);
    for number in 1..=2 {
        assert!(client.queue(read(number)).is_ok());
    }
    for _ in 0..10 {
        assert!(poll(&end, &mut client).is_empty());
    }
    assert_eq!(asked(&end), [1, 2]);
}

#[test]
fn what_timed_out_unsent_is_not_sent_later() {
    let (end, mut client) = client();
    client.policy().retries = 2;
    stick(&end, true);
    assert!(client.queue(read(1)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    end.pass(TIMEOUT / 2);
    assert!(client.queue(read(2)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    end.pass(TIMEOUT / 2);
    // The first is asked again, behind the second.
    assert!(poll(&end, &mut client).is_empty());
    stick(&end, false);
    assert!(poll(&end, &mut client).is_empty());
    assert_eq!(asked(&end), [2, 1]);
}

#[test]
fn what_was_cancelled_unsent_is_not_sent_later() {
    let (end, mut client) = client();
    stick(&end, true);
    for number in 1..=3 {
        assert!(client.queue(read(number)).is_ok());
    }
    poll(&end, &mut client);
    let second = client.cancel(|task| task.ticket.transaction == 2);
    assert_eq!(second.unwrap().ticket.status, Status::CANCELLED);
    stick(&end, false);
    poll(&end, &mut client);
    assert_eq!(asked(&end), [1, 3]);
}

#[test]
fn what_was_sent_times_out_though_others_are_not() {
    let (end, mut client) = client();
    assert!(client.queue(read(1)).is_ok());
    poll(&end, &mut client);
    stick(&end, true);
    assert!(client.queue(read(2)).is_ok());
    poll(&end, &mut client);
    end.pass(TIMEOUT);
    let ended = poll(&end, &mut client);
    assert_eq!(
        ended,
        [(1, Status::RESPONSE_TIMED_OUT), (2, Status::LINE_BUSY)]
    );
}

#[test]
fn a_full_port_is_looked_at_each_millisecond() {
    let (end, mut client) = client();
    stick(&end, true);
    assert!(client.queue(read(1)).is_ok());
    assert_eq!(client.poll_delay(end.now()), 0);
    poll(&end, &mut client);
    assert_eq!(client.poll_delay(end.now()), 1000);
    stick(&end, false);
    poll(&end, &mut client);
    assert_eq!(client.poll_delay(end.now()), TIMEOUT);
}

/// A late response is taken while its request waits to be asked again, for a
/// program that sleeps until bytes are there would not sleep.
fn late_bytes_are_taken<L: Line<Task>>(end: &End, client: &mut Client<L, Task, 16>) {
    client.policy().retries = 1;
    client
        .policy()
        .set_backoff(Backoff::Fixed, TIMEOUT, TIMEOUT);
    assert!(client.queue(read(1)).is_ok());
    for _ in 0..5 {
        assert!(poll(end, client).is_empty());
        end.pass(10_000);
    }
    end.sent();
    end.pass(TIMEOUT);
    assert!(poll(end, client).is_empty());
    end.deliver(0, &[0; 20]);
    assert!(poll(end, client).is_empty());
    assert!(end.0.borrow().incoming.is_empty());
    assert!(end.sent().is_empty());
    // What is lost meanwhile is told at once.
    end.0.borrow_mut().dead = true;
    let mut ended = poll(end, client);
    ended.extend(poll(end, client));
    assert_eq!(ended, [(1, Status::LINK_LOST)]);
}

#[test]
fn late_bytes_are_taken_while_a_request_waits_to_be_asked_again() {
    let (end, mut client) = client();
    late_bytes_are_taken(&end, &mut client);
    let end = End::default();
    let mut client: Rtu = Client::new(Serial::new(end.clone(), Lent::default()));
    late_bytes_are_taken(&end, &mut client);
}
