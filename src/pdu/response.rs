//! A response PDU, taken apart: [`Response::parse`] and [`Response::emit`]. The data of a parsed
//! response borrow from its bytes.

use super::diagnostics::{check_sub_function, sub_function};
use super::fields::{byte_count, expect, Byte, Count, Data, Fields, Flag, Parser, Word};
use super::files::{Records, Writes};
use super::identification::{check_head, ObjectList, MEI_READ_DEVICE_IDENTIFICATION};
use super::{
    check_range, custom, functions, length, EXCEPTION, MAX_EVENTS, MAX_FIFO, MAX_PDU,
    MAX_READ_BITS, MAX_READ_REGISTERS, MAX_WRITE_BITS, MAX_WRITE_REGISTERS,
};
use crate::bytes::{Reader, Writer};
use crate::error::{Error, Status};
use core::mem::discriminant;

/// A response PDU. Register data are in the order of the wire, high byte first. The first bit
/// of bit data is the lowest bit of the first byte.
///
/// ```
/// use mbm::pdu::response::Response;
///
/// let response = Response::ReadRegisters { function: 3, data: &[0x02, 0x2B] };
/// let mut pdu = [0; 4];
/// response.emit(&mut pdu)?;
/// assert_eq!(pdu, [3, 2, 0x02, 0x2B]);
/// assert_eq!(Response::parse(&pdu), Ok(response));
/// let refusal = Response::parse(&[0x83, 2])?;
/// assert_eq!(refusal, Response::Exception { function: 3, code: 2 });
/// assert_eq!(refusal.function(), 3);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Response<'a> {
    /// 01 or 02.
    ReadBits {
        function: u8,
        data: &'a [u8],
    },
    /// 03, 04 or 17.
    ReadRegisters {
        function: u8,
        data: &'a [u8],
    },
    WriteSingleCoil {
        address: u16,
        on: bool,
    },
    WriteSingleRegister {
        address: u16,
        value: u16,
    },
    /// 07.
    ExceptionStatus {
        outputs: u8,
    },
    Diagnostics {
        sub_function: u16,
        data: &'a [u8],
    },
    /// 0B. The status word is FFFF while the device executes a program command.
    CommEventCounter {
        status: u16,
        events: u16,
    },
    /// 0C. The latest event is the first in `log`.
    CommEventLog {
        status: u16,
        events: u16,
        messages: u16,
        log: &'a [u8],
    },
    /// 0F or 10.
    WriteMultiple {
        function: u8,
        address: u16,
        quantity: u16,
    },
    /// 11. In some devices, the byte count `count` covers only the front of `data`.
    ServerId {
        count: u8,
        data: &'a [u8],
    },
    ReadFileRecord(Records<'a>),
    WriteFileRecord(Writes<'a>),
    MaskWriteRegister {
        address: u16,
        and_mask: u16,
        or_mask: u16,
    },
    /// 18.
    FifoQueue {
        data: &'a [u8],
    },
    /// 2B/0E.
    DeviceIdentification {
        code: u8,
        conformity: u8,
        more_follows: bool,
        next_object: u8,
        objects: ObjectList<'a>,
    },
    /// 2B with any other MEI type.
    EncapsulatedInterface {
        mei_type: u8,
        data: &'a [u8],
    },
    /// The function code of the request, without the highest bit, and the exception code.
    Exception {
        function: u8,
        code: u8,
    },
    /// A user-defined function.
    Custom {
        function: u8,
        data: &'a [u8],
    },
}

impl<'a> Response<'a> {
    /// Parses a response PDU. The functions 65 to 72 and 100 to 110 are user-defined.
    ///
    /// # Errors
    /// [`Error::InvalidFunction`] for an unknown function, [`Error::MalformedReply`] for
    /// all other errors.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Error> {
        Response::parse_with(pdu, &[])
    }

    /// As [`Response::parse`], with declared user-defined functions, whose PDUs must have the
    /// declared length.
    ///
    /// # Errors
    /// As [`Response::parse`].
    ///
    /// ```
    /// use mbm::pdu::custom::{Function, Rule};
    /// use mbm::pdu::response::Response;
    ///
    /// let function = Function { code: 0x70, request: Rule::Silence, response: Rule::Fixed(2) };
    /// let response = Response::parse_with(&[0x70, 7], &[function])?;
    /// assert_eq!(response, Response::Custom { function: 0x70, data: &[7] });
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn parse_with(pdu: &'a [u8], functions: &[custom::Function]) -> Result<Self, Error> {
        let (&function, fields) = pdu.split_first().ok_or(Error::MalformedReply)?;
        let mut parser = Parser {
            reader: Reader::new(fields),
            is_wrong: false,
        };
        let mut response = Response::of(function);
        response.pass(&mut parser);
        let mut found = expect(parser.is_right());
        if found.is_ok() {
            found = response.check(pdu, functions);
        }
        match found {
            Ok(()) if pdu.len() <= MAX_PDU => Ok(response),
            Err(Error::InvalidFunction) if pdu.len() <= MAX_PDU => Err(Error::InvalidFunction),
            _ => Err(Error::MalformedReply),
        }
    }

    /// The response of a function, no exception, whose fields are those of `source`. It may be
    /// one that [`Response::emit`] refuses.
    ///
    /// # Errors
    /// [`Error::MalformedReply`] for records of a file or objects that are not valid.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn take(function: u8, source: &mut impl Fields<'a>) -> Result<Self, Error> {
        let mut response = match Response::of(function) {
            Response::Exception { .. } => return Err(Error::InvalidFunction),
            response => response,
        };
        response.pass(source);
        let checked = response.check_groups();
        checked.map_or(Err(Error::MalformedReply), |()| Ok(response))
    }

    /// Gives all fields to `sink`, in the order of the wire.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn give(&self, sink: &mut impl Fields<'a>) {
        // A sink changes no field.
        Response::pass(&mut { *self }, sink);
    }

    /// A response of a function, with all fields 0.
    fn of(function: u8) -> Self {
        let (address, quantity, data) = (0, 0, &[][..]);
        match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => {
                Response::ReadBits { function, data }
            }
            functions::READ_HOLDING_REGISTERS
            | functions::READ_INPUT_REGISTERS
            | functions::READ_WRITE_MULTIPLE_REGISTERS => {
                Response::ReadRegisters { function, data }
            }
            functions::WRITE_SINGLE_COIL => Response::WriteSingleCoil { address, on: false },
            functions::WRITE_SINGLE_REGISTER => Response::WriteSingleRegister { address, value: 0 },
            functions::READ_EXCEPTION_STATUS => Response::ExceptionStatus { outputs: 0 },
            functions::DIAGNOSTICS => Response::Diagnostics {
                sub_function: 0,
                data,
            },
            functions::GET_COMM_EVENT_COUNTER => Response::CommEventCounter {
                status: 0,
                events: 0,
            },
            functions::GET_COMM_EVENT_LOG => Response::CommEventLog {
                status: 0,
                events: 0,
                messages: 0,
                log: data,
            },
            functions::WRITE_MULTIPLE_COILS | functions::WRITE_MULTIPLE_REGISTERS => {
                Response::WriteMultiple {
                    function,
                    address,
                    quantity,
                }
            }
            functions::REPORT_SERVER_ID => Response::ServerId { count: 0, data },
            functions::READ_FILE_RECORD => Response::ReadFileRecord(Records(data)),
            functions::WRITE_FILE_RECORD => Response::WriteFileRecord(Writes(data)),
            functions::MASK_WRITE_REGISTER => Response::MaskWriteRegister {
                address,
                and_mask: 0,
                or_mask: 0,
            },
            functions::READ_FIFO_QUEUE => Response::FifoQueue { data },
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => {
                Response::EncapsulatedInterface { mei_type: 0, data }
            }
            function if function & EXCEPTION != 0 => Response::Exception {
                function: function & !EXCEPTION,
                code: 0,
            },
            function => Response::Custom { function, data },
        }
    }

    /// Passes all fields, in the order of the wire.
    fn pass(&mut self, fields: &mut impl Fields<'a>) {
        match self {
            Response::ReadBits { data, .. } => fields.counted(Data::Bits, data),
            Response::ReadRegisters { data, .. } => fields.counted(Data::Registers, data),
            Response::WriteSingleCoil { address, on } => {
                fields.word(Word::Address, address);
                fields.flag(Flag::Coil, on);
            }
            Response::WriteSingleRegister { address, value } => {
                fields.word(Word::Address, address);
                fields.word(Word::Value, value)
            }
            Response::ExceptionStatus { outputs } => fields.byte(Byte::ExceptionStatus, outputs),
            Response::Diagnostics { sub_function, data } => {
                fields.word(Word::SubFunction, sub_function);
                fields.rest(Data::Registers, data);
            }
            Response::CommEventCounter { status, events } => {
                fields.word(Word::CommStatus, status);
                fields.word(Word::EventCount, events)
            }
            Response::CommEventLog {
                status,
                events,
                messages,
                log,
            } => {
                fields.count(Count::Byte, 6 + log.len());
                fields.word(Word::CommStatus, status);
                fields.word(Word::EventCount, events);
                fields.word(Word::MessageCount, messages);
                fields.rest(Data::Bytes, log);
            }
            Response::WriteMultiple {
                address, quantity, ..
            } => {
                fields.word(Word::Address, address);
                fields.word(Word::Quantity, quantity)
            }
            // In some devices the byte count covers only the id, and more bytes follow. So the
            // result contains the count and all bytes after it.
            Response::ServerId { count, data } => {
                fields.byte(Byte::ByteCount, count);
                fields.rest(Data::Characters, data);
            }
            Response::ReadFileRecord(Records(bytes)) | Response::WriteFileRecord(Writes(bytes)) => {
                fields.counted(Data::Bytes, bytes)
            }
            Response::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            } => {
                fields.word(Word::Address, address);
                fields.word(Word::AndMask, and_mask);
                fields.word(Word::OrMask, or_mask)
            }
            Response::FifoQueue { data } => {
                fields.count(Count::Bytes, 2 + data.len());
                fields.count(Count::Registers, data.len());
                fields.rest(Data::Registers, data);
            }
            Response::DeviceIdentification { .. } | Response::EncapsulatedInterface { .. } => {
                self.pass_encapsulated(fields);
            }
            Response::Exception { code, .. } => fields.byte(Byte::ExceptionCode, code),
            Response::Custom { data, .. } => fields.rest(Data::Bytes, data),
        }
    }

    /// Passes the MEI type of a response of 2B, and the fields that follow it.
    fn pass_encapsulated<F: Fields<'a>>(&mut self, fields: &mut F) {
        let mut mei_type = match *self {
            Response::EncapsulatedInterface { mei_type, .. } => mei_type,
            Response::DeviceIdentification { .. } => MEI_READ_DEVICE_IDENTIFICATION,
            _ => return,
        };
        fields.byte(Byte::MeiType, &mut mei_type);
        if F::IS_SOURCE {
            let data = &[][..];
            *self = match mei_type {
                MEI_READ_DEVICE_IDENTIFICATION => Response::DeviceIdentification {
                    code: 0,
                    conformity: 0,
                    more_follows: false,
                    next_object: 0,
                    objects: ObjectList {
                        count: 0,
                        bytes: data,
                    },
                },
                mei_type => Response::EncapsulatedInterface { mei_type, data },
            };
        }
        match self {
            Response::DeviceIdentification {
                code,
                conformity,
                more_follows,
                next_object,
                objects: ObjectList { count, bytes },
            } => {
                fields.byte(Byte::ReadDeviceIdCode, code);
                fields.byte(Byte::Conformity, conformity);
                fields.flag(Flag::MoreFollows, more_follows);
                fields.byte(Byte::NextObjectId, next_object);
                fields.byte(Byte::ObjectCount, count);
                fields.rest(Data::Bytes, bytes);
            }
            Response::EncapsulatedInterface { data, .. } => fields.rest(Data::Bytes, data),
            _ => {}
        }
    }

    /// Checks the records of a file, and the objects of a device identification.
    fn check_groups(&self) -> Result<(), Error> {
        match *self {
            Response::ReadFileRecord(Records(bytes)) => Records::new(bytes).map(drop),
            Response::WriteFileRecord(Writes(bytes)) => Writes::new(bytes).map(drop),
            Response::DeviceIdentification { objects, .. } => {
                ObjectList::new(objects.count, objects.bytes).map(drop)
            }
            _ => Ok(()),
        }
    }

    /// Checks the fields by the rules of the standard. The PDU has all of them, and nothing
    /// follows.
    fn check(&self, pdu: &[u8], functions: &[custom::Function]) -> Result<(), Error> {
        match *self {
            Response::ReadBits { data, .. } => {
                let most = usize::from(byte_count(MAX_READ_BITS));
                expect(!data.is_empty() && data.len() <= most)
            }
            Response::ReadRegisters { data, .. } => {
                let most = 2 * usize::from(MAX_READ_REGISTERS);
                let is_right = data.len() <= most && data.len().is_multiple_of(2);
                expect(!data.is_empty() && is_right)
            }
            Response::WriteMultiple {
                function,
                address,
                quantity,
            } => {
                let most = match function {
                    functions::WRITE_MULTIPLE_COILS => MAX_WRITE_BITS,
                    _ => MAX_WRITE_REGISTERS,
                };
                check_range(address, quantity, most).result()
            }
            Response::Diagnostics { sub_function, data } => {
                check_sub_function(sub_function, data)?;
                expect(sub_function != sub_function::FORCE_LISTEN_ONLY)
            }
            Response::CommEventLog { log, .. } => expect(log.len() <= MAX_EVENTS),
            Response::ServerId { count, data } => expect(usize::from(count) <= data.len()),
            Response::FifoQueue { data } => expect(data.len() <= 2 * usize::from(MAX_FIFO)),
            Response::DeviceIdentification {
                code,
                more_follows,
                objects,
                ..
            } => {
                check_head(code, more_follows, objects.count)?;
                self.check_groups()
            }
            Response::Exception { code, .. } => {
                expect(Status::exception(code) != Status::MALFORMED_REPLY)
            }
            Response::Custom { function, .. } => {
                let declared = custom::find(functions, function);
                match length::check(pdu, function, declared.map(|it| it.response)) {
                    Err(Error::IllegalFunction) => Err(Error::InvalidFunction),
                    checked => checked,
                }
            }
            _ => self.check_groups(),
        }
    }

    /// The function code; for an exception, that of the request.
    pub const fn function(&self) -> u8 {
        match *self {
            Response::ReadBits { function, .. }
            | Response::ReadRegisters { function, .. }
            | Response::WriteMultiple { function, .. }
            | Response::Exception { function, .. }
            | Response::Custom { function, .. } => function,
            Response::WriteSingleCoil { .. } => functions::WRITE_SINGLE_COIL,
            Response::WriteSingleRegister { .. } => functions::WRITE_SINGLE_REGISTER,
            Response::ExceptionStatus { .. } => functions::READ_EXCEPTION_STATUS,
            Response::Diagnostics { .. } => functions::DIAGNOSTICS,
            Response::CommEventCounter { .. } => functions::GET_COMM_EVENT_COUNTER,
            Response::CommEventLog { .. } => functions::GET_COMM_EVENT_LOG,
            Response::ServerId { .. } => functions::REPORT_SERVER_ID,
            Response::ReadFileRecord(_) => functions::READ_FILE_RECORD,
            Response::WriteFileRecord(_) => functions::WRITE_FILE_RECORD,
            Response::MaskWriteRegister { .. } => functions::MASK_WRITE_REGISTER,
            Response::FifoQueue { .. } => functions::READ_FIFO_QUEUE,
            Response::DeviceIdentification { .. } | Response::EncapsulatedInterface { .. } => {
                functions::ENCAPSULATED_INTERFACE_TRANSPORT
            }
        }
    }

    /// Writes the PDU to the front of `pdu` and returns its length in bytes.
    ///
    /// # Errors
    /// The error that [`Response::parse`] returns for such a response, so that no malformed
    /// response is sent; [`Error::BufferTooSmall`] if it does not fit.
    pub fn emit(&self, pdu: &mut [u8]) -> Result<usize, Error> {
        let mut writer = Writer::new(pdu);
        writer.u8(match self {
            Response::Exception { function, .. } => function | EXCEPTION,
            _ => self.function(),
        });
        self.give(&mut writer);
        if writer.length() > MAX_PDU {
            return Err(Error::MalformedReply);
        }
        let length = writer.finish()?;
        let written = pdu.get(..length).unwrap_or_default();
        let same = match self {
            // The caller chose the function code, also outside the user-defined ranges.
            Response::Custom { function, .. } => custom::is_free(*function),
            Response::Exception { function, .. } if function & EXCEPTION != 0 => false,
            // The content of the variant must not be that of another variant.
            _ => discriminant(&Response::parse(written)?) == discriminant(self),
        };
        if same {
            Ok(length)
        } else {
            Err(Error::InvalidFunction)
        }
    }
}
