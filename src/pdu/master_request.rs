//! A request of the master: its head, and the number of transmit words that follow it.

use super::fields::check_range;
use super::function_spec::*;
use super::limits::MAX_READ_WRITE_REGISTERS;
use crate::error::Status;

/// Function code, and at most four words of address and quantity.
const HEAD: usize = 9;

/// The part of a [`FunctionSpec`] that the master needs. The compiler converts each constant.
/// Converted at run time, they would enlarge [`MasterRequest::set`] by at least 22 bytes on an
/// AVR and 16 on a Cortex-M0+.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
// One number, because a call passes it in registers. A microcontroller would copy a constant
// of several fields to RAM first.
pub struct MasterSpec(u32);

impl MasterSpec {
    /// The response carries data after a byte count. Without this flag it repeats the head.
    const READS: u8 = 1;
    /// A byte count and data follow the head.
    const SENDS: u8 = 2;
    /// The data are registers, not bits.
    const REGISTERS: u8 = 4;

    /// Converts `spec`, which must be that of one of the master's functions.
    #[inline(always)]
    pub const fn new(spec: FunctionSpec) -> MasterSpec {
        let mut flags = 0;
        if spec.has(READ) {
            flags |= MasterSpec::READS;
        }
        if spec.has(COUNTED) {
            flags |= MasterSpec::SENDS;
        }
        if spec.has(RANGE) && !spec.has(BITS) {
            flags |= MasterSpec::REGISTERS;
        }
        let [low, high] = spec.greatest_quantity().to_le_bytes();
        MasterSpec(u32::from_le_bytes([spec.function(), flags, low, high]))
    }
}

/// A request, which the master keeps until the response has arrived: the head, and the
/// number of bytes of the transmit words that follow it.
// Lengths first: see `Engine`.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub struct MasterRequest {
    head_length: u8,
    /// Length of the response PDU if the request succeeds.
    response_length: u8,
    /// Bytes of data that follow the head and their byte count; 0: neither follows.
    sends: u8,
    /// Bytes of data in the response; 0: it repeats the head.
    reads: u8,
    /// A mask of the bits that are used in the last byte of data.
    mask: u8,
    /// The data are registers, which travel high byte first.
    registers: bool,
    head: [u8; HEAD],
}

impl MasterRequest {
    /// No request.
    pub const NONE: MasterRequest = MasterRequest {
        head_length: 0,
        response_length: 0,
        sends: 0,
        reads: 0,
        mask: 0,
        registers: false,
        head: [0; HEAD],
    };

    /// The request that `build` writes.
    ///
    /// # Errors
    /// The status with which `build` refuses.
    pub fn build(
        build: impl FnOnce(&mut MasterRequest) -> Status,
    ) -> Result<MasterRequest, Status> {
        let mut request = MasterRequest::NONE;
        match build(&mut request) {
            Status::OK => Ok(request),
            refused => Err(refused),
        }
    }

    /// Sets the request of the function `spec`, with an address and a quantity or value
    /// `word`. Returns [`Status::ILLEGAL_DATA_VALUE`] for a quantity that the standard does
    /// not allow, [`Status::ILLEGAL_DATA_ADDRESS`] if the range goes beyond address 65535,
    /// otherwise [`Status::OK`].
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn set(&mut self, spec: MasterSpec, address: u16, word: u16) -> Status {
        let [function, flags, low, high] = spec.0.to_le_bytes();
        let ([a, b], [c, d]) = (address.to_be_bytes(), word.to_be_bytes());
        let [at_0, at_1, at_2, at_3, at_4, ..] = &mut self.head;
        (*at_0, *at_1, *at_2, *at_3, *at_4) = (function, a, b, c, d);
        self.head_length = 5;
        self.response_length = 5;
        self.registers = flags & MasterSpec::REGISTERS != 0;
        self.mask = 0xFF;
        // A greater quantity is refused below, so the lost high bits do no harm.
        let mut bytes = (word << 1) as u8;
        if !self.registers {
            bytes = (word.wrapping_add(7) >> 3) as u8;
            self.mask >>= word.wrapping_neg() & 7;
        }
        self.sends = bytes;
        self.reads = 0;
        if flags & MasterSpec::READS != 0 {
            self.reads = bytes;
            self.response_length = bytes.wrapping_add(2);
        }
        if flags & MasterSpec::SENDS == 0 {
            self.sends = 0;
        }
        match u16::from_le_bytes([low, high]) {
            0 => Status::OK,
            most => check_range(address, word, most),
        }
    }

    /// 16 (hex): the register becomes `(register & and_mask) | (or_mask & !and_mask)`.
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        let spec = MasterSpec::new(FunctionSpec::MASK_WRITE_REGISTER);
        let status = self.set(spec, address, and_mask);
        self.append_word(or_mask);
        status
    }

    /// 17 (hex): the values to write are the transmit words. Returns [`Status::ILLEGAL_DATA_VALUE`]
    /// unless 1 to 125 registers are read and 1 to 121 written,
    /// [`Status::ILLEGAL_DATA_ADDRESS`] if a range goes beyond address 65535, otherwise
    /// [`Status::OK`].
    pub fn read_write_registers(
        &mut self,
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
    ) -> Status {
        let spec = MasterSpec::new(FunctionSpec::READ_WRITE_REGISTERS);
        let readable = self.set(spec, read_address, read_quantity);
        self.append_word(write_address);
        self.append_word(write_quantity);
        self.sends = (write_quantity << 1) as u8;
        match check_range(write_address, write_quantity, MAX_READ_WRITE_REGISTERS) {
            Status::OK => readable,
            refused => refused,
        }
    }

    /// Appends a word to the head.
    fn append_word(&mut self, word: u16) {
        let at = usize::from(self.head_length);
        if let Some(place) = self.head.get_mut(at..at + 2) {
            place.copy_from_slice(&word.to_be_bytes());
        }
        self.head_length += 2;
        if self.reads == 0 {
            self.response_length = self.head_length;
        }
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// The memory of the head: its first [`MasterRequest::head_length`] bytes are used.
    pub const fn head(&self) -> &[u8] {
        &self.head
    }

    /// Bytes of the head. The response to a write repeats them.
    pub const fn head_length(&self) -> u8 {
        self.head_length
    }

    /// True if the data are registers, which travel high byte first; false if they
    /// are bits, of which the low byte of 16 travels first.
    pub const fn has_registers(&self) -> bool {
        self.registers
    }

    /// Length of the response PDU if the request succeeds.
    pub const fn response_length(&self) -> u8 {
        self.response_length
    }

    /// True if the response carries data behind a byte count, false if it
    /// repeats the request's head.
    pub const fn is_read(&self) -> bool {
        self.reads > 0
    }

    /// Bytes of data in a successful response.
    pub const fn reads(&self) -> u8 {
        self.reads
    }

    /// Sets the bytes of data in the response to `bytes`. All bits of them are used.
    pub fn set_reads(&mut self, bytes: u8) {
        self.reads = bytes;
        self.mask = 0xFF;
    }

    /// Bytes of the caller's words that are sent.
    pub const fn sends(&self) -> u8 {
        self.sends
    }

    /// A mask of the bits that are used in the last byte of data.
    pub const fn mask(&self) -> u8 {
        self.mask
    }

    /// The two words of a request that consists of a function code and two words.
    pub fn two_words(&self) -> Option<[u8; 4]> {
        let [_, a, b, c, d, ..] = self.head;
        (self.head_length == 5 && self.sends == 0).then_some([a, b, c, d])
    }

    /// Length of the PDU.
    pub const fn length(&self) -> u8 {
        if self.sends == 0 {
            self.head_length
        } else {
            self.sends.wrapping_add(self.head_length).wrapping_add(1)
        }
    }
}
