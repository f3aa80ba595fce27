//! A master with the interface of the Arduino library ModbusMaster: transmit words, ten
//! functions, response words. Each function starts a request; `poll` advances it to its end.

use crate::engine::{Engine, Settings, Words, BROADCAST};
use crate::error::Status;
use crate::pdu::bits;
use crate::pdu::function_spec::FunctionSpec;
use crate::pdu::master_request::{MasterRequest, MasterSpec};
use crate::port::Port;

/// The value returned for a word that does not exist.
pub const NO_WORD: u16 = 0xFFFF;

/// A master on a serial line, with its port and its buffers.
// Small fields first: see `Engine`.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct Master<P, S: Words> {
    response_words: u8,
    response_index: u8,
    slave: u8,
    status: Status,
    engine: Engine<P, S, MasterRequest>,
    /// The address to which the write functions without an address argument write.
    write_address: u16,
    /// Number of bits queued in the transmit words; a queued word counts as 16.
    transmit_bits: u16,
}

impl<P, S: Words> Master<P, S> {
    /// A master that sends requests to the unit `slave` through `port`.
    pub const fn new(slave: u8, port: P, storage: S) -> Self {
        Master {
            engine: Engine::new(port, storage),
            write_address: 0,
            transmit_bits: 0,
            response_words: 0,
            response_index: 0,
            slave,
            status: Status::OK,
        }
    }

    /// The port.
    pub fn port(&mut self) -> &mut P {
        &mut self.engine.port
    }

    /// The buffers.
    pub fn storage(&mut self) -> &mut S {
        &mut self.engine.storage
    }

    /// Timeouts, retries and other settings of requests.
    pub fn settings(&mut self) -> &mut Settings {
        &mut self.engine.settings
    }

    /// Sets the unit for later requests; 0 means broadcast.
    pub fn set_slave(&mut self, slave: u8) {
        self.slave = slave;
    }

    /// The unit for requests.
    pub fn slave(&self) -> u8 {
        self.slave
    }

    /// Derives gap, silence and character time from the baud rate.
    pub fn set_baud_rate(&mut self, baud: u32) {
        self.settings().set_baud_rate(baud);
    }

    /// See [`Engine::rebase`].
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        self.engine.rebase(now, longest);
    }

    /// The status of the last request; [`Status::PENDING`] while it is in progress.
    pub fn status(&self) -> Status {
        self.status
    }

    /// The exception code of the last reply as received; 0 if it was no exception.
    pub fn exception_code(&self) -> u8 {
        self.engine.exception_code()
    }

    /// True if the last poll found nothing to do and the driver is off.
    pub fn is_waiting(&self) -> bool {
        self.engine.is_waiting()
    }

    /// True while a request is in progress.
    pub fn is_pending(&self) -> bool {
        self.engine.is_pending()
    }
}

impl<P: Port, S: Words> Master<P, S> {
    /// Changes to the unit `slave`, and to the port that the function `port` sets up. Settings,
    /// buffers and their words do not change. A request in progress is cancelled, as by
    /// [`Master::cancel`].
    pub fn begin(&mut self, slave: u8, port: impl FnOnce(&mut P)) {
        self.cancel();
        self.slave = slave;
        port(&mut self.engine.port);
        self.transmit_bits = 0;
    }

    /// Sets whether a reply that deviates from the standard is accepted if no right reply
    /// comes, and whether reads are sent to unit 0: see [`Engine::set_lenient`].
    pub fn set_lenient(&mut self, on: bool) {
        self.engine.set_lenient(on);
    }

    /// Counts from now on. A new master counts; zeroed memory does not.
    pub fn set_counting(&mut self) {
        self.engine.set_counting();
    }

    /// Whether a reply that deviates from the standard is accepted.
    pub fn is_lenient(&self) -> bool {
        self.engine.is_lenient()
    }

    /// Cancels the request in progress, if there is one. Its status becomes
    /// [`Status::CANCELLED`].
    pub fn cancel(&mut self) {
        if self.engine.is_pending() {
            self.engine.cancel();
            self.status = Status::CANCELLED;
        }
    }

    /// Reports that another device has just used the line. The silence before the next
    /// request is measured from now.
    pub fn line_used(&mut self) {
        if self.engine.port.is_ready() {
            self.engine.line_used();
        }
    }

    /// Reports that another device used the line at `time`, in microseconds of the port's
    /// clock.
    pub fn line_used_at(&mut self, time: u32) {
        self.engine.line_used_at(time);
    }

    /// Time of the last known use of the line, in microseconds of the port's clock.
    pub fn last_use(&self) -> u32 {
        self.engine.last_use()
    }

    /// Advances the request in progress, without waiting. Returns [`Status::PENDING`] until
    /// the request has ended, then its status.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll(&mut self) -> Status {
        if self.engine.is_pending() {
            let now = self.engine.port.micros();
            self.status = match self.engine.poll(now) {
                Status::OK if self.engine.request().is_read() => self.store_words(),
                status => status,
            };
        }
        self.status
    }

    /// Time in microseconds until poll has something to do, if no byte arrives before;
    /// `u32::MAX` if there is no request.
    pub fn poll_delay(&mut self) -> u32 {
        if !self.is_pending() {
            return u32::MAX;
        }
        let now = self.engine.port.micros();
        self.engine.poll_delay(now)
    }

    /// Copies the data of a successful reply to the response words.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn store_words(&mut self) -> Status {
        if !self.engine.store_words() {
            return Status::BUFFER_TOO_SMALL;
        }
        self.response_words = self.engine.response_words();
        Status::OK
    }

    /// [`Status::OK`] if a request may be built, otherwise the error.
    #[inline(always)]
    fn check_ready(&self) -> Status {
        if self.is_pending() {
            return Status::BUSY;
        }
        if self.engine.port.is_ready() && self.engine.storage.capacity() > 0 {
            return Status::OK;
        }
        Status::NOT_INITIALISED
    }

    /// Starts the request of the function `spec`, with an address and a quantity or value
    /// `word`. If it returns an error, nothing is sent. The address of a write becomes the
    /// write address.
    #[inline(always)]
    pub fn request(&mut self, address: u16, word: u16, spec: MasterSpec) -> Status {
        let built = self.build(address, word, spec);
        self.start(built)
    }

    /// Builds the request of the function `spec`. [`Master::start`] starts it.
    #[cfg_attr(target_os = "none", inline(never))]
    fn build(&mut self, address: u16, word: u16, spec: MasterSpec) -> Status {
        let ready = self.check_ready();
        if ready != Status::OK {
            return ready;
        }
        let request = self.engine.request();
        let built = request.set(spec, address, word);
        if !request.is_read() {
            self.write_address = address;
        }
        built
    }

    /// Starts the request that was built. `built` is the status of building it; if it is an
    /// error, nothing is sent.
    #[cfg_attr(target_os = "none", inline(never))]
    fn start(&mut self, built: Status) -> Status {
        if built == Status::BUSY {
            return built;
        }
        self.transmit_bits = 0;
        self.response_index = 0;
        self.engine.clear_outcome();
        self.status = built;
        if built == Status::OK {
            let request = self.engine.request();
            let is_read = request.is_read();
            let words = request.sends().div_ceil(2);
            if is_read {
                self.response_words = 0;
            }
            self.status = if words > self.engine.storage.transmit_words() {
                Status::ILLEGAL_DATA_VALUE
            } else if self.slave == BROADCAST && is_read && !self.is_lenient() {
                Status::BROADCAST_NOT_ALLOWED
            } else {
                self.engine.start_any(self.slave)
            };
        }
        self.status
    }

    /// 01: reads 1 to 2000 coils into the response words.
    pub fn read_coils(&mut self, address: u16, quantity: u16) -> Status {
        self.request(address, quantity, MasterSpec::new(FunctionSpec::READ_COILS))
    }

    /// 02: reads 1 to 2000 discrete inputs into the response words.
    pub fn read_discrete_inputs(&mut self, address: u16, quantity: u16) -> Status {
        self.request(
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_DISCRETE_INPUTS),
        )
    }

    /// 03: reads 1 to 125 holding registers into the response words.
    pub fn read_holding_registers(&mut self, address: u16, quantity: u16) -> Status {
        self.request(
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_HOLDING_REGISTERS),
        )
    }

    /// 04: reads 1 to 125 input registers into the response words.
    pub fn read_input_registers(&mut self, address: u16, quantity: u16) -> Status {
        self.request(
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_INPUT_REGISTERS),
        )
    }

    /// 05: switches one coil off if `on` is 0, otherwise on.
    pub fn write_single_coil(&mut self, address: u16, on: u16) -> Status {
        let value = if on == 0 { 0 } else { bits::ON };
        self.request(
            address,
            value,
            MasterSpec::new(FunctionSpec::WRITE_SINGLE_COIL),
        )
    }

    /// 06: writes one register. The value also becomes transmit word 0.
    pub fn write_single_register(&mut self, address: u16, value: u16) -> Status {
        let spec = MasterSpec::new(FunctionSpec::WRITE_SINGLE_REGISTER);
        let built = self.build(address, value, spec);
        if built == Status::OK {
            self.set_transmit_word(0, value);
        }
        self.start(built)
    }

    /// 0F: writes 1 to 1968 coils from the transmit words, lowest bit first.
    pub fn write_multiple_coils(&mut self, address: u16, quantity: u16) -> Status {
        self.request(
            address,
            quantity,
            MasterSpec::new(FunctionSpec::WRITE_MULTIPLE_COILS),
        )
    }

    /// 0F: writes the queued bits to the last write address.
    pub fn write_queued_coils(&mut self) -> Status {
        self.write_multiple_coils(self.write_address, self.transmit_bits)
    }

    /// 10: writes 1 to 123 registers from the transmit words.
    pub fn write_multiple_registers(&mut self, address: u16, quantity: u16) -> Status {
        self.request(
            address,
            quantity,
            MasterSpec::new(FunctionSpec::WRITE_MULTIPLE_REGISTERS),
        )
    }

    /// 10: writes the queued words to the last write address. A word begun by
    /// [`Master::send_bit`] and not complete is not written.
    pub fn write_queued_registers(&mut self) -> Status {
        self.write_multiple_registers(self.write_address, self.transmit_bits >> 4)
    }

    /// 16: sets a register to `(register & and_mask) | (or_mask & !and_mask)`.
    /// The masks also become transmit words 0 and 1.
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        let spec = MasterSpec::new(FunctionSpec::MASK_WRITE_REGISTER);
        let built = self.build(address, and_mask, spec);
        if built == Status::OK {
            self.set_transmit_word(0, and_mask);
            self.set_transmit_word(1, or_mask);
            self.engine.request().append_word(or_mask);
        }
        self.start(built)
    }

    /// 17: writes 1 to 121 registers from the transmit words, then reads 1 to
    /// 125 into the response words.
    pub fn read_write_multiple_registers(
        &mut self,
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
    ) -> Status {
        let spec = MasterSpec::new(FunctionSpec::READ_WRITE_REGISTERS);
        let mut built = self.build(read_address, read_quantity, spec);
        if built != Status::BUSY && built != Status::NOT_INITIALISED {
            self.write_address = write_address;
            let request = self.engine.request();
            // A fault of the write is reported before one of the read.
            match request.append_write(write_address, write_quantity) {
                Status::OK => {}
                refused => built = refused,
            }
        }
        self.start(built)
    }

    /// 17: writes the queued words to the last write address, then reads 1 to 125 registers
    /// into the response words. A word begun by [`Master::send_bit`] and not complete is not
    /// written.
    pub fn read_write_queued_registers(&mut self, read_address: u16, read_quantity: u16) -> Status {
        self.read_write_multiple_registers(
            read_address,
            read_quantity,
            self.write_address,
            self.transmit_bits >> 4,
        )
    }

    /// The response word at `index`; 0xFFFF past the end of the buffer.
    pub fn response_word(&mut self, index: usize) -> u16 {
        let words = self.engine.storage.response();
        words.get(index).copied().unwrap_or(NO_WORD)
    }

    /// Zeroes the response words.
    pub fn clear_response(&mut self) {
        self.engine.storage.response().fill(0);
    }

    /// Sets the transmit word at `index`. Returns false past the end of the buffer.
    pub fn set_transmit_word(&mut self, index: usize, value: u16) -> bool {
        match self.engine.storage.transmit().get_mut(index) {
            Some(word) => {
                *word = value;
                true
            }
            None => false,
        }
    }

    /// Zeroes the transmit words.
    pub fn clear_transmit(&mut self) {
        self.engine.storage.transmit().fill(0);
    }

    /// Sets the write address and empties the queue. The transmit words do not change.
    pub fn begin_transmission(&mut self, address: u16) {
        self.write_address = address;
        self.transmit_bits = 0;
    }

    /// Queues a word, after a word that [`Master::send_bit`] has begun. Returns false, and
    /// queues nothing, if the buffer is full.
    pub fn send(&mut self, word: u16) -> bool {
        let index = self.transmit_bits.div_ceil(16);
        let fits = self.set_transmit_word(usize::from(index), word);
        if fits {
            self.transmit_bits = (index + 1) << 4;
        }
        fits
    }

    /// Queues a bit. The first bit of a word is the least significant. Returns false, and
    /// queues nothing, if the buffer is full.
    pub fn send_bit(&mut self, on: bool) -> bool {
        let index = usize::from(self.transmit_bits >> 4);
        let mask = 1 << (self.transmit_bits & 15);
        let Some(word) = self.engine.storage.transmit().get_mut(index) else {
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

    /// Number of words of the last successful read that [`Master::receive`] has not returned
    /// yet.
    pub fn available(&self) -> u8 {
        self.response_words.saturating_sub(self.response_index)
    }

    /// Returns the next word of the last successful read; 0xFFFF after the last word.
    pub fn receive(&mut self) -> u16 {
        if self.available() == 0 {
            return NO_WORD;
        }
        let word = self.response_word(usize::from(self.response_index));
        self.response_index += 1;
        word
    }
}
