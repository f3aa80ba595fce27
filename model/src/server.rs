//! A real server on a line, and everything that may arrive there in any order: whole requests,
//! requests that are cut off, the two halves of a request as a UART hands them over, the echo of
//! its responses, and the responses of another server with its id. One request leads to at most
//! one response, and to nothing else, ever.

use crate::wire::Wire;
use mbm::frame::Framing;
use mbm::server::{Indication, Reply, Server, Units};
use std::time::{Duration, Instant};

const UNIT: u8 = 17;

/// Longer than t3.5 at an unknown baud rate, in microseconds.
const SILENCE: u32 = 5_000;
/// The longest time for which a UART or an adapter holds bytes back here.
const HELD_BACK: u32 = 30_000;
/// After this no byte of a frame is expected any more.
const LONG: u32 = 1_000_000;

/// What the server receives besides the requests of a client.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Hearing {
    /// Nothing.
    Others,
    /// Its own responses, at the latest [`HELD_BACK`] after it has sent them.
    Itself,
    /// The responses of another server with its id that do not have the form of a request.
    Twin,
}

/// What the program does next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Event {
    /// A request arrives. Its number is an index in [`REQUESTS`].
    Request(usize),
    /// The first bytes of a request arrive, and no others.
    Cut(usize),
    /// A request arrives in two blocks, with a pause between them.
    Blocks(usize),
    /// The response of the other server to such a request.
    Response(usize),
    /// What is left of the echo arrives, or half of it.
    Echo,
    HalfEcho,
    /// Time passes, in microseconds.
    Step(u32),
}

/// Requests, and the responses to them. The second has the bytes of its request.
const REQUESTS: [(&[u8], &[u8]); 4] = [
    (&[3, 0, 0, 0, 1], &[3, 2, 0, 9]),
    (&[6, 0, 0, 0, 9], &[6, 0, 0, 0, 9]),
    (&[0x10, 0, 0, 0, 2, 4, 1, 2, 3, 4], &[0x10, 0, 0, 0, 2]),
    (&[2, 0, 0, 0, 1], &[0x82, 1]),
];

fn frame(pdu: &[u8]) -> Vec<u8> {
    crate::frame::framed(Framing::Rtu, 0, UNIT, pdu)
}

/// Answers as [`REQUESTS`] says; anything else with exception 03.
#[derive(Clone, Debug)]
struct Unit;

impl Units for Unit {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        let code = pdu[0];
        if info.addressing(code) != mbm::server::Addressing::OWN || info.to != UNIT {
            return Reply::NO_RESPONSE;
        }
        let request = &pdu[..info.length.into()];
        let Some((_, response)) = REQUESTS.iter().find(|(known, _)| *known == request) else {
            return Reply::ILLEGAL_DATA_VALUE;
        };
        if response[0] & 0x80 != 0 {
            return Reply::ILLEGAL_FUNCTION;
        }
        pdu[..response.len()].copy_from_slice(response);
        Reply::length(response.len())
    }

    fn has(&self, unit: u8) -> bool {
        unit == UNIT || unit == 0
    }
}

/// A line after some events.
#[derive(Clone, Debug)]
struct State {
    server: Server<Wire, [u8; 256]>,
    hearing: Hearing,
    /// The echo that has not arrived yet, and how long it has been held back.
    echo: Vec<u8>,
    held: u32,
    /// Requests that have arrived, and frames that the server has sent.
    requests: u32,
    sent: u32,
    /// A whole request has arrived since the last silence, and nothing else.
    alone: bool,
    /// How many frames the server must have sent after the next silence; 0 if that is open.
    due: u32,
    /// The last request has other bytes than the response before it.
    is_other: bool,
    /// Since the last response, bytes have arrived that may be a damaged echo of it.
    may_be_damaged: bool,
    /// A request has arrived since the last response that the server may take for its echo.
    may_be_echoed: bool,
    /// The server cannot know yet that the line has no echo.
    may_be_echo: bool,
    last_response: Vec<u8>,
    since_response: u32,
}

impl State {
    fn new(hearing: Hearing) -> Self {
        State {
            server: Server::with_framing(Framing::Rtu, Wire::default(), [0; 256]),
            hearing,
            echo: Vec::new(),
            held: 0,
            requests: 0,
            sent: 0,
            alone: true,
            due: 0,
            is_other: false,
            may_be_damaged: false,
            may_be_echoed: false,
            may_be_echo: true,
            last_response: Vec::new(),
            since_response: LONG,
        }
    }

    fn events(&self) -> Vec<Event> {
        let mut events = vec![Event::Step(1_000), Event::Step(SILENCE)];
        if !self.echo.is_empty() {
            // The bytes of the wire arrive in their order.
            events.extend([Event::Echo, Event::HalfEcho]);
            if self.held + 2 * SILENCE > HELD_BACK {
                events.truncate(0);
                events.push(Event::Echo);
            }
            return events;
        }
        events.push(Event::Step(LONG));
        for number in 0..REQUESTS.len() {
            events.push(Event::Request(number));
            if self.hearing == Hearing::Twin && number != 1 {
                events.push(Event::Response(number));
            }
        }
        events.extend([
            Event::Blocks(1),
            Event::Blocks(2),
            Event::Cut(0),
            Event::Cut(2),
        ]);
        events
    }

    fn poll(&mut self) {
        let now = self.server.port.now;
        assert_eq!(self.server.serve(now, &mut Unit), Ok(()));
        let sent = std::mem::take(&mut self.server.port.sent);
        if !sent.is_empty() {
            self.sent += 1;
            self.since_response = 0;
            self.may_be_echoed = false;
            if self.hearing == Hearing::Itself {
                self.echo.extend(&sent);
                self.held = 0;
            }
            self.last_response = sent;
        }
    }

    fn pass(&mut self, time: u32) {
        self.server.port.now = self.server.port.now.wrapping_add(time);
        self.held += time;
        self.since_response = self.since_response.saturating_add(time);
        // One poll finds a request, and one the end of the bytes that were read before.
        self.poll();
        self.poll();
    }

    fn arrive(&mut self, bytes: &[u8]) {
        self.server.port.arrived.extend(bytes);
        while !self.server.port.arrived.is_empty() {
            self.poll();
        }
    }

    fn silence(&mut self) {
        self.pass(SILENCE);
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Request(number) | Event::Blocks(number) => {
                let bytes = frame(REQUESTS[number].0);
                let is_same = bytes == self.last_response && self.since_response < 2 * LONG / 10;
                // Other bytes may be in front, and be lost with it or not.
                let is_due = self.alone && !(is_same && self.may_be_echo);
                self.is_other =
                    !is_same && self.sent > 0 && !self.may_be_damaged && !self.may_be_echoed;
                self.may_be_echoed |= is_same;
                self.may_be_damaged = false;
                self.requests += 1;
                if matches!(event, Event::Blocks(_)) {
                    let (first, second) = bytes.split_at(bytes.len() / 2);
                    self.arrive(first);
                    self.silence();
                    self.arrive(second);
                } else {
                    self.arrive(&bytes);
                }
                self.due = if is_due { self.sent + 1 } else { 0 };
                self.alone = false;
            }
            Event::Cut(number) => {
                let bytes = frame(REQUESTS[number].0);
                self.arrive(&bytes[..5]);
                self.may_be_damaged = true;
                self.due = 0;
                self.alone = false;
            }
            Event::Response(number) => {
                self.arrive(&frame(REQUESTS[number].1));
                self.due = 0;
                self.alone = false;
            }
            Event::Echo | Event::HalfEcho => {
                let count = if event == Event::Echo {
                    self.echo.len()
                } else {
                    self.echo.len().div_ceil(2)
                };
                let bytes: Vec<u8> = self.echo.drain(..count).collect();
                self.arrive(&bytes);
                self.alone = false;
                self.due = 0;
            }
            Event::Step(time) => {
                self.pass(time);
                if time >= SILENCE {
                    // A client waits for this long before it sends again.
                    self.alone = true;
                    // Another frame than the echo has followed a response.
                    if self.due > 0 && self.due <= self.sent && self.is_other {
                        self.may_be_echo = false;
                    }
                }
            }
        }
    }

    /// What does not hold, if anything.
    fn wrong(&self, last: Event) -> Option<&'static str> {
        if self.sent > self.requests {
            return Some("more responses than requests");
        }
        let is_silent = matches!(last, Event::Step(time) if time >= SILENCE);
        if is_silent && self.due != 0 && self.due > self.sent {
            return Some("a request without a response");
        }
        None
    }
}

/// Tries all orders of up to `left` more events. Returns how many there are, or the one that breaks a
/// property.
fn try_all(
    state: &State,
    left: usize,
    deadline: Instant,
    path: &mut Vec<Event>,
) -> Result<u64, String> {
    if left == 0 || Instant::now() > deadline {
        return Ok(1);
    }
    let mut orders = 0;
    for event in state.events() {
        let mut next = state.clone();
        next.happen(event);
        path.push(event);
        if let Some(wrong) = next.wrong(event) {
            return Err(format!("{wrong}: {path:?}"));
        }
        orders += try_all(&next, left - 1, deadline, path)?;
        path.pop();
    }
    Ok(orders)
}

/// Tries all orders of one event, of two and so on, until the time is over. False if one breaks a
/// property.
pub fn try_orders(hearing: Hearing, time: Duration) -> bool {
    let deadline = Instant::now() + time;
    let (mut events, mut orders) = (0, 0);
    loop {
        match try_all(&State::new(hearing), events + 1, deadline, &mut Vec::new()) {
            Ok(_) if Instant::now() > deadline => break,
            Ok(tried) => (events, orders) = (events + 1, tried),
            Err(wrong) => {
                println!("model: broken: a server that receives {hearing:?}: {wrong}");
                return false;
            }
        }
    }
    println!(
        "model: a server that receives {hearing:?}: every order of {events} events, {orders} orders"
    );
    events > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A program that denies an echo which there is gets a flood.
    #[test]
    fn the_model_finds_an_answered_echo() {
        let mut state = State::new(Hearing::Itself);
        state.happen(Event::Request(1));
        state.happen(Event::Step(SILENCE));
        assert_eq!((state.requests, state.sent), (1, 1));
        // Its program says that there is no echo, though there is one.
        state.server.set_echo_discard(false);
        state.happen(Event::Request(1));
        state.happen(Event::Step(SILENCE));
        let mut last = Event::Echo;
        for event in [Event::Echo, Event::Step(SILENCE)].repeat(4) {
            state.happen(event);
            last = event;
        }
        assert_eq!(state.wrong(last), Some("more responses than requests"));
    }
}
