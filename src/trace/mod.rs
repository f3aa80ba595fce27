//! The trace: a port that passes everything on to another port, and hands out each frame that is
//! sent and received. A master, a client or a server uses it in place of its port.
//!
//! Sent frames are joined if the port accepts them in parts. Received bytes are cut into frames
//! by the length of their functions and the CRC, by the characters of ASCII, or by the header
//! of TCP. Bytes that form no valid frame are handed out once the line is silent, the next
//! frame is sent, the link is lost, or the buffer is full.

mod cutter;

pub use cutter::{Direction, Observer, Record};

use crate::error::Error;
use crate::frame::Framing;
use crate::packet::PduKind;
use crate::port::{result, Port};
use crate::time::Micros;
use cutter::{Cutter, Rules};

/// The smallest buffer, in bytes. Each direction uses a half of it.
pub const MIN_BUFFER: usize = 32;

/// Default time to wait for the rest of an RTU frame, in microseconds. A USB adapter may deliver
/// the bytes of one frame 16 ms apart, a UART with a FIFO 120 characters: 137 ms at 9600 baud.
const RTU_FRAME_TIMEOUT: u32 = 200_000;

/// Default time to wait for the rest of any other frame, in microseconds.
const FRAME_TIMEOUT: u32 = 1_000_000;

/// A port that hands out the frames that go through it.
///
/// ```
/// use mbm::client::BlockingClient;
/// use mbm::frame::{ascii, Framing};
/// use mbm::packet::PduKind;
/// use mbm::server::{SimulatedPort, Tables, Unit};
/// use mbm::trace::{Record, Trace};
///
/// let meter = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
/// let mut frames = vec![];
/// let observer = |record: &Record| frames.push(record.bytes.to_vec());
/// let buffer = [0; 520];
/// let (port, end) = (SimulatedPort::tcp(meter), ascii::END);
/// let mut trace = Trace::new(port, Framing::Tcp, PduKind::Request, end, buffer, observer);
/// trace.set_frame_timeout(200_000);
///
/// // The client has the trace in place of the port.
/// let mut client = BlockingClient::tcp(trace);
/// client.write_single_register(17, 107, 7)?;
/// client.port().hand_out_rest();
/// drop(client);
/// assert_eq!(frames[0][6..], [17, 6, 0, 107, 0, 7]);
/// assert_eq!(frames[0], frames[1]);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Debug)]
pub struct Trace<P, B, O> {
    /// The port to which everything is passed on.
    pub port: P,
    /// Takes the frames.
    pub observer: O,
    buffer: B,
    framing: Framing,
    end: u8,
    /// The kind of PDU that is sent.
    sends: PduKind,
    frame_timeout: Micros,
    sent: Cutter,
    received: Cutter,
}

impl<P, B, O> Trace<P, B, O> {
    /// A trace before `port`. The object that uses it sends PDUs of the kind `sends`: a master or
    /// client sends requests, a server responses. `end` is the end character of ASCII frames, most
    /// often [`END`](crate::frame::ascii::END). One half of the buffer holds an incomplete frame of each direction;
    /// longer frames are handed out in pieces.
    pub const fn new(
        port: P,
        framing: Framing,
        sends: PduKind,
        end: u8,
        buffer: B,
        observer: O,
    ) -> Self {
        let frame_timeout = match framing {
            Framing::Rtu => RTU_FRAME_TIMEOUT,
            _ => FRAME_TIMEOUT,
        };
        Trace {
            port,
            observer,
            buffer,
            framing,
            end,
            sends,
            frame_timeout,
            sent: Cutter::EMPTY,
            received: Cutter::EMPTY,
        }
    }

    /// Sets how long to wait for the rest of a frame, in microseconds.
    pub const fn set_frame_timeout(&mut self, frame_timeout: u32) {
        self.frame_timeout = frame_timeout;
    }

    fn rules(&self, direction: Direction) -> Rules {
        let received = match self.sends {
            PduKind::Request => PduKind::Response,
            PduKind::Response => PduKind::Request,
        };
        let is_sent = direction == Direction::Sent;
        Rules {
            framing: self.framing,
            end: self.end,
            direction,
            kind: if is_sent { self.sends } else { received },
            both: !is_sent && self.framing.is_serial(),
        }
    }
}

impl<P, B: AsMut<[u8]>, O: Observer> Trace<P, B, O> {
    /// Takes bytes of a direction; `None` ends the frame that was taken before.
    fn take(&mut self, direction: Direction, bytes: Option<&[u8]>, now: u32) {
        let rules = self.rules(direction);
        let buffer = self.buffer.as_mut();
        // Indexes in the buffer have 16 bits.
        let half = (buffer.len() / 2).min(u16::MAX.into());
        let (first, second) = buffer.split_at_mut_checked(half).unwrap_or_default();
        let (cutter, part) = match direction {
            Direction::Sent => (&mut self.sent, first),
            Direction::Received => (&mut self.received, second),
        };
        let part = part.get_mut(..half).unwrap_or_default();
        match bytes {
            Some(bytes) if half > 0 => cutter.push(part, &rules, bytes, now, &mut self.observer),
            _ => cutter.end(part, &rules, &mut self.observer),
        }
    }

    /// Hands out the bytes that are waiting for the rest of their frame.
    pub fn hand_out_rest(&mut self) {
        self.take(Direction::Sent, None, 0);
        self.take(Direction::Received, None, 0);
    }
}

impl<P: Port, B: AsMut<[u8]>, O: Observer> Port for Trace<P, B, O> {
    fn is_ready(&self) -> bool {
        self.port.is_ready()
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        result(self.read_count(bytes))
    }

    fn read_count(&mut self, bytes: &mut [u8]) -> i16 {
        let count = self.port.read_count(bytes);
        if count < 0 {
            self.hand_out_rest();
        }
        if count > 0 || !self.received.is_empty() {
            let now = self.port.micros();
            if self.received.is_silent(now, self.frame_timeout) {
                self.take(Direction::Received, None, now);
            }
            let received = bytes.get(..count.max(0) as usize).unwrap_or_default();
            self.take(Direction::Received, Some(received), now);
        }
        count
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        result(self.write_count(bytes))
    }

    fn write_count(&mut self, bytes: &[u8]) -> i16 {
        let now = self.port.micros();
        let count = self.port.write_count(bytes);
        if count < 0 {
            self.hand_out_rest();
            return count;
        }
        let accepted = bytes.get(..count as usize).unwrap_or_default();
        if accepted.is_empty() {
            return count;
        }
        if self.framing.is_serial() {
            self.take(Direction::Received, None, now);
        }
        self.take(Direction::Sent, Some(accepted), now);
        // All but a client on TCP write the whole rest of one frame.
        if accepted.len() == bytes.len() && self.framing != Framing::Tcp {
            self.take(Direction::Sent, None, now);
        }
        count
    }

    fn micros(&mut self) -> u32 {
        self.port.micros()
    }

    fn flush(&mut self) -> bool {
        self.port.flush()
    }

    fn pre_transmission(&mut self) {
        self.port.pre_transmission();
    }

    fn post_transmission(&mut self) {
        self.port.post_transmission();
        if self.framing != Framing::Tcp {
            self.take(Direction::Sent, None, 0);
        }
    }
}
