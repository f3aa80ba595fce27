//! A request that owns its data, and the buffers and records that a client works with.

use mbm::client::{Job, Means, Ticket, Unit};
use mbm::engine::{Counter, Frame, Storage, COUNTERS};
use mbm::error::Status;
use mbm::pdu::outline::Outline;
use std::cell::RefCell;
use std::rc::Rc;

/// Buffers of full size, counters and records of units. It panics at an index out of range;
/// the raw pointers of the C ABI would not notice one.
pub struct Lent {
    pub frame: Frame<Vec<u8>>,
    pub outgoing: Vec<u8>,
    pub counters: Rc<RefCell<[u32; COUNTERS]>>,
    pub units: Vec<Unit>,
    pub random: u32,
}

impl Default for Lent {
    fn default() -> Self {
        Lent {
            frame: Frame::new(vec![0; 513]),
            outgoing: vec![0; 520],
            counters: Rc::default(),
            units: Vec::new(),
            random: 0,
        }
    }
}

impl Lent {
    fn within(&self, index: u16, count: u16) {
        let (end, room) = (u32::from(index) + u32::from(count), self.room());
        assert!(end <= room.into(), "{count} bytes from {index} of {room}");
    }
}

impl Storage for Lent {
    type Count = u16;

    fn room(&self) -> u16 {
        self.frame.room()
    }

    fn byte(&self, index: u16) -> u8 {
        self.within(index, 1);
        self.frame.byte(index)
    }

    fn set_byte(&mut self, index: u16, byte: u8) {
        self.within(index, 1);
        self.frame.set_byte(index, byte);
    }

    fn slice(&self, index: u16, count: u16) -> &[u8] {
        self.within(index, count);
        self.frame.slice(index, count)
    }

    fn bytes(&mut self, index: u16, count: u16) -> &mut [u8] {
        self.within(index, count);
        self.frame.bytes(index, count)
    }

    fn set_aside(&mut self, count: u16) {
        self.within(0, count);
        self.frame.set_aside(count);
    }

    fn take_back(&mut self, count: u16) {
        self.frame.take_back(count);
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

/// A request that owns its data, in the byte order of the wire.
pub struct Task {
    pub ticket: Ticket,
    pub data: Vec<u8>,
    pub reply: Vec<u8>,
}

impl Task {
    /// A request to `unit` that `build` describes, with `data` and the caller's number
    /// `transaction`.
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

    /// The received data.
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
