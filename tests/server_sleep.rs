//! A program that sleeps for the time that the server's poll delay gives. Only bytes that arrive
//! during the sleep end it earlier: bytes that arrived before do not.

mod common;

use common::device::Device;
use common::frame::{adu, sealed};
use common::line::Line;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::port::Port;
use mbm::server::{Indication, Reply, Server, Units};
use std::cell::Cell;
use std::rc::Rc;

const READ: [u8; 6] = [17, 3, 0, 100, 0, 1];
const ANSWER: [u8; 5] = [17, 3, 2, 0x10, 0];
const SLOW: u8 = 0x41;
const ALL: [Framing; 4] = [
    Framing::Rtu,
    Framing::Ascii,
    Framing::Tcp,
    Framing::RtuOverTcp,
];

/// Units whose function [`SLOW`] is pending until a time; a device serves the other functions.
struct SlowUnits<'a> {
    device: &'a mut Device,
    now: u32,
    ready_at: u32,
    reply: Reply,
}

impl Units for SlowUnits<'_> {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        if pdu.first() != Some(&SLOW) || info.length == 0 {
            return self.device.with_unit(|unit| [unit].serve(info, pdu));
        }
        if (self.now.wrapping_sub(self.ready_at) as i32) < 0 {
            return Reply::PENDING;
        }
        self.reply
    }
}

/// How the program lets the server work.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Polled {
    /// Up to several requests at a time, as on a host.
    AsOnHost,
    /// One request at a time, as firmware does.
    AsInFirmware,
}

struct Program {
    line: Line,
    polled: Polled,
    slow_until: u32,
    slow_reply: Reply,
}

impl Program {
    fn new(framing: Framing, polled: Polled) -> Self {
        let line = Line::new(framing);
        let slow_until = line.wire.borrow().now;
        Program {
            line,
            polled,
            slow_until,
            slow_reply: Reply::length(1),
        }
    }

    fn poll(&mut self) {
        let now = self.line.wire.borrow().now;
        let server = &mut self.line.server;
        let mut units = SlowUnits {
            device: &mut self.line.device,
            now,
            ready_at: self.slow_until,
            reply: self.slow_reply,
        };
        if self.polled == Polled::AsOnHost {
            assert_eq!(server.serve(now, &mut units), Ok(()));
            return;
        }
        if server.look(now) == Status::PENDING {
            let info = server.request;
            let reply = units.serve(&info, server.pdu());
            if !server.answer(reply) {
                return;
            }
        }
        assert_eq!(server.go_on(), Status::OK);
    }

    /// Polls and sleeps until the server would sleep for ever. Returns the frames that it sent.
    fn run(&mut self) -> Vec<Vec<u8>> {
        for _ in 0..20_000 {
            self.poll();
            let wire = &mut *self.line.wire.borrow_mut();
            let now = wire.now;
            let delay = self.line.server.poll_delay(now);
            // The times from now on at which bytes arrive.
            let arrivals = wire.arriving.iter().map(|byte| byte.0.wrapping_sub(now));
            let next = arrivals.filter(|after| (1..1 << 31).contains(after)).min();
            let sleep = next.map_or(delay, |next| next.min(delay));
            if sleep == u32::MAX {
                let sent = std::mem::take(&mut wire.sent);
                return sent.into_iter().map(|sent| sent.1).collect();
            }
            wire.now = now.wrapping_add(sleep.max(10));
        }
        panic!("the program never sleeps");
    }
}

#[test]
fn a_request_that_arrives_while_a_function_is_pending_is_answered_after_the_reply() {
    for framing in ALL {
        for polled in [Polled::AsOnHost, Polled::AsInFirmware] {
            for reply in [Reply::length(1), Reply::NO_RESPONSE] {
                let mut program = Program::new(framing, polled);
                program.slow_until = program.slow_until.wrapping_add(300_000);
                program.slow_reply = reply;
                program.line.arrive(0, &adu(framing, &[17, SLOW]));
                program.line.arrive(100_000, &adu(framing, &READ));
                let mut expected = vec![adu(framing, &ANSWER)];
                if reply != Reply::NO_RESPONSE {
                    expected.insert(0, adu(framing, &[17, SLOW]));
                }
                let case = format!("{framing:?}, {polled:?}, {reply:?}");
                assert_eq!(program.run(), expected, "{case}");
                // The port has been read since, so the server sleeps until bytes arrive.
                program.line.arrive(10_000, &adu(framing, &READ));
                assert_eq!(program.run(), [adu(framing, &ANSWER)], "{case}");
            }
        }
    }
}

#[test]
fn a_request_that_arrives_while_a_response_is_sent_is_answered() {
    for framing in ALL {
        for polled in [Polled::AsOnHost, Polled::AsInFirmware] {
            let mut program = Program::new(framing, polled);
            program.line.wire.borrow_mut().piece = 1;
            program.line.arrive(0, &adu(framing, &READ));
            while program.line.wire.borrow().sent.is_empty() {
                program.poll();
                let wire = &mut *program.line.wire.borrow_mut();
                wire.now = wire.now.wrapping_add(50);
            }
            let now = program.line.wire.borrow().now;
            program.line.arrive(0, &adu(framing, &READ));
            // All of it arrives at once.
            for byte in &mut program.line.wire.borrow_mut().arriving {
                byte.0 = now;
            }
            let expected = vec![adu(framing, &ANSWER); 2];
            assert_eq!(program.run(), expected, "{framing:?}, {polled:?}");
        }
    }
}

#[test]
fn a_missing_echo_does_not_hide_a_request_from_a_program_that_sleeps() {
    for polled in [Polled::AsOnHost, Polled::AsInFirmware] {
        let mut program = Program::new(Framing::Rtu, polled);
        assert!(program.line.server.set_echo_discard(true));
        for _ in 0..3 {
            program.line.arrive(10_000, &sealed(&READ));
            assert_eq!(program.run(), [sealed(&ANSWER)], "{polled:?}");
        }
    }
}

#[test]
fn a_program_that_slept_for_an_hour_carries_the_same_write_out_again() {
    let write = [17, 6, 0, 100, 1, 2];
    for framing in [Framing::Rtu, Framing::Ascii] {
        let mut program = Program::new(framing, Polled::AsInFirmware);
        for round in 0..3 {
            program.line.arrive(0, &adu(framing, &write));
            // The bytes wake the program.
            let wire = program.line.wire.clone();
            let now = wire.borrow().arriving.back().unwrap().0;
            wire.borrow_mut().now = now;
            let expected = [adu(framing, &write)];
            assert_eq!(program.run(), expected, "{framing:?}, {round}");
            let now = wire.borrow().now;
            wire.borrow_mut().now = now.wrapping_add(3_000_000_000);
        }
    }
}

/// A port that takes a response at once, or at most `piece` bytes, and has sent it when each
/// character has taken its time.
struct Leaving {
    now: Rc<Cell<u32>>,
    request: Vec<u8>,
    character: u32,
    piece: usize,
    sent: usize,
    /// When the last bit leaves, and when the driver has gone off.
    end: Rc<Cell<u32>>,
    off: Rc<Cell<u32>>,
}

impl Port for Leaving {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = bytes.len().min(self.request.len());
        bytes[..count].copy_from_slice(&self.request[..count]);
        self.request.drain(..count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let count = bytes.len().min(self.piece);
        let begin = self.end.get().max(self.now.get());
        self.end.set(begin + count as u32 * self.character);
        self.sent += count;
        Ok(count)
    }

    fn micros(&mut self) -> u32 {
        self.now.get()
    }

    fn flush(&mut self) -> bool {
        self.sent > 0 && self.now.get() >= self.end.get()
    }

    fn post_transmission(&mut self) {
        self.off.set(self.now.get());
    }
}

/// Answers with a PDU of this length.
struct Long(usize);

impl Units for Long {
    fn serve(&mut self, _: &Indication, _: &mut [u8]) -> Reply {
        Reply::length(self.0)
    }
}

#[test]
fn a_program_sleeps_while_a_response_leaves() {
    const POLL: u32 = 20;
    // The rate that the program gives, 0 for none, is for characters of 11 bits.
    for (baud, character, piece) in [
        (9_600, 1_146, 256),
        (9_600, 1_042, 256), // 8N1: ten bits
        (9_600, 1_021, 256), // and 2 % too fast
        (19_200, 573, 256),
        (115_200, 85, 256),
        (9_600, 1_042, 200),
        (0, 85, 256),
        (0, 1_146, 256),
    ] {
        for length in [1, 2, 5, 20, 100, 253] {
            let time = || Rc::new(Cell::new(0));
            let (now, end, off) = (time(), time(), time());
            let port = Leaving {
                now: now.clone(),
                request: sealed(&[17, SLOW]),
                character,
                piece,
                sent: 0,
                end: end.clone(),
                off: off.clone(),
            };
            let mut server = Server::with_framing(Framing::Rtu, port, [0; 256]);
            server.set_baud_rate(baud);
            let mut polls = 0;
            while off.get() == 0 {
                polls += 1;
                assert_eq!(server.serve(now.get(), &mut Long(length)), Ok(()));
                let delay = server.poll_delay(now.get());
                assert_ne!(delay, u32::MAX);
                now.set(now.get() + delay.max(POLL));
            }
            let case = format!("{baud} baud, {character} us, {piece}, {length}");
            // The driver goes off as soon as the last bit has left.
            assert!((end.get()..end.get() + POLL).contains(&off.get()), "{case}");
            if baud > 0 && piece == 256 {
                // At most an eighth of the time, two characters and the silence before the
                // response are spent in polls.
                let frame = length as u32 + 3;
                let spent = (frame / 8 + 2) * character + mbm::time::silence(baud);
                assert!(polls < spent / POLL + 20, "{polls}: {case}");
            }
        }
    }
}

#[test]
fn bytes_that_arrived_before_the_begin_are_received() {
    for framing in ALL {
        let mut program = Program::new(framing, Polled::AsOnHost);
        program.line.arrive(0, &adu(framing, &READ));
        let now = program.line.wire.borrow().arriving.back().unwrap().0;
        program.line.wire.borrow_mut().now = now;
        assert_eq!(program.line.server.poll_delay(now), 0, "{framing:?}");
        assert_eq!(program.run(), [adu(framing, &ANSWER)], "{framing:?}");
    }
}

#[test]
fn a_program_whose_requests_are_answered_at_once_polls_once_for_each() {
    let mut line = Line::new(Framing::Tcp);
    line.arrive(0, &adu(Framing::Tcp, &READ));
    let now = line.wire.borrow().arriving.back().unwrap().0;
    line.wire.borrow_mut().now = now;
    let _ = line.poll();
    assert_eq!(line.wire.borrow().sent.len(), 1);
    assert_eq!(line.server.poll_delay(now), u32::MAX);
}
