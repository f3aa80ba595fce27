//! Two ends of a simulated wire with a clock of its own, and a job that owns its
//! data.

use mbm::client::{Job, Means, Ticket, Unit};
use mbm::error::Status;
use mbm::pdu::outline::Outline;
use mbm::port::Port;
use mbm::transaction::{Counter, Storage, COUNTERS};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// What both ends see of the wire.
#[derive(Default)]
pub struct Wire {
    pub now: u32,
    /// What the client sent, piece by piece.
    pub sent: Vec<Vec<u8>>,
    /// What arrives at the client, and when.
    pub incoming: VecDeque<(u32, Vec<u8>)>,
    pub dead: bool,
    /// Write takes nothing.
    pub stuck: bool,
    /// Write and read take so many bytes at most.
    pub piece: Option<usize>,
}

/// The client's end.
#[derive(Clone, Default)]
pub struct End(pub Rc<RefCell<Wire>>);

impl End {
    /// Lets bytes arrive `delay` from now.
    pub fn deliver(&self, delay: u32, bytes: &[u8]) {
        let mut wire = self.0.borrow_mut();
        let at = wire.now.wrapping_add(delay);
        wire.incoming.push_back((at, bytes.to_vec()));
    }

    pub fn now(&self) -> u32 {
        self.0.borrow().now
    }

    pub fn pass(&self, time: u32) {
        let mut wire = self.0.borrow_mut();
        wire.now = wire.now.wrapping_add(time);
    }

    /// What was sent since the last call.
    pub fn sent(&self) -> Vec<u8> {
        self.0.borrow_mut().sent.drain(..).flatten().collect()
    }
}

impl Port for End {
    fn read(&mut self, bytes: &mut [u8]) -> i16 {
        let mut wire = self.0.borrow_mut();
        if wire.dead {
            return -1;
        }
        let now = wire.now;
        let Some((at, first)) = wire.incoming.front_mut() else {
            return 0;
        };
        if now.wrapping_sub(*at) as i32 <= -1 {
            return 0;
        }
        let count = first.len().min(bytes.len());
        bytes[..count].copy_from_slice(&first[..count]);
        first.drain(..count);
        if first.is_empty() {
            wire.incoming.pop_front();
        }
        count as i16
    }

    fn write(&mut self, bytes: &[u8]) -> i16 {
        let mut wire = self.0.borrow_mut();
        if wire.dead {
            return -1;
        }
        if wire.stuck {
            return 0;
        }
        let count = bytes.len().min(wire.piece.unwrap_or(usize::MAX));
        wire.sent.push(bytes[..count].to_vec());
        count as i16
    }

    fn micros(&mut self) -> u32 {
        self.now()
    }
}

/// Buffers of full size, counters and records of units.
pub struct Lent {
    pub frame: Vec<u8>,
    pub outgoing: Vec<u8>,
    pub counters: Rc<RefCell<[u32; COUNTERS]>>,
    pub units: Vec<Unit>,
    pub random: u32,
}

impl Default for Lent {
    fn default() -> Self {
        Lent {
            frame: vec![0; 513],
            outgoing: vec![0; 520],
            counters: Rc::default(),
            units: Vec::new(),
            random: 0,
        }
    }
}

impl Storage for Lent {
    fn frame(&mut self) -> &mut [u8] {
        &mut self.frame
    }

    fn count(&mut self, counter: Counter, more: u16) {
        self.counters.borrow_mut()[counter as usize] += u32::from(more);
    }
}

impl Means for Lent {
    fn outgoing(&mut self) -> &mut [u8] {
        &mut self.outgoing
    }

    fn units(&mut self) -> &mut [Unit] {
        &mut self.units
    }

    fn random(&mut self) -> u32 {
        self.random
    }
}

/// A job that owns its data, as bytes on the wire.
pub struct Task {
    pub ticket: Ticket,
    pub data: Vec<u8>,
    pub reply: Vec<u8>,
}

impl Task {
    /// What `build` outlines, for `unit`, with `data` and the caller's number.
    pub fn new(
        unit: u8,
        transaction: u16,
        data: &[u8],
        build: impl FnOnce(&mut Outline) -> Status,
    ) -> Task {
        let mut ticket = Ticket::NONE;
        ticket.unit = unit;
        ticket.transaction = transaction;
        ticket.capacity = 252;
        assert_eq!(build(&mut ticket.outline), Status::OK);
        Task {
            ticket,
            data: data.to_vec(),
            reply: vec![0xEE; 252],
        }
    }

    /// The data received.
    pub fn received(&self) -> &[u8] {
        &self.reply[..usize::from(self.ticket.length)]
    }
}

impl Job for Task {
    fn ticket(&self) -> &Ticket {
        &self.ticket
    }

    fn ticket_mut(&mut self) -> &mut Ticket {
        &mut self.ticket
    }

    fn byte(&self, index: usize) -> u8 {
        self.data[index]
    }

    fn put(&mut self, index: usize, byte: u8) {
        self.reply[index] = byte;
    }
}
