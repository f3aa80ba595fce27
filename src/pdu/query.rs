//! A request as the facade keeps it: built head first, sent with the caller's
//! words behind it.

use crate::error::Status;

/// Function code, and at most four words of address and quantity.
const HEAD: usize = 9;

/// How the request of a function is built, and what answers it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
// One number, which a call passes in registers: a microcontroller would copy a
// constant of several fields to RAM.
pub struct FunctionSpec(u32);

impl FunctionSpec {
    /// The response brings data behind a byte count; else it repeats the head.
    const READS: u8 = 1;
    /// Data follow the head behind a byte count.
    const SENDS: u8 = 2;
    /// The data are registers, not bits.
    const REGISTERS: u8 = 4;

    const fn new(function: u8, traits: u8, most: u16) -> FunctionSpec {
        let [low, high] = most.to_le_bytes();
        FunctionSpec(u32::from_le_bytes([function, traits, low, high]))
    }

    /// An address and a value, which the response repeats.
    pub(super) const fn single(function: u8) -> FunctionSpec {
        FunctionSpec::new(function, 0, 0)
    }

    /// Reads at `most` so many bits.
    pub(super) const fn reads_bits(function: u8, most: u16) -> FunctionSpec {
        FunctionSpec::new(function, FunctionSpec::READS, most)
    }

    /// Reads at `most` so many registers.
    pub(super) const fn reads_registers(function: u8, most: u16) -> FunctionSpec {
        FunctionSpec::new(
            function,
            FunctionSpec::READS | FunctionSpec::REGISTERS,
            most,
        )
    }

    /// Writes at `most` so many bits.
    pub(super) const fn writes_bits(function: u8, most: u16) -> FunctionSpec {
        FunctionSpec::new(function, FunctionSpec::SENDS, most)
    }

    /// Writes at `most` so many registers.
    pub(super) const fn writes_registers(function: u8, most: u16) -> FunctionSpec {
        FunctionSpec::new(
            function,
            FunctionSpec::SENDS | FunctionSpec::REGISTERS,
            most,
        )
    }
}

/// A request as its sender keeps it until the response is there: the fixed head,
/// and how many bytes of the caller's words to send behind it.
// Lengths first: see `Engine`.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub struct MasterRequest {
    head_length: u8,
    /// Length of the response PDU if the request succeeds.
    response_length: u8,
    /// Bytes of data that follow the head behind their count; 0: neither do.
    sends: u8,
    /// Bytes of data in the response; 0: it repeats the head.
    reads: u8,
    /// The bits used of the last byte of data.
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

    /// Becomes the request of a form, of an address and a quantity or value; says
    /// whether every device would accept that.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn set(&mut self, form: FunctionSpec, address: u16, word: u16) -> Status {
        let [function, traits, low, high] = form.0.to_le_bytes();
        let ([a, b], [c, d]) = (address.to_be_bytes(), word.to_be_bytes());
        let [at_0, at_1, at_2, at_3, at_4, ..] = &mut self.head;
        (*at_0, *at_1, *at_2, *at_3, *at_4) = (function, a, b, c, d);
        self.head_length = 5;
        self.response_length = 5;
        self.registers = traits & FunctionSpec::REGISTERS != 0;
        self.mask = 0xFF;
        // Too many are refused below, so what is cut off here does no harm.
        let mut bytes = (word << 1) as u8;
        if !self.registers {
            bytes = (word.wrapping_add(7) >> 3) as u8;
            self.mask >>= word.wrapping_neg() & 7;
        }
        self.sends = bytes;
        self.reads = 0;
        if traits & FunctionSpec::READS != 0 {
            self.reads = bytes;
            self.response_length = bytes.wrapping_add(2);
        }
        if traits & FunctionSpec::SENDS == 0 {
            self.sends = 0;
        }
        match u16::from_le_bytes([low, high]) {
            0 => Status::OK,
            most => check_range(address, word, most),
        }
    }

    /// Has a word follow the head.
    pub(super) fn append_word(&mut self, word: u16) {
        let at = usize::from(self.head_length);
        if let Some(place) = self.head.get_mut(at..at + 2) {
            place.copy_from_slice(&word.to_be_bytes());
        }
        self.head_length += 2;
        if self.reads == 0 {
            self.response_length = self.head_length;
        }
    }

    /// Has `bytes` of the caller's words follow the head.
    pub(super) fn append_data(&mut self, bytes: u8) {
        self.sends = bytes;
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// The head, and what follows it in memory.
    pub const fn head(&self) -> &[u8] {
        &self.head
    }

    /// Bytes of the head, with which the response to a write agrees.
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

    /// Has the response carry `bytes` of data, all of whose bits are used.
    pub fn set_reads(&mut self, bytes: u8) {
        self.reads = bytes;
        self.mask = 0xFF;
    }

    /// Bytes of the caller's words that are sent.
    pub const fn sends(&self) -> u8 {
        self.sends
    }

    /// The bits used of the last byte of data.
    pub const fn mask(&self) -> u8 {
        self.mask
    }

    /// The words of a request that is a function code and two words, as sent.
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

/// Checks a range of addresses as every device would (application protocol,
/// figures 11 and following: quantity first, then addresses).
pub(super) fn check_range(address: u16, quantity: u16, most: u16) -> Status {
    if quantity == 0 || quantity > most {
        Status::ILLEGAL_DATA_VALUE
    } else if address.checked_add(quantity - 1).is_none() {
        Status::ILLEGAL_DATA_ADDRESS
    } else {
        Status::OK
    }
}
