//! A request that owns its data, and the buffers and records that a client works with.

use mbm::client::{ClientRequest, ClientStorage, RequestState, UnitRecord};
use mbm::engine::{Counter, Frame, Storage, COUNTERS};
use mbm::error::Status;
use std::cell::RefCell;
use std::rc::Rc;

/// Buffers of full size, counters and records of units. It panics at an index out of range;
/// the raw pointers of the C ABI would not notice one.
pub struct Lent {
    pub frame: Frame<Vec<u8>>,
    pub outgoing: Vec<u8>,
    pub counters: Rc<RefCell<[u32; COUNTERS]>>,
    pub units: Vec<UnitRecord>,
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
        let (end, space) = (u32::from(index) + u32::from(count), self.capacity());
        assert!(end <= space.into(), "{count} bytes from {index} of {space}");
    }
}

impl Storage for Lent {
    type Count = u16;

    fn capacity(&self) -> u16 {
        self.frame.capacity()
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

    fn count(&mut self, counter: Counter, more: u32) {
        self.counters.borrow_mut()[counter as usize] += more;
    }
}

impl ClientStorage for Lent {
    fn outgoing(&mut self) -> &mut [u8] {
        &mut self.outgoing
    }

    fn units(&self) -> &[UnitRecord] {
        &self.units
    }

    fn units_mut(&mut self) -> &mut [UnitRecord] {
        &mut self.units
    }

    fn random(&mut self) -> u32 {
        self.random
    }
}

/// A request that owns its data, in the byte order of the wire.
pub struct Task {
    pub state: RequestState,
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
        build: impl FnOnce(&mut RequestState) -> Status,
    ) -> Task {
        let mut state = RequestState::NONE;
        state.unit = unit.into();
        state.transaction = transaction;
        state.capacity = 252;
        assert_eq!(build(&mut state), Status::OK);
        Task {
            state,
            data: data.to_vec(),
            reply: vec![0xEE; 252],
        }
    }

    /// The received data.
    pub fn received(&self) -> &[u8] {
        &self.reply[..usize::from(self.state.length)]
    }
}

impl ClientRequest for Task {
    fn state(&self) -> &RequestState {
        &self.state
    }

    fn state_mut(&mut self) -> &mut RequestState {
        &mut self.state
    }

    fn byte(&self, index: usize) -> u8 {
        self.data[index]
    }

    fn store(&mut self, data: &[u8], mask: u8) {
        self.reply[..data.len()].copy_from_slice(data);
        if let Some(last) = data.len().checked_sub(1) {
            self.reply[last] &= mask;
        }
    }
}
