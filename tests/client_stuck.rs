//! The client on a port that accepts no bytes, and on one that delivers bytes while no
//! request waits for a reply.

#[allow(dead_code)]
#[path = "common/stream.rs"]
mod stream;

use mbm::client::{Backoff, Client, Serial, Transport};
use mbm::error::Status;
use stream::client;
use stream::wire::{End, Lent, Task};

type Rtu = Client<Serial<End, Lent, Task>, Task, 16>;

const TIMEOUT: u32 = 2_000_000;
/// The length of a request in bytes.
const REQUEST: usize = 12;

fn read(transaction: u16) -> Task {
    stream::read(1, transaction)
}

/// Polls once as C does. Returns the number and the status of each request that ended.
fn poll<L: Transport<Task>>(end: &End, client: &mut Client<L, Task, 16>) -> Vec<(u16, Status)> {
    let mut ended = Vec::new();
    while let Some(task) = client.poll(end.now()) {
        ended.push((task.state.transaction, task.state.status));
    }
    ended
}

/// The addresses in the requests that were sent since the last call.
fn requested(end: &End) -> Vec<u16> {
    let sent = end.sent();
    assert_eq!(sent.len() % REQUEST, 0);
    let address = |frame: &[u8]| u16::from_be_bytes([frame[8], frame[9]]);
    sent.chunks(REQUEST).map(address).collect()
}

fn set_stuck(end: &End, stuck: bool) {
    end.0.borrow_mut().stuck = stuck;
}

#[test]
fn requests_end_if_the_port_never_accepts_a_byte() {
    let (end, mut client) = client();
    client.line.storage.outgoing = vec![0; REQUEST];
    set_stuck(&end, true);
    for number in 1..=3 {
        assert!(client.queue(read(number)).is_ok());
    }
    let mut ended = Vec::new();
    for _ in 0..10 {
        ended.extend(poll(&end, &mut client));
        end.pass(TIMEOUT / 2);
    }
    let failed = |number| (number, Status::CONNECT_TIMED_OUT);
    assert_eq!(ended, [failed(1), failed(2), failed(3)]);
}

#[test]
fn requests_after_a_half_sent_one_end_if_the_port_accepts_no_more() {
    let (end, mut client) = client();
    client.line.storage.outgoing = vec![0; REQUEST];
    end.0.borrow_mut().piece = Some(5);
    for number in 1..=3 {
        assert!(client.queue(read(number)).is_ok());
    }
    poll(&end, &mut client);
    set_stuck(&end, true);
    let mut ended = Vec::new();
    for _ in 0..10 {
        ended.extend(poll(&end, &mut client));
        end.pass(TIMEOUT / 2);
    }
    let busy = |number| (number, Status::LINE_BUSY);
    assert_eq!(ended, [busy(1), busy(2), busy(3)]);
    // The rest of the half-sent request goes first. The server needs it to find the next one.
    set_stuck(&end, false);
    assert!(client.queue(read(4)).is_ok());
    for _ in 0..10 {
        assert!(poll(&end, &mut client).is_empty());
    }
    assert_eq!(requested(&end), [1, 4]);
}

#[test]
fn a_request_that_waits_for_buffer_space_is_sent_as_soon_as_there_is_some() {
    let (end, mut client) = client();
    client.line.storage.outgoing = vec![0; REQUEST];
    end.0.borrow_mut().piece = Some(5);
    for number in 1..=2 {
        assert!(client.queue(read(number)).is_ok());
    }
    for _ in 0..10 {
        assert!(poll(&end, &mut client).is_empty());
    }
    assert_eq!(requested(&end), [1, 2]);
}

#[test]
fn an_attempt_that_timed_out_unsent_is_not_sent_later() {
    let (end, mut client) = client();
    client.policy().retries = 2;
    set_stuck(&end, true);
    assert!(client.queue(read(1)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    end.pass(TIMEOUT / 2);
    assert!(client.queue(read(2)).is_ok());
    assert!(poll(&end, &mut client).is_empty());
    end.pass(TIMEOUT / 2);
    // The retry of the first request comes after the second request.
    assert!(poll(&end, &mut client).is_empty());
    set_stuck(&end, false);
    assert!(poll(&end, &mut client).is_empty());
    assert_eq!(requested(&end), [2, 1]);
}

#[test]
fn a_request_cancelled_before_it_is_sent_is_not_sent_later() {
    let (end, mut client) = client();
    set_stuck(&end, true);
    for number in 1..=3 {
        assert!(client.queue(read(number)).is_ok());
    }
    poll(&end, &mut client);
    let second = client.cancel(|task| task.state.transaction == 2);
    assert_eq!(second.unwrap().state.status, Status::CANCELLED);
    set_stuck(&end, false);
    poll(&end, &mut client);
    assert_eq!(requested(&end), [1, 3]);
}

#[test]
fn a_sent_request_times_out_while_another_cannot_be_sent() {
    let (end, mut client) = client();
    assert!(client.queue(read(1)).is_ok());
    poll(&end, &mut client);
    set_stuck(&end, true);
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
fn a_port_that_accepts_nothing_is_tried_every_millisecond() {
    let (end, mut client) = client();
    set_stuck(&end, true);
    assert!(client.queue(read(1)).is_ok());
    assert_eq!(client.poll_delay(end.now()), 0);
    poll(&end, &mut client);
    assert_eq!(client.poll_delay(end.now()), 1000);
    set_stuck(&end, false);
    poll(&end, &mut client);
    assert_eq!(client.poll_delay(end.now()), TIMEOUT);
}

/// The client reads a late response while its request waits for the retry. If it left the
/// bytes unread, a program that sleeps until bytes arrive would never sleep.
fn late_bytes_are_read<L: Transport<Task>>(end: &End, client: &mut Client<L, Task, 16>) {
    client.policy().retries = 1;
    client
        .policy()
        .waits
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
    // A link lost during the wait is reported at once.
    end.0.borrow_mut().dead = true;
    let mut ended = poll(end, client);
    ended.extend(poll(end, client));
    assert_eq!(ended, [(1, Status::LINK_LOST)]);
}

#[test]
fn late_bytes_are_read_while_a_request_waits_for_its_retry() {
    let (end, mut client) = client();
    late_bytes_are_read(&end, &mut client);
    let end = End::default();
    let mut client: Rtu = Client::new(Serial::new(end.clone(), Lent::default()));
    late_bytes_are_read(&end, &mut client);
}
