//! A node: one device on a line, as the master sees it, with the ten functions of the Arduino
//! library ModbusMaster. It has the device's unit, the result of its last request, and the
//! positions in the words to send and in the received words. The line sends its requests.

use super::request::Line;
use crate::engine::{Words, BROADCAST};
use crate::error::Status;
use crate::pdu::functions::{coil_value, FunctionSpec};
use crate::port::Port;

/// The value returned for a word that does not exist.
pub const NO_WORD: u16 = 0xFFFF;

/// A device on a line. Zeroed memory is a node of unit 0.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct Node {
    unit: u8,
    status: Status,
    /// The exception code of the last reply; 0 if it was no exception.
    exception: u8,
    /// How many words the last successful read has filled.
    response_words: u8,
    response_index: u8,
    /// The address to which the write functions without an address argument write.
    write_address: u16,
    /// Number of bits queued in the transmit words; a queued word counts as 16.
    transmit_bits: u16,
}

impl Node {
    /// The node of a unit.
    pub const fn new(unit: u8) -> Self {
        Node {
            unit,
            status: Status::OK,
            exception: 0,
            response_words: 0,
            response_index: 0,
            write_address: 0,
            transmit_bits: 0,
        }
    }

    /// Changes to another unit, and empties the queue of words to send.
    pub fn begin(&mut self, unit: u8) {
        self.unit = unit;
        self.transmit_bits = 0;
    }

    /// The unit of later requests; 0 means broadcast.
    pub fn set_unit(&mut self, unit: u8) {
        self.unit = unit;
    }

    /// The unit of requests.
    pub fn unit(&self) -> u8 {
        self.unit
    }

    /// The status of the last request; [`Status::PENDING`] while it is pending.
    pub fn status(&self) -> Status {
        self.status
    }

    /// The exception code of the last reply as received; 0 if it was no exception.
    pub fn exception_code(&self) -> u8 {
        self.exception
    }

    /// True while a request of this node is pending.
    pub fn is_pending(&self) -> bool {
        self.status == Status::PENDING
    }

    /// Takes the status of the request from the line, which has just been polled: a successful
    /// read fills the response words.
    pub fn take<P, S: Words>(&mut self, status: Status, line: &mut Line<P, S>) -> Status
    where
        P: Port,
    {
        self.status = match status {
            Status::OK if line.request().is_read() => {
                if line.store_words() {
                    self.response_words = line.response_words();
                    Status::OK
                } else {
                    Status::BUFFER_TOO_SMALL
                }
            }
            status => status,
        };
        self.exception = line.exception_code();
        self.status
    }

    /// Notes why a request was given up or refused.
    pub fn end(&mut self, status: Status) {
        self.status = status;
    }

    /// Starts the request of a function, given as [`FunctionSpec::short`], with an address and a
    /// quantity or value `word`. If it returns an error, nothing is sent. The address of a write becomes the
    /// write address.
    ///
    /// This and the other functions that make a request require a line that is ready: see
    /// [`Engine::ready`].
    #[inline(always)]
    pub fn request<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        address: u16,
        word: u16,
        function: u8,
    ) -> Status {
        let built = self.build(line, address, word, function);
        self.start(line, built)
    }

    /// Builds the request of a function, given as [`FunctionSpec::short`]. [`Node::start`] starts it.
    fn build<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        address: u16,
        word: u16,
        function: u8,
    ) -> Status {
        let request = line.request();
        let built = request.set(function, address, word);
        if !request.is_read() {
            self.write_address = address;
        }
        built
    }

    /// Starts the request that was built. `built` is the status of building it; if it is an
    /// error, nothing is sent.
    fn start<P: Port, S: Words>(&mut self, line: &mut Line<P, S>, built: Status) -> Status {
        self.transmit_bits = 0;
        self.response_index = 0;
        self.exception = 0;
        self.status = built;
        if built == Status::OK {
            let request = line.request();
            let is_read = request.is_read();
            let words = request.sends().div_ceil(2);
            if is_read {
                self.response_words = 0;
            }
            self.status = if words > line.storage.transmit_words() {
                Status::ILLEGAL_DATA_VALUE
            } else if self.unit == BROADCAST && is_read && !line.is_lenient() {
                Status::BROADCAST_NOT_ALLOWED
            } else {
                line.start_any(self.unit)
            };
        }
        self.status
    }

    /// 05: switches one coil off if `on` is 0, otherwise on.
    pub fn write_single_coil<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        address: u16,
        on: u16,
    ) -> Status {
        let value = coil_value(on != 0);
        let function = FunctionSpec::WRITE_SINGLE_COIL.short();
        self.request(line, address, value, function)
    }

    /// 06: writes one register. The value also becomes transmit word 0.
    pub fn write_single_register<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        address: u16,
        value: u16,
    ) -> Status {
        let function = FunctionSpec::WRITE_SINGLE_REGISTER.short();
        let built = self.build(line, address, value, function);
        if built == Status::OK {
            set_word(line.storage.transmit(), 0, value);
        }
        self.start(line, built)
    }

    /// 0F: writes the queued bits to the last write address.
    pub fn write_queued_coils<P: Port, S: Words>(&mut self, line: &mut Line<P, S>) -> Status {
        let function = FunctionSpec::WRITE_MULTIPLE_COILS.short();
        self.request(line, self.write_address, self.transmit_bits, function)
    }

    /// 10: writes the queued words to the last write address. A word begun by
    /// [`Node::send_bit`] and not complete is not written.
    pub fn write_queued_registers<P: Port, S: Words>(&mut self, line: &mut Line<P, S>) -> Status {
        let function = FunctionSpec::WRITE_MULTIPLE_REGISTERS.short();
        self.request(line, self.write_address, self.transmit_bits >> 4, function)
    }

    /// 16: sets a register to `(register & and_mask) | (or_mask & !and_mask)`.
    /// The masks also become transmit words 0 and 1.
    pub fn mask_write_register<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        address: u16,
        and_mask: u16,
        or_mask: u16,
    ) -> Status {
        let function = FunctionSpec::MASK_WRITE_REGISTER.short();
        let built = self.build(line, address, and_mask, function);
        if built == Status::OK {
            set_word(line.storage.transmit(), 0, and_mask);
            set_word(line.storage.transmit(), 1, or_mask);
            line.request().append_word(or_mask);
        }
        self.start(line, built)
    }

    /// 17: writes 1 to 121 registers from the transmit words, then reads 1 to
    /// 125 into the response words.
    pub fn read_write_multiple_registers<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        read: (u16, u16),
        write: (u16, u16),
    ) -> Status {
        let function = FunctionSpec::READ_WRITE_REGISTERS.short();
        let mut built = self.build(line, read.0, read.1, function);
        self.write_address = write.0;
        // A fault of the write is reported before one of the read.
        match line.request().append_write(write.0, write.1) {
            Status::OK => {}
            refused => built = refused,
        }
        self.start(line, built)
    }

    /// 17: writes the queued words to the last write address, then reads 1 to 125 registers
    /// into the response words. A word begun by [`Node::send_bit`] and not complete is not
    /// written.
    pub fn read_write_queued_registers<P: Port, S: Words>(
        &mut self,
        line: &mut Line<P, S>,
        read: (u16, u16),
    ) -> Status {
        let write = (self.write_address, self.transmit_bits >> 4);
        self.read_write_multiple_registers(line, read, write)
    }

    /// Sets the write address and empties the queue. The transmit words do not change.
    pub fn begin_transmission(&mut self, address: u16) {
        self.write_address = address;
        self.transmit_bits = 0;
    }

    /// Queues a word in the transmit words, after a word that [`Node::send_bit`] has begun.
    /// Returns false, and queues nothing, if there are too few words.
    pub fn send(&mut self, words: &mut [u16], word: u16) -> bool {
        let index = self.transmit_bits.div_ceil(16);
        let fits = set_word(words, usize::from(index), word);
        if fits {
            self.transmit_bits = (index + 1) << 4;
        }
        fits
    }

    /// Queues the two words of a number, the low one first: see [`Node::send`]. Returns false, and
    /// queues nothing, if there are too few words for both.
    pub fn send32(&mut self, words: &mut [u16], value: u32) -> bool {
        let index = usize::from(self.transmit_bits.div_ceil(16));
        words.len() >= index + 2
            && self.send(words, value as u16)
            && self.send(words, (value >> 16) as u16)
    }

    /// Queues a bit in the transmit words. The first bit of a word is the least significant.
    /// Returns false, and queues nothing, if there are too few words.
    pub fn send_bit(&mut self, words: &mut [u16], on: bool) -> bool {
        let index = usize::from(self.transmit_bits >> 4);
        let mask = 1 << (self.transmit_bits & 15);
        let Some(word) = words.get_mut(index) else {
            return false;
        };
        if mask == 1 {
            *word = 0;
        }
        if on {
            *word |= mask;
        }
        self.transmit_bits += 1;
        true
    }

    /// Number of words of the last successful read that [`Node::receive`] has not returned
    /// yet.
    pub fn available(&self) -> u8 {
        self.response_words.saturating_sub(self.response_index)
    }

    /// Returns the next of the response words; 0xFFFF after the last word.
    pub fn receive(&mut self, words: &[u16]) -> u16 {
        if self.available() == 0 {
            return NO_WORD;
        }
        let received = word(words, usize::from(self.response_index));
        self.response_index += 1;
        received
    }
}

/// The word at `index`; 0xFFFF past the end.
pub fn word(words: &[u16], index: usize) -> u16 {
    words.get(index).copied().unwrap_or(NO_WORD)
}

/// Sets the word at `index`. Returns false past the end.
pub fn set_word(words: &mut [u16], index: usize, value: u16) -> bool {
    match words.get_mut(index) {
        Some(word) => {
            *word = value;
            true
        }
        None => false,
    }
}
