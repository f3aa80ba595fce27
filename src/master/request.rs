//! A request of the master: its head, and the number of transmit words that follow it. It is a
//! transaction of the engine, in RTU frames: the request determines the length of its reply.

use crate::engine::{Engine, Transaction, Words};
use crate::error::{Error, Status};
use crate::frame::rtu;
use crate::pdu::functions::{FunctionSpec, BITS, RANGE, READ};
use crate::pdu::{
    check_range, MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS, MAX_WRITE_BITS,
    MAX_WRITE_REGISTERS,
};
use crate::port::Port;

/// Function code, and at most four words of address and quantity.
const HEAD: usize = 9;

/// The function code in the short form of a [`FunctionSpec`].
const FUNCTION: u8 = 0x1F;
/// The second word is a quantity.
const HAS_QUANTITY: u8 = 0x20;
/// The response repeats the head. Without this flag it carries data after a byte count.
const WRITES: u8 = 0x40;
/// The data are bits, not registers.
const HAS_BITS: u8 = 0x80;

impl FunctionSpec {
    /// The part that a [`MasterRequest`] needs, in one byte: the function code and three flags.
    /// The compiler converts each constant, which takes less flash than at run time. It must be
    /// one of the master's functions.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn short(self) -> u8 {
        let mut short = self.function();
        if self.has(RANGE) {
            short |= HAS_QUANTITY;
        }
        if !self.has(READ) {
            short |= WRITES;
        }
        if self.has(BITS) {
            short |= HAS_BITS;
        }
        short
    }
}

// A byte count limits the quantity of bits as it limits that of registers.
const _: () = {
    assert!(MAX_READ_BITS == MAX_READ_REGISTERS * 16);
    assert!(MAX_WRITE_BITS == MAX_WRITE_REGISTERS * 16);
};

/// A request, which the master keeps until the response has arrived: the head, and the
/// number of bytes of the transmit words that follow it.
///
/// It is no `client::RequestState`, which holds every function: that has 27 bytes more, and the
/// master's programs are 16 to 144 bytes larger if they build a request as a client does.
// Lengths first: see `Engine`.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub struct MasterRequest {
    head_length: u8,
    /// Bytes of data that follow the head and their byte count; 0: neither follows.
    sends: u8,
    /// Bytes of data in the response; 0: it repeats the head.
    reads: u8,
    /// A mask of the bits that are used in the last byte of data.
    mask: u8,
    /// The data are bits. The low byte of each 16 travels first.
    has_bits: bool,
    head: [u8; HEAD],
}

impl MasterRequest {
    /// No request.
    pub const NONE: MasterRequest = MasterRequest {
        head_length: 0,
        sends: 0,
        reads: 0,
        mask: 0xFF,
        has_bits: false,
        head: [0; HEAD],
    };

    /// The request that `build` writes.
    ///
    /// # Errors
    /// The status with which `build` refuses.
    pub fn build(build: impl FnOnce(&mut MasterRequest) -> Status) -> Result<MasterRequest, Error> {
        let mut request = MasterRequest::NONE;
        build(&mut request).result()?;
        Ok(request)
    }

    /// Sets the request of a function, given as [`FunctionSpec::short`], with an address and a
    /// quantity or value `word`. Returns [`Status::ILLEGAL_DATA_VALUE`] for a quantity that the standard does
    /// not allow, [`Status::ILLEGAL_DATA_ADDRESS`] if the range goes beyond address 65535,
    /// otherwise [`Status::OK`].
    pub fn set(&mut self, function: u8, address: u16, word: u16) -> Status {
        let (a, b, c, d) = (
            (address >> 8) as u8,
            address as u8,
            (word >> 8) as u8,
            word as u8,
        );
        let [at_0, at_1, at_2, at_3, at_4, ..] = &mut self.head;
        *at_0 = function & FUNCTION;
        (*at_1, *at_2, *at_3, *at_4) = (a, b, c, d);
        self.head_length = 5;
        self.sends = 0;
        self.reads = 0;
        if function & HAS_QUANTITY == 0 {
            return Status::OK;
        }
        // A greater quantity is refused below, so the lost high bits do no harm.
        let mut bytes = d << 1;
        let mut most = MAX_READ_REGISTERS;
        if function & WRITES != 0 {
            most = MAX_WRITE_REGISTERS;
        }
        self.mask = 0xFF;
        self.has_bits = function & HAS_BITS != 0;
        if self.has_bits {
            bytes = (word.wrapping_add(7) >> 3) as u8;
            most <<= 4;
            self.mask = 0xFF >> (d.wrapping_neg() & 7);
        }
        if function & WRITES != 0 {
            self.sends = bytes;
        } else {
            self.reads = bytes;
        }
        check_range(address, word, most)
    }

    /// 16 (hex): the register becomes `(register & and_mask) | (or_mask & !and_mask)`.
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        let function = FunctionSpec::MASK_WRITE_REGISTER.short();
        let status = self.set(function, address, and_mask);
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
        let function = FunctionSpec::READ_WRITE_REGISTERS.short();
        let readable = self.set(function, read_address, read_quantity);
        let writable = self.append_write(write_address, write_quantity);
        match writable {
            Status::OK => readable,
            refused => refused,
        }
    }

    /// Appends the address and quantity of the write to a request that reads.
    pub fn append_write(&mut self, address: u16, quantity: u16) -> Status {
        self.append_word(address);
        self.append_word(quantity);
        self.sends = (quantity << 1) as u8;
        check_range(address, quantity, MAX_READ_WRITE_REGISTERS)
    }

    /// Appends a word to the head.
    pub fn append_word(&mut self, word: u16) {
        let at = usize::from(self.head_length);
        if let Some(place) = self.head.get_mut(at..at + 2) {
            place.copy_from_slice(&word.to_be_bytes());
        }
        self.head_length += 2;
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// The memory of the head: its first [`MasterRequest::head_length`] bytes are used.
    pub const fn head(&self) -> &[u8] {
        &self.head
    }

    /// The byte of the head at `index`.
    #[inline(always)]
    pub fn head_at(&self, index: u8) -> u8 {
        self.head.get(usize::from(index)).copied().unwrap_or(0)
    }

    /// Bytes of the head. The response to a write repeats them.
    pub const fn head_length(&self) -> u8 {
        self.head_length
    }

    /// True if the data are registers, which travel high byte first. False if they are bits:
    /// the low byte of each 16 travels first.
    pub const fn has_registers(&self) -> bool {
        !self.has_bits
    }

    /// Length of the response PDU if the request succeeds.
    pub const fn response_length(&self) -> u8 {
        if self.reads > 0 {
            self.reads + 2
        } else {
            self.head_length
        }
    }

    /// True if the response carries data after a byte count, false if it repeats the request's
    /// head.
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

    /// Bits of data in a successful response.
    pub const fn bits(&self) -> u16 {
        self.reads as u16 * 8 - self.mask.leading_zeros() as u16
    }

    /// Bytes of the caller's words that are sent.
    pub const fn sends(&self) -> u8 {
        self.sends
    }

    /// A mask of the bits that are used in the last byte of data.
    pub const fn mask(&self) -> u8 {
        self.mask
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

/// A serial line: its port, its buffers and its settings, and the pending request. Any number
/// of nodes use it, one request after the other.
pub type Line<P, S> = Engine<P, S, MasterRequest>;

/// Bytes of a frame around its PDU: unit and CRC.
const AROUND_PDU: u8 = rtu::OVERHEAD as u8;

impl<P, S: Words> Transaction<P, S> for MasterRequest {
    const NONE: Self = MasterRequest::NONE;
    const IS_OF_MASTER: bool = true;

    fn function(&self) -> u8 {
        MasterRequest::function(self)
    }

    fn may_be_broadcast(&self) -> bool {
        !self.is_read()
    }

    fn response_timeout(engine: &Line<P, S>) -> u32 {
        engine.storage.response_timeout(&engine.settings)
    }

    fn fits(&self, space: u8) -> bool {
        self.length() <= space.wrapping_sub(AROUND_PDU)
    }

    fn reply_length(&self) -> u8 {
        self.response_length() + AROUND_PDU
    }

    fn write(engine: &mut Line<P, S>) {
        write(engine);
    }

    fn is_reply(engine: &Line<P, S>, front: u8, _length: u8) -> bool {
        if engine.request.is_read() {
            engine.storage.byte(front + 2) == engine.request.reads()
        } else {
            Self::is_echo(engine, front)
        }
    }

    fn is_echo(engine: &Line<P, S>, front: u8) -> bool {
        let mut index = engine.request.head_length();
        while index > 0 {
            let byte = engine.storage.byte(front + index);
            index -= 1;
            if byte != engine.request.head_at(index) {
                return false;
            }
        }
        true
    }
}

/// Writes the frame of the request.
fn write<P, S: Words>(engine: &mut Line<P, S>) {
    engine.storage.set_byte(0, engine.unit);
    let mut end = 0;
    while end < engine.request.head_length() {
        let byte = engine.request.head_at(end);
        end += 1;
        engine.storage.set_byte(end, byte);
    }
    end += 1;
    let sends = engine.request.sends();
    if sends > 0 {
        engine.storage.set_byte(end, sends);
        engine
            .storage
            .load_words(end + 1, sends, engine.request.has_registers());
        end += sends;
        clear_unused_bits(engine, end);
        end += 1;
    }
    engine.append_crc(end);
}

/// Clears the bits of the last byte of data, which is at `index`, that the request does not use.
#[inline(always)]
fn clear_unused_bits<P, S: Words>(engine: &mut Line<P, S>, index: u8) {
    let byte = engine.storage.byte(index) & engine.request.mask();
    engine.storage.set_byte(index, byte);
}

impl<P: Port, S: Words> Line<P, S> {
    /// [`Status::OK`] if a request may be made, otherwise the reason.
    pub fn ready(&self) -> Status {
        if self.is_pending() {
            return Status::BUSY;
        }
        if self.port.is_ready() && self.storage.capacity() > 0 {
            return Status::OK;
        }
        Status::NOT_INITIALISED
    }

    /// Copies the data of the reply into the response words. False, with nothing copied, if
    /// there are too few words.
    pub fn store_words(&mut self) -> bool {
        let count = self.request.reads();
        if self.response_words() > self.storage.response_words() {
            return false;
        }
        // The data follow unit, function and byte count.
        clear_unused_bits(self, 2 + count);
        self.storage
            .store_words(3, count, self.request.has_registers());
        true
    }

    /// How many response words the data of a successful reply fill.
    pub fn response_words(&self) -> u8 {
        self.request.reads().div_ceil(2)
    }
}
