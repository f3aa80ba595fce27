//! A master of one serial line, for programs in Rust: the ten functions of the Arduino library
//! ModbusMaster. [`Master::read_holding_registers`] and the like wait for the end of a request;
//! [`Master::start_read_holding_registers`] and the like start one, and [`Master::poll`] advances it
//! to its end.

#[cfg(feature = "embedded-io-async")]
mod asynchronous;
mod calls;
mod lenient;
// For the C API; it may change in any version.
#[doc(hidden)]
pub mod node;
// For the C API; it may change in any version.
#[doc(hidden)]
pub mod request;

#[cfg(feature = "embedded-io-async")]
pub use self::asynchronous::AsyncMaster;

use crate::bytes::copy;
pub use crate::engine::{
    Buffers, Count, Counter, MicrosSetting, Settings, Storage, Words, COUNTERS,
};
use crate::error::{Error, Status};
use crate::pdu::functions::FunctionSpec;
use crate::pdu::{quantity, MAX_READ_BITS, MAX_READ_REGISTERS};
use crate::port::Port;
use calls::{calls, example};
use core::task::Poll;
use node::Node;
use request::Line;

/// A serial line with one node, its port and its buffers.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// use mbm::master::{Buffers, Master};
/// use mbm::Status;
///
/// let mut master = Master::new(17, rtu(), Buffers::new([0; 64], [0; 20], [0; 20]));
/// master.settings().set_baud_rate(19200);
/// let [flow, total] = master.holding_registers(107)?;
/// assert_eq!((master.response(), master.status()), (&[555, 100][..], Status::OK));
///
/// // Without waiting: other work is done meanwhile, or the program sleeps.
/// master.start_read_coils(0, 2)?;
/// while master.is_pending() {
///     let _ = master.poll();
///     let sleep = master.poll_delay();
///     if master.is_waiting() { /* It may sleep so long. */ }
/// }
/// assert!(master.response_bits().eq([true, false]));
///
/// master.set_unit(18);
/// assert_eq!((master.unit(), master.exception_code()), (18, 0));
/// master.set_lenient(true);
/// master.port().is_silent = true;
/// assert_eq!(master.holding_registers::<2>(107), Err(mbm::Error::ResponseTimedOut));
/// assert_eq!(master.storage().counters[0], 3);
/// # Ok(())
/// # }
/// ```
///
/// A quantity that is known when the program is compiled, and that the standard does not allow, does
/// not compile:
///
/// ```compile_fail
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
/// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
/// let words: [u16; 126] = master.holding_registers(0)?; // 125 is the most.
/// # Ok(())
/// # }
/// ```
///
/// ```compile_fail
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
/// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
/// let coils: [bool; 0] = master.coils(0)?; // 1 is the least.
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Hash, Debug)]
pub struct Master<P, S: Words> {
    node: Node,
    line: Line<P, S>,
    /// How many bits the last successful read has stored in the response words.
    bits: u16,
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
    pub fn set_unit(&mut self, unit: u8) {
        self.node.set_unit(unit);
    }

    /// The unit for requests.
    pub fn unit(&self) -> u8 {
        self.node.unit()
    }

    /// See [`crate::engine::Engine::rebase`].
    // For model checkers.
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        self.line.rebase(now, longest);
    }

    /// The line of the master. For model checkers.
    // For model checkers.
    #[doc(hidden)]
    pub fn line(&mut self) -> &mut Line<P, S> {
        &mut self.line
    }

    /// The status of the last request; [`Status::PENDING`] while it is pending.
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

    /// True while a request is pending.
    pub fn is_pending(&self) -> bool {
        self.line.is_pending()
    }

    /// The words of the last successful read. After a read of coils or discrete inputs, each has
    /// 16 of them, the first in the lowest bit.
    pub fn response(&self) -> &[u16] {
        let words = self.line.storage.response();
        let count = usize::from(self.node.available());
        words.get(..count).unwrap_or_default()
    }

    /// Copies the words that were read. A device of which a lenient master takes fewer has not answered.
    fn take_words(&self, registers: &mut [u16]) -> Result<(), Error> {
        if self.response().len() < registers.len() {
            return Err(Error::MalformedReply);
        }
        copy(registers, self.response());
        Ok(())
    }

    /// As [`Master::take_words`], for bits.
    fn take_bits(&self, bits: &mut [bool]) -> Result<(), Error> {
        if self.response_bits().count() < bits.len() {
            return Err(Error::MalformedReply);
        }
        for (place, bit) in bits.iter_mut().zip(self.response_bits()) {
            *place = bit;
        }
        Ok(())
    }

    /// The coils or discrete inputs of the last successful read.
    pub fn response_bits(&self) -> impl Iterator<Item = bool> + '_ {
        let words = self.response().iter();
        words
            .flat_map(|word| (0..16).map(move |bit| word >> bit & 1 != 0))
            .take(self.bits.into())
    }
}

/// Functions that make a request of the node, if the line is ready.
macro_rules! requests {
    ($($(#[$doc:meta])* fn $name:ident($($argument:ident: $type:ty),*) => $call:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Errors
        /// As [`Master::start_read_coils`].
        pub fn $name(&mut self, $($argument: $type),*) -> Result<(), Error> {
            self.start($call)
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
    /// A master that sends requests to `unit` through `port`.
    pub const fn new(unit: u8, port: P, storage: S) -> Self {
        Master {
            node: Node::new(unit),
            line: Line::new(port, storage),
            bits: 0,
        }
    }

    /// Sets whether a reply that deviates from the standard is accepted if no right reply has
    /// arrived within the response timeout, and whether reads are sent to unit 0. A deviating reply
    /// has the right unit, function and CRC, and repeats another address, value or quantity, or has
    /// more or fewer data than were requested. Call it only while no request is pending.
    pub fn set_lenient(&mut self, on: bool) {
        self.line.set_lenience(Line::<P, S>::lenient(on));
    }

    /// Cancels the pending request, if there is one. Its status becomes
    /// [`Status::CANCELLED`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
    /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
    /// master.start_read_holding_registers(107, 2)?;
    /// master.cancel();
    /// assert_eq!(master.status(), mbm::Status::CANCELLED);
    /// # Ok(())
    /// # }
    /// ```
    pub fn cancel(&mut self) {
        if self.node.is_pending() {
            self.line.cancel();
            self.node.end(Status::CANCELLED);
        }
    }

    /// Advances the pending request, without waiting. Returns [`Poll::Pending`] until
    /// the request has ended, then its result.
    pub fn poll(&mut self) -> Poll<Result<(), Error>> {
        if self.node.is_pending() {
            let now = self.line.port.micros();
            let status = self.line.poll(now);
            if self.node.take(status, &mut self.line) == Status::OK {
                self.note_bits();
            }
        }
        self.status().poll()
    }

    fn note_bits(&mut self) {
        let request = self.line.request();
        if request.is_read() {
            self.bits = request.bits();
        }
    }

    /// Polls until the pending request has ended, and calls `idle` between the polls.
    ///
    /// # Errors
    /// The error with which the request has ended.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
    /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
    /// master.start_read_holding_registers(107, 2)?;
    /// master.wait(|| { /* The watchdog is fed here. */ })?;
    /// assert_eq!(master.response(), [555, 100]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn wait(&mut self, mut idle: impl FnMut()) -> Result<(), Error> {
        loop {
            if let Poll::Ready(result) = self.poll() {
                return result;
            }
            idle();
        }
    }

    /// Time in microseconds until poll has something to do, if no byte arrives before;
    /// `u32::MAX` if there is no request.
    pub fn poll_delay(&mut self) -> u32 {
        let now = self.line.port.micros();
        self.line.poll_delay(now)
    }

    /// Makes a request, and waits until it has ended. Between two polls the port may sleep.
    fn request(&mut self, start: impl FnOnce(&mut Self) -> Result<(), Error>) -> Result<(), Error> {
        start(self)?;
        loop {
            if let Poll::Ready(result) = self.poll() {
                return result;
            }
            if self.is_waiting() {
                let delay = self.poll_delay();
                self.line.port.idle(delay);
            }
        }
    }

    calls! { ; }

    /// Starts the request that `start` makes, if the line is ready.
    fn start(
        &mut self,
        start: impl FnOnce(&mut Node, &mut Line<P, S>) -> Status,
    ) -> Result<(), Error> {
        let status = match self.line.ready() {
            Status::OK => start(&mut self.node, &mut self.line),
            Status::BUSY => Status::BUSY,
            refused => {
                self.node.end(refused);
                refused
            }
        };
        match status {
            Status::PENDING => Ok(()),
            refused => Err(Error::refused(refused)),
        }
    }

    /// 01: starts a request that reads 1 to 2000 coils into the response words.
    ///
    /// # Errors
    /// Nothing is sent then: [`Error::Busy`] while a request is pending;
    /// [`Error::InvalidQuantity`] for a quantity that the standard or the buffers do not
    /// allow; [`Error::InvalidAddress`] for addresses beyond 65535;
    /// [`Error::BufferTooSmall`]; [`Error::BroadcastNotAllowed`];
    /// [`Error::NotInitialised`] if the port or the frame buffer cannot be used.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
    /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
    /// master.start_read_coils(0, 2)?;
    /// while master.poll().is_pending() { /* Other work is done here. */ }
    /// assert!(master.response_bits().eq([true, false]));
    /// # Ok(())
    /// # }
    /// ```
    pub fn start_read_coils(&mut self, address: u16, quantity: u16) -> Result<(), Error> {
        self.start(request!(READ_COILS, address, quantity))
    }

    requests! {
        /// 02: starts a request that reads 1 to 2000 discrete inputs into the response words.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_read_discrete_inputs(0, 2)?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// assert!(master.response_bits().eq([false, true]));
        /// # Ok(())
        /// # }
        /// ```
        fn start_read_discrete_inputs(address: u16, quantity: u16)
            => request!(READ_DISCRETE_INPUTS, address, quantity);
        /// 03: starts a request that reads 1 to 125 holding registers into the response words.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_read_holding_registers(107, 2)?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// assert_eq!(master.response(), [555, 100]);
        /// # Ok(())
        /// # }
        /// ```
        fn start_read_holding_registers(address: u16, quantity: u16)
            => request!(READ_HOLDING_REGISTERS, address, quantity);
        /// 04: starts a request that reads 1 to 125 input registers into the response words.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_read_input_registers(0, 2)?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// assert_eq!(master.response(), [21, 22]);
        /// # Ok(())
        /// # }
        /// ```
        fn start_read_input_registers(address: u16, quantity: u16)
            => request!(READ_INPUT_REGISTERS, address, quantity);
        /// 05: starts a request that switches one coil.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_write_single_coil(1, true)?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// # assert!(master.port().units.device.values.coils.cells[1]);
        /// # Ok(())
        /// # }
        /// ```
        fn start_write_single_coil(address: u16, on: bool)
            => |node: &mut Node, line| node.write_single_coil(line, address, on.into());
        /// 06: starts a request that writes one register.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_write_single_register(107, 888)?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// # assert_eq!(master.port().units.device.values.holding_registers.cells[0], 888);
        /// # Ok(())
        /// # }
        /// ```
        fn start_write_single_register(address: u16, value: u16)
            => |node: &mut Node, line| node.write_single_register(line, address, value);
        /// 0F: starts a request that writes 1 to 1968 coils.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_write_multiple_coils(0, &[false, true])?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// # assert_eq!(master.port().units.device.values.coils.cells, [false, true]);
        /// # Ok(())
        /// # }
        /// ```
        fn start_write_multiple_coils(address: u16, coils: &[bool])
            => |node: &mut Node, line| {
                let quantity = put_bits(line, coils);
                node.request(line, address, quantity, FunctionSpec::WRITE_MULTIPLE_COILS.short())
            };
        /// 10: starts a request that writes 1 to 123 registers.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_write_multiple_registers(109, &[7, 8])?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// # assert_eq!(master.port().units.device.values.holding_registers.cells[2..], [7, 8]);
        /// # Ok(())
        /// # }
        /// ```
        fn start_write_multiple_registers(address: u16, words: &[u16])
            => |node: &mut Node, line| {
                let quantity = put_words(line, words);
                let function = FunctionSpec::WRITE_MULTIPLE_REGISTERS.short();
                node.request(line, address, quantity, function)
            };
        /// 16: starts a request that sets a register to
        /// `(register & and_mask) | (or_mask & !and_mask)`.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// // Sets bit 2, and leaves the others.
        /// master.start_mask_write_register(107, 0xFFFB, 0x0004)?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// # assert_eq!(master.port().units.device.values.holding_registers.cells[0], 559);
        /// # Ok(())
        /// # }
        /// ```
        fn start_mask_write_register(address: u16, and_mask: u16, or_mask: u16)
            => |node: &mut Node, line| node.mask_write_register(line, address, and_mask, or_mask);
        /// 17: starts a request that writes 1 to 121 registers, then reads 1 to 125 into the response
        /// words.
        ///
        /// ```
        /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
        /// # fn main() -> Result<(), mbm::Error> {
        /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
        /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
        /// master.start_read_write_multiple_registers(107, 4, 109, &[7, 8])?;
        /// while master.poll().is_pending() { /* Other work is done here. */ }
        /// assert_eq!(master.response(), [555, 100, 7, 8]);
        /// # Ok(())
        /// # }
        /// ```
        fn start_read_write_multiple_registers(
            read_address: u16, read_quantity: u16, write_address: u16, words: &[u16]
        ) => |node: &mut Node, line| {
            let write = (write_address, put_words(line, words));
            node.read_write_multiple_registers(line, (read_address, read_quantity), write)
        };
    }
}

/// Copies words into the transmit words, and returns their number. A request refuses a number that
/// they cannot hold.
fn put_words<P, S: Words>(line: &mut Line<P, S>, words: &[u16]) -> u16 {
    copy(line.storage.transmit(), words);
    quantity(words.len())
}

/// As [`put_words`], for bits.
fn put_bits<P, S: Words>(line: &mut Line<P, S>, bits: &[bool]) -> u16 {
    for (place, bits) in line.storage.transmit().iter_mut().zip(bits.chunks(16)) {
        *place = bits
            .iter()
            .rev()
            .fold(0, |word, on| word << 1 | u16::from(*on));
    }
    quantity(bits.len())
}
