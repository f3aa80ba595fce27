//! Ready-made requests, whose data are slices of the program.

mod functions;

use super::request::{store_bytes, ClientRequest, RequestState};
use crate::data::bits::{byte_of, take_coils};
use crate::data::view::take_words;
use crate::error::{Error, Status};
use crate::pdu::functions::{coil_value, FunctionSpec};
use crate::pdu::quantity;

/// The data that a request sends, or the place for those that it receives.
#[derive(Default, Debug)]
enum Slice<'a> {
    #[default]
    None,
    Registers(&'a mut [u16]),
    Coils(&'a mut [bool]),
    Bytes(&'a mut [u8]),
}

impl Slice<'_> {
    /// How many bytes on the wire it can hold.
    fn capacity(&self) -> u16 {
        let bytes = match self {
            Slice::None => 0,
            Slice::Registers(words) => words.len().saturating_mul(2),
            Slice::Coils(coils) => coils.len().div_ceil(8),
            Slice::Bytes(bytes) => bytes.len(),
        };
        quantity(bytes)
    }

    fn byte(&self, index: usize) -> u8 {
        match self {
            Slice::None => 0,
            Slice::Registers(words) => {
                let [high, low] = words.get(index / 2).copied().unwrap_or(0).to_be_bytes();
                match index.is_multiple_of(2) {
                    true => high,
                    false => low,
                }
            }
            Slice::Coils(coils) => byte_of(coils.chunks(8).nth(index).unwrap_or_default()),
            Slice::Bytes(bytes) => bytes.get(index).copied().unwrap_or(0),
        }
    }

    fn store(&mut self, data: &[u8], mask: u8) {
        match self {
            Slice::None => {}
            Slice::Registers(words) => take_words(words, data),
            Slice::Coils(coils) => take_coils(coils, data),
            Slice::Bytes(bytes) => store_bytes(bytes, data, mask),
        }
    }
}

/// A request with its data in slices. The client returns it when it has ended, and it can be
/// queued again.
///
/// The slices of a request that writes are mutable too, so that the program can change the values
/// before it queues the request again.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
/// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
/// let mut words = [0; 2];
/// let mut request = Request::read_holding_registers(17, 107, &mut words)?;
/// request.state.timeout_ms = 500;
/// # let mut client: Client<_, Request, 4> = Client::new(line);
/// client.queue(request)?;
/// # let request = loop { let now = mbm::port::Port::micros(client.port()); if let Some(request) = client.poll(now) { break request; } };
/// // When the client has returned it:
/// assert_eq!(request.result(), Ok(()));
/// assert_eq!(request.registers(), [555, 100]);
/// client.queue(request)?; // Once more.
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Request<'a> {
    /// The unit, the timeout and the limit of retries, which you may set, and the outcome.
    pub state: RequestState,
    sends: Slice<'a>,
    takes: Slice<'a>,
}

impl<'a> Request<'a> {
    fn build(
        unit: u8,
        sends: Slice<'a>,
        takes: Slice<'a>,
        build: impl FnOnce(&mut RequestState) -> Status,
    ) -> Result<Self, Error> {
        Ok(Request {
            state: RequestState::made(unit, takes.capacity(), build)?,
            sends,
            takes,
        })
    }

    /// A request with two words after the function code, and one slice.
    fn short(
        unit: u8,
        spec: FunctionSpec,
        (first, second): (u16, u16),
        sends: Slice<'a>,
        takes: Slice<'a>,
    ) -> Result<Self, Error> {
        Request::build(unit, sends, takes, |state| state.set(spec, first, second))
    }

    /// 01: reads 1 to 2000 coils, as many as `coils` has.
    ///
    /// # Errors
    /// This and the other constructors return [`Error::InvalidQuantity`] for a quantity that
    /// the standard does not allow; [`Error::InvalidAddress`] for addresses beyond 65535.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut coils = [false; 2];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_coils(17, 0, &mut coils)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_coils(unit: u8, address: u16, coils: &'a mut [bool]) -> Result<Self, Error> {
        let words = (address, quantity(coils.len()));
        let spec = FunctionSpec::READ_COILS;
        Request::short(unit, spec, words, Slice::None, Slice::Coils(coils))
    }

    /// 02: reads 1 to 2000 discrete inputs, as many as `inputs` has.
    ///
    /// # Errors
    /// As [`Request::read_coils`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut inputs = [false; 2];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_discrete_inputs(17, 0, &mut inputs)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_discrete_inputs(
        unit: u8,
        address: u16,
        inputs: &'a mut [bool],
    ) -> Result<Self, Error> {
        let words = (address, quantity(inputs.len()));
        let spec = FunctionSpec::READ_DISCRETE_INPUTS;
        Request::short(unit, spec, words, Slice::None, Slice::Coils(inputs))
    }

    /// 03: reads 1 to 125 holding registers, as many as `registers` has.
    ///
    /// # Errors
    /// As [`Request::read_coils`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut registers = [0; 2];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_holding_registers(17, 107, &mut registers)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_holding_registers(
        unit: u8,
        address: u16,
        registers: &'a mut [u16],
    ) -> Result<Self, Error> {
        let words = (address, quantity(registers.len()));
        let spec = FunctionSpec::READ_HOLDING_REGISTERS;
        Request::short(unit, spec, words, Slice::None, Slice::Registers(registers))
    }

    /// 04: reads 1 to 125 input registers, as many as `registers` has.
    ///
    /// # Errors
    /// As [`Request::read_coils`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut registers = [0; 2];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_input_registers(17, 0, &mut registers)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_input_registers(
        unit: u8,
        address: u16,
        registers: &'a mut [u16],
    ) -> Result<Self, Error> {
        let words = (address, quantity(registers.len()));
        let spec = FunctionSpec::READ_INPUT_REGISTERS;
        Request::short(unit, spec, words, Slice::None, Slice::Registers(registers))
    }

    /// 05: switches one coil.
    ///
    /// # Errors
    /// None: every address is allowed.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_single_coil(17, 0, true)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_single_coil(unit: u8, address: u16, on: bool) -> Result<Self, Error> {
        let words = (address, coil_value(on));
        let spec = FunctionSpec::WRITE_SINGLE_COIL;
        Request::short(unit, spec, words, Slice::None, Slice::None)
    }

    /// 06: writes one register.
    ///
    /// # Errors
    /// None: every address is allowed.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_single_register(17, 107, 888)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_single_register(unit: u8, address: u16, value: u16) -> Result<Self, Error> {
        let spec = FunctionSpec::WRITE_SINGLE_REGISTER;
        Request::short(unit, spec, (address, value), Slice::None, Slice::None)
    }

    /// 0F: writes 1 to 1968 coils.
    ///
    /// # Errors
    /// As [`Request::read_coils`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut coils = [true, false];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_multiple_coils(17, 0, &mut coils)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_multiple_coils(
        unit: u8,
        address: u16,
        coils: &'a mut [bool],
    ) -> Result<Self, Error> {
        let words = (address, quantity(coils.len()));
        let spec = FunctionSpec::WRITE_MULTIPLE_COILS;
        Request::short(unit, spec, words, Slice::Coils(coils), Slice::None)
    }

    /// 10: writes 1 to 123 registers.
    ///
    /// # Errors
    /// As [`Request::read_coils`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut registers = [888, 1];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::write_multiple_registers(17, 107, &mut registers)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn write_multiple_registers(
        unit: u8,
        address: u16,
        registers: &'a mut [u16],
    ) -> Result<Self, Error> {
        let words = (address, quantity(registers.len()));
        let spec = FunctionSpec::WRITE_MULTIPLE_REGISTERS;
        Request::short(unit, spec, words, Slice::Registers(registers), Slice::None)
    }

    /// 16: sets a register to `(register & and_mask) | (or_mask & !and_mask)`.
    ///
    /// # Errors
    /// None: every address is allowed.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// // Sets bit 0, and leaves the others.
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::mask_write_register(17, 107, 0xFFFE, 0x0001)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn mask_write_register(
        unit: u8,
        address: u16,
        and_mask: u16,
        or_mask: u16,
    ) -> Result<Self, Error> {
        Request::build(unit, Slice::None, Slice::None, |state| {
            state.mask_write_register(address, and_mask, or_mask)
        })
    }

    /// 17: writes 1 to 121 registers, then reads 1 to 125.
    ///
    /// # Errors
    /// As [`Request::read_coils`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let (mut read, mut write) = ([0; 2], [7, 8]);
    /// let (read, write) = ((107, &mut read[..]), (109, &mut write[..]));
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_write_multiple_registers(17, read, write)?)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn read_write_multiple_registers(
        unit: u8,
        (read_address, read): (u16, &'a mut [u16]),
        (write_address, write): (u16, &'a mut [u16]),
    ) -> Result<Self, Error> {
        let (reads, writes) = (quantity(read.len()), quantity(write.len()));
        let (sends, takes) = (Slice::Registers(write), Slice::Registers(read));
        Request::build(unit, sends, takes, |state| {
            state.read_write_registers(read_address, reads, write_address, writes)
        })
    }

    /// The result of a request that the client has returned.
    ///
    /// # Errors
    /// Why it failed; `PENDING` while it is pending.
    pub fn result(&self) -> Result<(), Error> {
        self.state.status.result()
    }

    /// The registers that were read; none if the request reads others or has failed.
    pub fn registers(&self) -> &[u16] {
        match &self.takes {
            Slice::Registers(words) => words.get(..usize::from(self.state.length / 2)),
            _ => None,
        }
        .unwrap_or_default()
    }

    /// The coils or discrete inputs that were read; none if the request reads others or has
    /// failed.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut coils = [false; 2];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_coils(17, 0, &mut coils)?)?;
    /// # let request = loop { let now = mbm::port::Port::micros(client.port()); if let Some(request) = client.poll(now) { break request; } };
    /// // When the client has returned it:
    /// assert_eq!(request.coils(), [true, false]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn coils(&self) -> &[bool] {
        match &self.takes {
            Slice::Coils(coils) if self.state.length > 0 => coils,
            _ => &[],
        }
    }

    /// The bytes that a request has received whose data are bytes; none for one that has failed.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut outputs = [0];
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(Request::read_exception_status(17, &mut outputs)?)?;
    /// # let request = loop { let now = mbm::port::Port::micros(client.port()); if let Some(request) = client.poll(now) { break request; } };
    /// // When the client has returned it:
    /// assert_eq!(request.bytes(), [0b0000_0101]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn bytes(&self) -> &[u8] {
        match &self.takes {
            Slice::Bytes(bytes) => bytes.get(..usize::from(self.state.length)),
            _ => None,
        }
        .unwrap_or_default()
    }

    /// The registers that the request writes.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut registers = [1, 2];
    /// let mut request = Request::write_multiple_registers(17, 107, &mut registers)?;
    /// request.registers_to_write()[0] = 7;
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(request)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn registers_to_write(&mut self) -> &mut [u16] {
        match &mut self.sends {
            Slice::Registers(words) => words,
            _ => &mut [],
        }
    }

    /// The coils that the request writes.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # use mbm::client::{Client, Request, Tcp, TcpBuffers};
    /// # let line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
    /// let mut coils = [true, false];
    /// let mut request = Request::write_multiple_coils(17, 0, &mut coils)?;
    /// request.coils_to_write()[1] = true;
    /// # let mut client: Client<_, Request, 4> = Client::new(line);
    /// client.queue(request)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn coils_to_write(&mut self) -> &mut [bool] {
        match &mut self.sends {
            Slice::Coils(coils) => coils,
            _ => &mut [],
        }
    }
}

impl ClientRequest for Request<'_> {
    fn state(&self) -> &RequestState {
        &self.state
    }

    fn state_mut(&mut self) -> &mut RequestState {
        &mut self.state
    }

    fn byte(&self, index: usize) -> u8 {
        self.sends.byte(index)
    }

    fn store(&mut self, data: &[u8], mask: u8) {
        self.takes.store(data, mask);
    }
}
