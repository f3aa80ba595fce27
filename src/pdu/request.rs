//! A request PDU, taken apart: [`Request::parse`] and [`Request::emit`]. The data of a parsed request
//! borrow from its bytes.

use super::custom;
use super::diagnostics::{check_sub_function, sub_function};
use super::fields::{byte_count, check_within, expect, Byte, Data, Fields, Flag, Parser, Word};
use super::files::{Reads, Writes};
use super::functions;
use super::identification::{BASIC, INDIVIDUAL, MEI_READ_DEVICE_IDENTIFICATION};
use super::length::{self, Length};
use super::{
    check_range, MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS,
    MAX_WRITE_BITS, MAX_WRITE_REGISTERS,
};
use crate::bytes::{Reader, Writer};
use crate::error::Error;
use core::mem::discriminant;

/// A request PDU. Register data are in the order of the wire, high byte first. The first bit
/// of bit data is the lowest bit of the first byte.
///
/// ```
/// use mbm::pdu::length::Length;
/// use mbm::pdu::request::Request;
///
/// let request = Request::ReadRegisters { function: 3, address: 107, quantity: 2 };
/// let mut pdu = [0; 5];
/// request.emit(&mut pdu)?;
/// assert_eq!(pdu, [3, 0, 107, 0, 2]);
/// assert_eq!(Request::parse(&pdu), Ok(request));
/// assert_eq!(request.function(), 3);
/// assert_eq!(request.response_length(&[]), Length::Exactly(6));
///
/// // What a server would answer with an exception is not written.
/// let refused = Request::ReadRegisters { function: 3, address: 107, quantity: 126 };
/// assert_eq!(refused.emit(&mut [0; 5]), Err(mbm::Error::IllegalDataValue));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Request<'a> {
    /// 01 or 02.
    ReadBits {
        function: u8,
        address: u16,
        quantity: u16,
    },
    /// 03 or 04.
    ReadRegisters {
        function: u8,
        address: u16,
        quantity: u16,
    },
    WriteSingleCoil {
        address: u16,
        on: bool,
    },
    WriteSingleRegister {
        address: u16,
        value: u16,
    },
    ReadExceptionStatus,
    Diagnostics {
        sub_function: u16,
        data: &'a [u8],
    },
    GetCommEventCounter,
    GetCommEventLog,
    WriteMultipleCoils {
        address: u16,
        quantity: u16,
        data: &'a [u8],
    },
    WriteMultipleRegisters {
        address: u16,
        quantity: u16,
        data: &'a [u8],
    },
    ReportServerId,
    ReadFileRecord(Reads<'a>),
    WriteFileRecord(Writes<'a>),
    MaskWriteRegister {
        address: u16,
        and_mask: u16,
        or_mask: u16,
    },
    ReadWriteMultipleRegisters {
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
        data: &'a [u8],
    },
    ReadFifoQueue {
        address: u16,
    },
    ReadDeviceIdentification {
        code: u8,
        object: u8,
    },
    /// 2B with any other MEI type.
    EncapsulatedInterface {
        mei_type: u8,
        data: &'a [u8],
    },
    /// A user-defined function.
    Custom {
        function: u8,
        data: &'a [u8],
    },
}

impl<'a> Request<'a> {
    /// Parses a request PDU. The functions 65 to 72 and 100 to 110 are user-defined.
    ///
    /// # Errors
    /// The exception that a server answers: [`Error::IllegalFunction`] for
    /// an unknown function or sub-function, [`Error::IllegalDataValue`] for
    /// a wrong length, quantity or value, [`Error::IllegalDataAddress`] for addresses beyond
    /// 65535.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Error> {
        Request::parse_with(pdu, &[])
    }

    /// As [`Request::parse`], with declared user-defined functions, whose PDUs must have the
    /// declared length.
    ///
    /// # Errors
    /// As [`Request::parse`].
    ///
    /// ```
    /// use mbm::pdu::custom::{Function, Rule};
    /// use mbm::pdu::request::Request;
    ///
    /// let function = Function { code: 0x70, request: Rule::Fixed(2), response: Rule::Silence };
    /// let request = Request::parse_with(&[0x70, 7], &[function])?;
    /// assert_eq!(request, Request::Custom { function: 0x70, data: &[7] });
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn parse_with(pdu: &'a [u8], functions: &[custom::Function]) -> Result<Self, Error> {
        let (&function, fields) = pdu.split_first().ok_or(Error::IllegalFunction)?;
        let mut parser = Parser {
            reader: Reader::new(fields),
            is_wrong: false,
        };
        let mut request = Request::of(function);
        request.pass(&mut parser);
        expect(parser.is_right() && pdu.len() <= MAX_PDU)?;
        request.check(pdu, functions)?;
        Ok(request)
    }

    /// The request of a function whose fields are those of `source`. It may be one that
    /// [`Request::emit`] refuses.
    ///
    /// # Errors
    /// The exception that a server answers to records of a file that are not valid.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn take(function: u8, source: &mut impl Fields<'a>) -> Result<Self, Error> {
        let mut request = Request::of(function);
        request.pass(source);
        request.check_records()?;
        Ok(request)
    }

    /// Gives all fields to `sink`, in the order of the wire.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn give(&self, sink: &mut impl Fields<'a>) {
        // A sink changes no field.
        Request::pass(&mut { *self }, sink);
    }

    /// A request of a function, with all fields 0.
    fn of(function: u8) -> Self {
        let (address, quantity, data) = (0, 0, &[][..]);
        match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => Request::ReadBits {
                function,
                address,
                quantity,
            },
            functions::READ_HOLDING_REGISTERS | functions::READ_INPUT_REGISTERS => {
                Request::ReadRegisters {
                    function,
                    address,
                    quantity,
                }
            }
            functions::WRITE_SINGLE_COIL => Request::WriteSingleCoil { address, on: false },
            functions::WRITE_SINGLE_REGISTER => Request::WriteSingleRegister { address, value: 0 },
            functions::READ_EXCEPTION_STATUS => Request::ReadExceptionStatus,
            functions::DIAGNOSTICS => Request::Diagnostics {
                sub_function: 0,
                data,
            },
            functions::GET_COMM_EVENT_COUNTER => Request::GetCommEventCounter,
            functions::GET_COMM_EVENT_LOG => Request::GetCommEventLog,
            functions::WRITE_MULTIPLE_COILS => Request::WriteMultipleCoils {
                address,
                quantity,
                data,
            },
            functions::WRITE_MULTIPLE_REGISTERS => Request::WriteMultipleRegisters {
                address,
                quantity,
                data,
            },
            functions::REPORT_SERVER_ID => Request::ReportServerId,
            functions::READ_FILE_RECORD => Request::ReadFileRecord(Reads(data)),
            functions::WRITE_FILE_RECORD => Request::WriteFileRecord(Writes(data)),
            functions::MASK_WRITE_REGISTER => Request::MaskWriteRegister {
                address,
                and_mask: 0,
                or_mask: 0,
            },
            functions::READ_WRITE_MULTIPLE_REGISTERS => Request::ReadWriteMultipleRegisters {
                read_address: 0,
                read_quantity: 0,
                write_address: 0,
                write_quantity: 0,
                data,
            },
            functions::READ_FIFO_QUEUE => Request::ReadFifoQueue { address },
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => {
                Request::EncapsulatedInterface { mei_type: 0, data }
            }
            function => Request::Custom { function, data },
        }
    }

    /// Passes all fields, in the order of the wire.
    fn pass(&mut self, fields: &mut impl Fields<'a>) {
        match self {
            Request::ReadBits {
                address, quantity, ..
            }
            | Request::ReadRegisters {
                address, quantity, ..
            } => {
                fields.word(Word::Address, address);
                fields.word(Word::Quantity, quantity)
            }
            Request::WriteSingleCoil { address, on } => {
                fields.word(Word::Address, address);
                fields.flag(Flag::Coil, on);
            }
            Request::WriteSingleRegister { address, value } => {
                fields.word(Word::Address, address);
                fields.word(Word::Value, value)
            }
            Request::ReadExceptionStatus
            | Request::GetCommEventCounter
            | Request::GetCommEventLog
            | Request::ReportServerId => {}
            Request::Diagnostics { sub_function, data } => {
                fields.word(Word::SubFunction, sub_function);
                fields.rest(Data::Registers, data);
            }
            Request::WriteMultipleCoils {
                address,
                quantity,
                data,
            } => {
                fields.word(Word::Address, address);
                fields.word(Word::Quantity, quantity);
                fields.counted(Data::Bits, data)
            }
            Request::WriteMultipleRegisters {
                address,
                quantity,
                data,
            } => {
                fields.word(Word::Address, address);
                fields.word(Word::Quantity, quantity);
                fields.counted(Data::Registers, data)
            }
            Request::ReadFileRecord(Reads(bytes)) | Request::WriteFileRecord(Writes(bytes)) => {
                fields.counted(Data::Bytes, bytes)
            }
            Request::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            } => {
                fields.word(Word::Address, address);
                fields.word(Word::AndMask, and_mask);
                fields.word(Word::OrMask, or_mask)
            }
            Request::ReadWriteMultipleRegisters {
                read_address,
                read_quantity,
                write_address,
                write_quantity,
                data,
            } => {
                fields.word(Word::ReadAddress, read_address);
                fields.word(Word::Quantity, read_quantity);
                fields.word(Word::WriteAddress, write_address);
                fields.word(Word::WriteQuantity, write_quantity);
                fields.counted(Data::Registers, data)
            }
            Request::ReadFifoQueue { address } => fields.word(Word::Address, address),
            Request::ReadDeviceIdentification { .. } | Request::EncapsulatedInterface { .. } => {
                self.pass_encapsulated(fields);
            }
            Request::Custom { data, .. } => fields.rest(Data::Bytes, data),
        }
    }

    /// Passes the MEI type of a request of 2B, and the fields that follow it.
    fn pass_encapsulated<F: Fields<'a>>(&mut self, fields: &mut F) {
        let mut mei_type = match *self {
            Request::EncapsulatedInterface { mei_type, .. } => mei_type,
            Request::ReadDeviceIdentification { .. } => MEI_READ_DEVICE_IDENTIFICATION,
            _ => return,
        };
        fields.byte(Byte::MeiType, &mut mei_type);
        if F::IS_SOURCE {
            let data = &[][..];
            *self = match mei_type {
                MEI_READ_DEVICE_IDENTIFICATION => {
                    Request::ReadDeviceIdentification { code: 0, object: 0 }
                }
                mei_type => Request::EncapsulatedInterface { mei_type, data },
            };
        }
        match self {
            Request::ReadDeviceIdentification { code, object } => {
                fields.byte(Byte::ReadDeviceIdCode, code);
                fields.byte(Byte::ObjectId, object)
            }
            Request::EncapsulatedInterface { data, .. } => fields.rest(Data::Bytes, data),
            _ => {}
        }
    }

    /// Checks the records of a file.
    fn check_records(&self) -> Result<(), Error> {
        match *self {
            Request::ReadFileRecord(Reads(bytes)) => Reads::new(bytes).map(drop),
            Request::WriteFileRecord(Writes(bytes)) => Writes::new(bytes).map(drop),
            _ => Ok(()),
        }
    }

    /// Checks the fields by the rules of the standard. The PDU has all of them, and nothing
    /// follows. A server checks lengths and quantities before addresses (figures 11 and
    /// following).
    fn check(&self, pdu: &[u8], functions: &[custom::Function]) -> Result<(), Error> {
        match *self {
            Request::ReadBits {
                address, quantity, ..
            } => check_range(address, quantity, MAX_READ_BITS).result(),
            Request::ReadRegisters {
                address, quantity, ..
            } => check_range(address, quantity, MAX_READ_REGISTERS).result(),
            Request::WriteMultipleCoils {
                address,
                quantity,
                data,
            } => {
                expect(data.len() == usize::from(byte_count(quantity)))?;
                check_range(address, quantity, MAX_WRITE_BITS).result()
            }
            Request::WriteMultipleRegisters {
                address,
                quantity,
                data,
            } => {
                expect(data.len() == 2 * usize::from(quantity))?;
                check_range(address, quantity, MAX_WRITE_REGISTERS).result()
            }
            Request::ReadWriteMultipleRegisters {
                read_address,
                read_quantity,
                write_address,
                write_quantity,
                data,
            } => {
                expect(data.len() == 2 * usize::from(write_quantity))?;
                let most = MAX_READ_WRITE_REGISTERS;
                // Both quantities are checked before both ranges of addresses.
                check_within(usize::from(write_quantity), (1, most.into()))?;
                check_range(read_address, read_quantity, MAX_READ_REGISTERS).result()?;
                check_range(write_address, write_quantity, most).result()
            }
            Request::Diagnostics { sub_function, data } => {
                check_sub_function(sub_function, data)?;
                expect(match (sub_function, data) {
                    (sub_function::RETURN_QUERY_DATA, _)
                    | (sub_function::RESTART_COMMUNICATIONS, [0x00 | 0xFF, 0])
                    | (sub_function::CHANGE_ASCII_INPUT_DELIMITER, [_, 0]) => true,
                    (_, data) => matches!(data, [0, 0]),
                })
            }
            Request::ReadDeviceIdentification { code, .. } => {
                expect((BASIC..=INDIVIDUAL).contains(&code))
            }
            Request::Custom { function, .. } => {
                let declared = custom::find(functions, function);
                length::check(pdu, function, declared.map(|it| it.request))
            }
            _ => self.check_records(),
        }
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        match *self {
            Request::ReadBits { function, .. }
            | Request::ReadRegisters { function, .. }
            | Request::Custom { function, .. } => function,
            Request::WriteSingleCoil { .. } => functions::WRITE_SINGLE_COIL,
            Request::WriteSingleRegister { .. } => functions::WRITE_SINGLE_REGISTER,
            Request::ReadExceptionStatus => functions::READ_EXCEPTION_STATUS,
            Request::Diagnostics { .. } => functions::DIAGNOSTICS,
            Request::GetCommEventCounter => functions::GET_COMM_EVENT_COUNTER,
            Request::GetCommEventLog => functions::GET_COMM_EVENT_LOG,
            Request::WriteMultipleCoils { .. } => functions::WRITE_MULTIPLE_COILS,
            Request::WriteMultipleRegisters { .. } => functions::WRITE_MULTIPLE_REGISTERS,
            Request::ReportServerId => functions::REPORT_SERVER_ID,
            Request::ReadFileRecord(_) => functions::READ_FILE_RECORD,
            Request::WriteFileRecord(_) => functions::WRITE_FILE_RECORD,
            Request::MaskWriteRegister { .. } => functions::MASK_WRITE_REGISTER,
            Request::ReadWriteMultipleRegisters { .. } => functions::READ_WRITE_MULTIPLE_REGISTERS,
            Request::ReadFifoQueue { .. } => functions::READ_FIFO_QUEUE,
            Request::ReadDeviceIdentification { .. } | Request::EncapsulatedInterface { .. } => {
                functions::ENCAPSULATED_INTERFACE_TRANSPORT
            }
        }
    }

    /// Writes the PDU to the front of `pdu` and returns its length in bytes.
    ///
    /// # Errors
    /// The error that [`Request::parse`] returns for such a request, so that no malformed
    /// request is sent; [`Error::BufferTooSmall`] if it does not fit.
    pub fn emit(&self, pdu: &mut [u8]) -> Result<usize, Error> {
        let mut writer = Writer::new(pdu);
        writer.u8(self.function());
        self.give(&mut writer);
        if writer.length() > MAX_PDU {
            return Err(Error::IllegalDataValue);
        }
        let length = writer.finish()?;
        let written = pdu.get(..length).unwrap_or_default();
        let same = match self {
            // The caller chose the function code, also outside the user-defined ranges.
            Request::Custom { function, .. } => custom::is_free(*function),
            // The content of the variant must not be that of another variant.
            _ => discriminant(&Request::parse(written)?) == discriminant(self),
        };
        if same {
            Ok(length)
        } else {
            Err(Error::IllegalFunction)
        }
    }

    /// The length of the response PDU if the request succeeds, as far as the request determines
    /// it; [`Length::Exactly`] of 0 if there is no response.
    pub fn response_length(&self, functions: &[custom::Function]) -> Length {
        match *self {
            Request::ReadBits { quantity, .. } => {
                Length::Exactly(usize::from(quantity.div_ceil(8)).saturating_add(2))
            }
            Request::ReadRegisters { quantity, .. }
            | Request::ReadWriteMultipleRegisters {
                read_quantity: quantity,
                ..
            } => Length::Exactly(usize::from(quantity).saturating_mul(2).saturating_add(2)),
            Request::ReadFileRecord(reads) => Length::Exactly(reads.response_length()),
            // The response repeats the request.
            Request::WriteFileRecord(writes) => Length::Exactly(2 + writes.bytes().len()),
            Request::Diagnostics {
                sub_function: sub_function::FORCE_LISTEN_ONLY,
                ..
            } => Length::Exactly(0),
            Request::Diagnostics { data, .. } => Length::Exactly(3 + data.len()),
            Request::ReadDeviceIdentification { .. } => Length::AtLeast(7),
            Request::EncapsulatedInterface { mei_type, .. } => {
                length::response(&[self.function(), mei_type], functions)
            }
            _ => length::response(&[self.function()], functions),
        }
    }
}
