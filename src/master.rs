//! A master of one line with one node, for programs in Rust: the functions of the Arduino
//! library ModbusMaster. Each function starts a request; `poll` advances it to its end.

use crate::engine::{Settings, Words};
use crate::error::Status;
use crate::node::{set_word, word, Line, Node};
use crate::pdu::functions::FunctionSpec;
use crate::port::Port;

/// A line with one node, its port and its buffers.
#[derive(Clone, Hash, Debug)]
pub struct Master<P, S: Words> {
    node: Node,
    line: Line<P, S>,
}

impl<P, S: Words> Master<P, S> {
    /// The port.
    pub fn port(&mut self) -> &mut P {
        &mut self.line.port
    }

    /// The buffers.
    pub fn storage(&mut self) -> &mut S {
        &mut self.line.storage
    }

    /// Timeouts, retries and other settings of requests.
    pub fn settings(&mut self) -> &mut Settings {
        &mut self.line.settings
    }

    /// Sets the unit for later requests; 0 means broadcast.
    pub fn set_slave(&mut self, slave: u8) {
        self.node.set_unit(slave);
    }

    /// The unit for requests.
    pub fn slave(&self) -> u8 {
        self.node.unit()
    }

    /// See [`crate::engine::Engine::rebase`].
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        self.line.rebase(now, longest);
    }

    /// The status of the last request; [`Status::PENDING`] while it is in progress.
    pub fn status(&self) -> Status {
        self.node.status()
    }

    /// The exception code of the last reply as received; 0 if it was no exception.
    pub fn exception_code(&self) -> u8 {
        self.node.exception_code()
    }

    /// True if the last poll found nothing to do and the driver is off.
    pub fn is_waiting(&self) -> bool {
        self.line.is_waiting()
    }

    /// True while a request is in progress.
    pub fn is_pending(&self) -> bool {
        self.line.is_pending()
    }
}

/// Functions that make a request of the node, if the line is ready.
macro_rules! requests {
    ($($(#[$doc:meta])* fn $name:ident($($argument:ident),*) => $call:expr;)*) => {$(
        $(#[$doc])*
        pub fn $name(&mut self, $($argument: u16),*) -> Status {
            match self.line.ready() {
                Status::OK => $call(&mut self.node, &mut self.line),
                Status::BUSY => Status::BUSY,
                refused => {
                    self.node.end(refused);
                    refused
                }
            }
        }
    )*};
}

/// A request with an address and a quantity or value.
macro_rules! request {
    ($spec:ident, $address:ident, $word:ident) => {
        |node: &mut Node, line: &mut Line<P, S>| {
            node.request(line, $address, $word, FunctionSpec::$spec.short())
        }
    };
}

impl<P: Port, S: Words> Master<P, S> {
    /// A master that sends requests to the unit `slave` through `port`.
    pub const fn new(slave: u8, port: P, storage: S) -> Self {
        Master {
            node: Node::new(slave),
            line: Line::new(port, storage),
        }
    }

    /// Changes to the unit `slave`, and to the port that the function `port` sets up. Settings,
    /// buffers and their words do not change. A request in progress is cancelled, as by
    /// [`Master::cancel`].
    pub fn begin(&mut self, slave: u8, port: impl FnOnce(&mut P)) {
        self.cancel();
        self.node.begin(slave);
        port(&mut self.line.port);
    }

    /// Sets whether a reply that deviates from the standard is accepted if no right reply
    /// comes, and whether reads are sent to unit 0: see
    /// [`crate::engine::Engine::lenient`].
    pub fn set_lenient(&mut self, on: bool) {
        self.line.set_observer(Line::<P, S>::lenient(on));
    }

    /// Cancels the request in progress, if there is one. Its status becomes
    /// [`Status::CANCELLED`].
    pub fn cancel(&mut self) {
        if self.node.is_pending() {
            self.line.cancel();
            self.node.end(Status::CANCELLED);
        }
    }

    /// Advances the request in progress, without waiting. Returns [`Status::PENDING`] until
    /// the request has ended, then its status.
    pub fn poll(&mut self) -> Status {
        if !self.node.is_pending() {
            return self.status();
        }
        let now = self.line.port.micros();
        let status = self.line.poll(now);
        self.node.take(status, &mut self.line)
    }

    /// Time in microseconds until poll has something to do, if no byte arrives before;
    /// `u32::MAX` if there is no request.
    pub fn poll_delay(&mut self) -> u32 {
        let now = self.line.port.micros();
        self.line.poll_delay(now)
    }

    requests! {
        /// 01: reads 1 to 2000 coils into the response words.
        fn read_coils(address, quantity) => request!(READ_COILS, address, quantity);
        /// 02: reads 1 to 2000 discrete inputs into the response words.
        fn read_discrete_inputs(address, quantity)
            => request!(READ_DISCRETE_INPUTS, address, quantity);
        /// 03: reads 1 to 125 holding registers into the response words.
        fn read_holding_registers(address, quantity)
            => request!(READ_HOLDING_REGISTERS, address, quantity);
        /// 04: reads 1 to 125 input registers into the response words.
        fn read_input_registers(address, quantity)
            => request!(READ_INPUT_REGISTERS, address, quantity);
        /// 05: switches one coil off if `on` is 0, otherwise on.
        fn write_single_coil(address, on)
            => |node: &mut Node, line| node.write_single_coil(line, address, on);
        /// 06: writes one register. The value also becomes transmit word 0.
        fn write_single_register(address, value)
            => |node: &mut Node, line| node.write_single_register(line, address, value);
        /// 0F: writes 1 to 1968 coils from the transmit words, lowest bit first.
        fn write_multiple_coils(address, quantity)
            => request!(WRITE_MULTIPLE_COILS, address, quantity);
        /// 0F: writes the queued bits to the last write address.
        fn write_queued_coils() => Node::write_queued_coils;
        /// 10: writes 1 to 123 registers from the transmit words.
        fn write_multiple_registers(address, quantity)
            => request!(WRITE_MULTIPLE_REGISTERS, address, quantity);
        /// 10: writes the queued words to the last write address. A word begun by
        /// [`Master::send_bit`] and not complete is not written.
        fn write_queued_registers() => Node::write_queued_registers;
        /// 16: sets a register to `(register & and_mask) | (or_mask & !and_mask)`.
        /// The masks also become transmit words 0 and 1.
        fn mask_write_register(address, and_mask, or_mask)
            => |node: &mut Node, line| node.mask_write_register(line, address, and_mask, or_mask);
        /// 17: writes 1 to 121 registers from the transmit words, then reads 1 to
        /// 125 into the response words.
        fn read_write_multiple_registers(read_address, read_quantity, write_address, write_quantity)
            => |node: &mut Node, line| {
                let (read, write) = ((read_address, read_quantity), (write_address, write_quantity));
                node.read_write_multiple_registers(line, read, write)
            };
        /// 17: writes the queued words to the last write address, then reads 1 to 125
        /// registers into the response words. A word begun by [`Master::send_bit`] and not
        /// complete is not written.
        fn read_write_queued_registers(address, quantity)
            => |node: &mut Node, line| node.read_write_queued_registers(line, (address, quantity));
    }

    /// The response word at `index`; 0xFFFF past the end of the buffer.
    pub fn response_word(&mut self, index: usize) -> u16 {
        word(self.line.storage.response(), index)
    }

    /// Sets the transmit word at `index`. Returns false past the end of the buffer.
    pub fn set_transmit_word(&mut self, index: usize, value: u16) -> bool {
        set_word(self.line.storage.transmit(), index, value)
    }

    /// Sets the write address and empties the queue. The transmit words do not change.
    pub fn begin_transmission(&mut self, address: u16) {
        self.node.begin_transmission(address);
    }

    /// Queues a word, after a word that [`Master::send_bit`] has begun. Returns false, and
    /// queues nothing, if the buffer is full.
    pub fn send(&mut self, word: u16) -> bool {
        self.node.send(self.line.storage.transmit(), word)
    }

    /// Queues a bit. The first bit of a word is the least significant. Returns false, and
    /// queues nothing, if the buffer is full.
    pub fn send_bit(&mut self, on: bool) -> bool {
        self.node.send_bit(self.line.storage.transmit(), on)
    }

    /// Number of words of the last successful read that [`Master::receive`] has not returned
    /// yet.
    pub fn available(&self) -> u8 {
        self.node.available()
    }

    /// Returns the next word of the last successful read; 0xFFFF after the last word.
    pub fn receive(&mut self) -> u16 {
        self.node.receive(self.line.storage.response())
    }
}
