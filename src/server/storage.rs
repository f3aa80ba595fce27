//! Cells one by one, as a program may hold them, and ready storage in arrays.

use super::table::{self, Cells, Kind, Way};
use super::{Reply, Service};

/// Registers that can be read.
pub trait RegisterRead {
    /// True if the register is there.
    fn is_valid(&self, address: u16) -> bool;

    /// A register that is there.
    fn get(&self, address: u16) -> u16;
}

/// Registers that can be written too.
pub trait RegisterWrite: RegisterRead {
    /// Sets a register that is there.
    fn set(&mut self, address: u16, value: u16);

    /// Asked before registers are written, once a request, with the values high
    /// byte first; an exception code refuses all of them, 0 allows.
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let _ = (address, quantity, data);
        0
    }

    /// Told what was written.
    fn after(&mut self, address: u16, quantity: u16) {
        let _ = (address, quantity);
    }
}

/// Bits that can be read.
pub trait BitRead {
    /// True if the bit is there.
    fn is_valid(&self, address: u16) -> bool;

    /// A bit that is there.
    fn get(&self, address: u16) -> bool;
}

/// Bits that can be written too.
pub trait BitWrite: BitRead {
    /// Sets a bit that is there.
    fn set(&mut self, address: u16, on: bool);

    /// As [`RegisterWrite::before`], with eight bits to a byte, lowest first.
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let _ = (address, quantity, data);
        0
    }

    /// Told what was written.
    fn after(&mut self, address: u16, quantity: u16) {
        let _ = (address, quantity);
    }
}

/// The addresses of a range, unless it passes 65535 or one of them is not there.
fn all(address: u16, quantity: u16, is_valid: impl Fn(u16) -> bool) -> bool {
    let last = u32::from(address) + u32::from(quantity);
    last <= 0x1_0000 && (0..quantity).all(|index| is_valid(address.wrapping_add(index)))
}

fn read_registers(cells: &impl RegisterRead, address: u16, data: &mut [u8]) {
    for (cell, pair) in (address..=u16::MAX).zip(data.as_chunks_mut().0) {
        *pair = cells.get(cell).to_be_bytes();
    }
}

fn read_bits(cells: &impl BitRead, address: u16, quantity: u16, data: &mut [u8]) {
    data.fill(0);
    for (index, cell) in (0..quantity).zip(address..=u16::MAX) {
        if let Some(byte) = data.get_mut(usize::from(index / 8)) {
            *byte |= u8::from(cells.get(cell)) << (index % 8);
        }
    }
}

/// Input registers: serves 04.
pub struct InputRegisters<T>(pub T);

/// Holding registers: serves 03, 06, 10, 16 and 17.
pub struct HoldingRegisters<T>(pub T);

/// Discrete inputs: serves 02.
pub struct DiscreteInputs<T>(pub T);

/// Coils: serves 01, 05 and 0F.
pub struct Coils<T>(pub T);

impl<T: RegisterRead> Cells for InputRegisters<T> {
    fn covers(&self, address: u16, quantity: u16) -> bool {
        all(address, quantity, |cell| self.0.is_valid(cell))
    }
    fn transfer(&mut self, way: Way, address: u16, _quantity: u16, data: &mut [u8]) {
        if way == Way::Read {
            read_registers(&self.0, address, data);
        }
    }
}

impl<T: RegisterWrite> Cells for HoldingRegisters<T> {
    fn covers(&self, address: u16, quantity: u16) -> bool {
        all(address, quantity, |cell| self.0.is_valid(cell))
    }
    fn transfer(&mut self, way: Way, address: u16, _quantity: u16, data: &mut [u8]) {
        if way == Way::Read {
            return read_registers(&self.0, address, data);
        }
        for (cell, pair) in (address..=u16::MAX).zip(data.as_chunks().0) {
            self.0.set(cell, u16::from_be_bytes(*pair));
        }
    }
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        self.0.before(address, quantity, data)
    }
    fn after(&mut self, address: u16, quantity: u16) {
        self.0.after(address, quantity);
    }
}

impl<T: BitRead> Cells for DiscreteInputs<T> {
    fn covers(&self, address: u16, quantity: u16) -> bool {
        all(address, quantity, |cell| self.0.is_valid(cell))
    }
    fn transfer(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) {
        if way == Way::Read {
            read_bits(&self.0, address, quantity, data);
        }
    }
}

impl<T: BitWrite> Cells for Coils<T> {
    fn covers(&self, address: u16, quantity: u16) -> bool {
        all(address, quantity, |cell| self.0.is_valid(cell))
    }
    fn transfer(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) {
        if way == Way::Read {
            return read_bits(&self.0, address, quantity, data);
        }
        for (index, cell) in (0..quantity).zip(address..=u16::MAX) {
            if let Some(byte) = data.get(usize::from(index / 8)) {
                self.0.set(cell, byte >> (index % 8) & 1 != 0);
            }
        }
    }
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        self.0.before(address, quantity, data)
    }
    fn after(&mut self, address: u16, quantity: u16) {
        self.0.after(address, quantity);
    }
}

impl<T: RegisterRead> Service for InputRegisters<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        table::serve(Kind::INPUT_REGISTERS, self, pdu, length)
    }
}

impl<T: RegisterWrite> Service for HoldingRegisters<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        match table::serve(Kind::HOLDING_REGISTERS, self, pdu, length) {
            Reply::NOT_MINE => table::serve_more(self, pdu, length),
            reply => reply,
        }
    }
}

impl<T: BitRead> Service for DiscreteInputs<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        table::serve(Kind::DISCRETE_INPUTS, self, pdu, length)
    }
}

impl<T: BitWrite> Service for Coils<T> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        table::serve(Kind::COILS, self, pdu, length)
    }
}

/// Asked before a write, as [`RegisterWrite::before`].
pub type Before<'a> = &'a mut dyn FnMut(u16, u16, &[u8]) -> u8;
/// Told of a write, as [`RegisterWrite::after`].
pub type After<'a> = &'a mut dyn FnMut(u16, u16);

/// Registers in an array.
pub struct Words<'a> {
    /// The registers.
    pub words: &'a mut [u16],
    /// The address of the first.
    pub base: u16,
    /// A bit for each, lowest first: 0 is not there. All are there without.
    pub valid: Option<&'a [u8]>,
    /// Asked before a write.
    pub before: Option<Before<'a>>,
    /// Told of a write.
    pub after: Option<After<'a>>,
}

/// Bits in an array, eight to a byte, lowest first.
pub struct Bits<'a> {
    /// The bits.
    pub bits: &'a mut [u8],
    /// The address of the first.
    pub base: u16,
    /// How many there are; no more than the array holds.
    pub size: u16,
    /// As in [`Words`].
    pub valid: Option<&'a [u8]>,
    /// Asked before a write.
    pub before: Option<Before<'a>>,
    /// Told of a write.
    pub after: Option<After<'a>>,
}

impl<'a> Words<'a> {
    /// Registers from `base` on, all of them there, without hooks.
    pub fn new(base: u16, words: &'a mut [u16]) -> Self {
        Words {
            words,
            base,
            valid: None,
            before: None,
            after: None,
        }
    }

    fn index(&self, address: u16) -> usize {
        usize::from(address.wrapping_sub(self.base))
    }
}

impl<'a> Bits<'a> {
    /// As many bits from `base` on as the array holds, without hooks.
    pub fn new(base: u16, bits: &'a mut [u8]) -> Self {
        let size = u16::try_from(bits.len() * 8).unwrap_or(u16::MAX);
        Bits {
            bits,
            base,
            size,
            valid: None,
            before: None,
            after: None,
        }
    }

    fn index(&self, address: u16) -> usize {
        usize::from(address.wrapping_sub(self.base))
    }
}

fn bit(map: &[u8], index: usize) -> bool {
    map.get(index / 8)
        .is_some_and(|byte| byte >> (index % 8) & 1 != 0)
}

impl RegisterRead for Words<'_> {
    fn is_valid(&self, address: u16) -> bool {
        let index = self.index(address);
        index < self.words.len() && self.valid.is_none_or(|valid| bit(valid, index))
    }
    fn get(&self, address: u16) -> u16 {
        self.words.get(self.index(address)).copied().unwrap_or(0)
    }
}

impl RegisterWrite for Words<'_> {
    fn set(&mut self, address: u16, value: u16) {
        let index = self.index(address);
        if let Some(word) = self.words.get_mut(index) {
            *word = value;
        }
    }
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let hook = self.before.as_mut();
        hook.map_or(0, |hook| hook(address, quantity, data))
    }
    fn after(&mut self, address: u16, quantity: u16) {
        if let Some(hook) = &mut self.after {
            hook(address, quantity);
        }
    }
}

impl BitRead for Bits<'_> {
    fn is_valid(&self, address: u16) -> bool {
        let index = self.index(address);
        index < usize::from(self.size)
            && index / 8 < self.bits.len()
            && self.valid.is_none_or(|valid| bit(valid, index))
    }
    fn get(&self, address: u16) -> bool {
        bit(self.bits, self.index(address))
    }
}

impl BitWrite for Bits<'_> {
    fn set(&mut self, address: u16, on: bool) {
        let index = self.index(address);
        if let Some(byte) = self.bits.get_mut(index / 8) {
            let mask = 1 << (index % 8);
            *byte = if on { *byte | mask } else { *byte & !mask };
        }
    }
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let hook = self.before.as_mut();
        hook.map_or(0, |hook| hook(address, quantity, data))
    }
    fn after(&mut self, address: u16, quantity: u16) {
        if let Some(hook) = &mut self.after {
            hook(address, quantity);
        }
    }
}
