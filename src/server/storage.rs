//! The four tables as services. Their data are in arrays, or in a data model of the program.

use super::table::{self, DataModel, Direction, TableKind};
use super::{Reply, Service};
use core::fmt;
use core::ops::Range;

/// Input registers: serves 04.
///
/// ```
/// use mbm::server::storage::{InputRegisters, RegisterArray};
///
/// let mut words = [21, 22];
/// let service = InputRegisters(RegisterArray::new(0, &mut words));
/// ```
#[derive(Debug)]
pub struct InputRegisters<T>(pub T);

/// Holding registers: serves 03, 06, 10, 16 and 17.
///
/// ```
/// use mbm::server::storage::{HoldingRegisters, RegisterArray};
///
/// let mut words = [555, 100];
/// let service = HoldingRegisters(RegisterArray::new(107, &mut words));
/// ```
#[derive(Debug)]
pub struct HoldingRegisters<T>(pub T);

/// Discrete inputs: serves 02.
///
/// ```
/// use mbm::server::storage::{BitArray, DiscreteInputs};
///
/// let mut bits = [0b101];
/// let service = DiscreteInputs(BitArray::new(0, &mut bits));
/// ```
#[derive(Debug)]
pub struct DiscreteInputs<T>(pub T);

/// Coils: serves 01, 05 and 0F.
///
/// ```
/// use mbm::server::storage::{BitArray, Coils};
///
/// let mut bits = [0b101];
/// let service = Coils(BitArray::new(0, &mut bits));
/// ```
#[derive(Debug)]
pub struct Coils<T>(pub T);

impl<T: DataModel> Service for InputRegisters<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        table::serve(TableKind::INPUT_REGISTERS, &mut self.0, pdu, length)
    }
}

impl<T: DataModel> Service for HoldingRegisters<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        match table::serve(TableKind::HOLDING_REGISTERS, &mut self.0, pdu, length) {
            Reply::NOT_HANDLED => table::serve_mask_and_read_write(&mut self.0, pdu, length),
            reply => reply,
        }
    }
}

impl<T: DataModel> Service for DiscreteInputs<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        table::serve(TableKind::DISCRETE_INPUTS, &mut self.0, pdu, length)
    }
}

impl<T: DataModel> Service for Coils<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        table::serve(TableKind::COILS, &mut self.0, pdu, length)
    }
}

/// Called before a read, as [`DataModel::before`].
pub type BeforeRead<'a> = &'a mut dyn FnMut(u16, u16) -> u8;
/// Called before a write, as [`DataModel::before`].
pub type BeforeWrite<'a> = &'a mut dyn FnMut(u16, u16, &[u8]) -> u8;
/// Called after a write, as [`DataModel::after_write`].
pub type AfterWrite<'a> = &'a mut dyn FnMut(u16, u16, &[u8]);

/// Registers in an array.
///
/// ```
/// use mbm::server::storage::RegisterArray;
///
/// // Nobody may write register 107.
/// let mut words = [555, 100];
/// let mut refuse = |address: u16, _: u16, _: &[u8]| if address == 107 { 2 } else { 0 };
/// let mut registers = RegisterArray::new(107, &mut words);
/// registers.before_write = Some(&mut refuse);
/// ```
pub struct RegisterArray<'a> {
    /// The registers.
    pub words: &'a mut [u16],
    /// Address of the first register.
    pub base: u16,
    /// One bit for each register, lowest bit first: 0 means that the register does not exist.
    /// `None` if all registers exist.
    pub valid: Option<&'a [u8]>,
    /// Called before a read.
    pub before_read: Option<BeforeRead<'a>>,
    /// Called before a write.
    pub before_write: Option<BeforeWrite<'a>>,
    /// Called after a write.
    pub after_write: Option<AfterWrite<'a>>,
}

/// Bits in an array, eight to a byte, lowest first.
///
/// ```
/// use mbm::server::storage::BitArray;
///
/// // Twelve coils, of which the fourth does not exist.
/// let (mut bits, valid) = ([0, 0], [0b1111_0111, 0x0F]);
/// let mut coils = BitArray::new(0, &mut bits);
/// coils.size = 12;
/// coils.valid = Some(&valid);
/// ```
pub struct BitArray<'a> {
    /// The bits.
    pub bits: &'a mut [u8],
    /// Address of the first bit.
    pub base: u16,
    /// Number of bits; at most as many as the array holds.
    pub size: u16,
    /// One bit for each bit, as in [`RegisterArray`].
    pub valid: Option<&'a [u8]>,
    /// Called before a read.
    pub before_read: Option<BeforeRead<'a>>,
    /// Called before a write.
    pub before_write: Option<BeforeWrite<'a>>,
    /// Called after a write.
    pub after_write: Option<AfterWrite<'a>>,
}

impl<'a> RegisterArray<'a> {
    /// Registers from address `base` on, without gaps and without hooks.
    pub fn new(base: u16, words: &'a mut [u16]) -> Self {
        RegisterArray {
            words,
            base,
            valid: None,
            before_read: None,
            before_write: None,
            after_write: None,
        }
    }
}

impl<'a> BitArray<'a> {
    /// Bits from address `base` on, as many as the array holds, without gaps and without hooks.
    pub fn new(base: u16, bits: &'a mut [u8]) -> Self {
        let size = u16::try_from(bits.len() * 8).unwrap_or(u16::MAX);
        BitArray {
            bits,
            base,
            size,
            valid: None,
            before_read: None,
            before_write: None,
            after_write: None,
        }
    }
}

impl fmt::Debug for RegisterArray<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter
            .debug_struct("RegisterArray")
            .field("base", &self.base)
            .field("words", &self.words)
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for BitArray<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter
            .debug_struct("BitArray")
            .field("base", &self.base)
            .field("size", &self.size)
            .field("bits", &self.bits)
            .finish_non_exhaustive()
    }
}

fn bit(map: &[u8], index: usize) -> bool {
    map.get(index / 8)
        .is_some_and(|byte| byte >> (index % 8) & 1 != 0)
}

/// The indexes of `quantity` cells from `address` on, in an array of `size` cells whose first has
/// the address `base`. `None` unless all of them are in the array, and exist by `valid`.
fn places(
    base: u16,
    size: usize,
    valid: Option<&[u8]>,
    address: u16,
    quantity: u16,
) -> Option<Range<usize>> {
    // The last address must not exceed 65535.
    address.checked_add(quantity.checked_sub(1)?)?;
    let first = usize::from(address.checked_sub(base)?);
    let last = first.checked_add(quantity.into())?;
    let exists = |cell| valid.is_none_or(|valid| bit(valid, cell));
    (last <= size && (first..last).all(exists)).then_some(first..last)
}

impl DataModel for RegisterArray<'_> {
    fn contains(&self, address: u16, quantity: u16) -> bool {
        let size = self.words.len();
        places(self.base, size, self.valid, address, quantity).is_some()
    }

    fn transfer(&mut self, direction: Direction, address: u16, _quantity: u16, data: &mut [u8]) {
        let first = usize::from(address.wrapping_sub(self.base));
        let words = self.words.get_mut(first..).unwrap_or_default();
        for (word, pair) in words.iter_mut().zip(data.as_chunks_mut().0) {
            match direction {
                Direction::Read => *pair = word.to_be_bytes(),
                Direction::Write => *word = u16::from_be_bytes(*pair),
            }
        }
    }

    fn before(&mut self, direction: Direction, address: u16, quantity: u16, data: &[u8]) -> u8 {
        match (direction, &mut self.before_read, &mut self.before_write) {
            (Direction::Read, Some(hook), _) => hook(address, quantity),
            (Direction::Write, _, Some(hook)) => hook(address, quantity, data),
            _ => 0,
        }
    }

    fn after_write(&mut self, address: u16, quantity: u16, data: &[u8]) {
        if let Some(hook) = &mut self.after_write {
            hook(address, quantity, data);
        }
    }
}

impl DataModel for BitArray<'_> {
    fn contains(&self, address: u16, quantity: u16) -> bool {
        let size = usize::from(self.size).min(self.bits.len().saturating_mul(8));
        places(self.base, size, self.valid, address, quantity).is_some()
    }

    fn transfer(&mut self, direction: Direction, address: u16, quantity: u16, data: &mut [u8]) {
        let first = usize::from(address.wrapping_sub(self.base));
        if direction == Direction::Read {
            data.fill(0);
        }
        for index in 0..usize::from(quantity) {
            let (from, to, at, place) = match direction {
                Direction::Read => (&*self.bits, &mut *data, first + index, index),
                Direction::Write => (&*data, &mut *self.bits, index, first + index),
            };
            let on = bit(from, at);
            if let Some(byte) = to.get_mut(place / 8) {
                let mask = 1 << (place % 8);
                *byte = if on { *byte | mask } else { *byte & !mask };
            }
        }
    }

    fn before(&mut self, direction: Direction, address: u16, quantity: u16, data: &[u8]) -> u8 {
        match (direction, &mut self.before_read, &mut self.before_write) {
            (Direction::Read, Some(hook), _) => hook(address, quantity),
            (Direction::Write, _, Some(hook)) => hook(address, quantity, data),
            _ => 0,
        }
    }

    fn after_write(&mut self, address: u16, quantity: u16, data: &[u8]) {
        if let Some(hook) = &mut self.after_write {
            hook(address, quantity, data);
        }
    }
}
