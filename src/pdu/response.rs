//! A response PDU, taken apart: [`Response::parse`] and [`Response::emit`]. The data of a parsed
//! response borrow from its bytes.

use super::diagnostics::{sub_function, sub_function_and_data};
use super::fields::{
    byte, byte_count, counted, emit_diagnostics, emit_encapsulated, emit_mask_write_register,
    emit_write_single_coil, is_on, last_range, word,
};
use super::files::{Records, Writes};
use super::identification::{read_reply, ObjectList, MEI_READ_DEVICE_IDENTIFICATION, MORE};
use super::limits::{
    MAX_EVENTS, MAX_FIFO, MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS, MAX_WRITE_BITS,
    MAX_WRITE_REGISTERS,
};
use super::{custom, functions, length, EXCEPTION};
use crate::bytes::{Reader, Writer};
use crate::error::{Error, Status};
use core::mem::discriminant;

/// A response PDU. Register data are in the order of the wire, high byte first. The first bit
/// of bit data is the lowest bit of the first byte.
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
    /// [`Error::INVALID_FUNCTION`] for an unknown function, [`Error::MALFORMED_REPLY`] for
    /// all other errors.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Error> {
        Response::parse_with(pdu, &[])
    }

    /// As [`Response::parse`], with declared user-defined functions, whose PDUs must have the
    /// declared length.
    ///
    /// # Errors
    /// As [`Response::parse`].
    pub fn parse_with(pdu: &'a [u8], functions: &[custom::Function]) -> Result<Self, Error> {
        let mut reader = Reader::new(pdu);
        // The variable is changed in place: moving it would cost as much time as parsing.
        let mut response = Response::read(pdu, &mut reader, functions);
        let in_order = match response {
            Ok(_) => reader.is_empty() && pdu.len() <= MAX_PDU,
            Err(status) => status == Status::INVALID_FUNCTION && pdu.len() <= MAX_PDU,
        };
        if !in_order {
            response = Err(Error::MALFORMED_REPLY);
        }
        response
    }

    fn read(
        pdu: &[u8],
        reader: &mut Reader<'a>,
        functions: &[custom::Function],
    ) -> Result<Self, Error> {
        let function = reader.u8().ok_or(Error::MALFORMED_REPLY)?;
        match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => read_bits(function, reader),
            functions::READ_HOLDING_REGISTERS
            | functions::READ_INPUT_REGISTERS
            | functions::READ_WRITE_MULTIPLE_REGISTERS => read_registers(function, reader),
            functions::WRITE_SINGLE_COIL => write_single_coil(reader),
            functions::WRITE_SINGLE_REGISTER => write_single_register(reader),
            functions::READ_EXCEPTION_STATUS => exception_status(reader),
            functions::DIAGNOSTICS => diagnostics(reader),
            functions::GET_COMM_EVENT_COUNTER => event_counter(reader),
            functions::GET_COMM_EVENT_LOG => event_log(reader),
            functions::WRITE_MULTIPLE_COILS => write_multiple(function, MAX_WRITE_BITS, reader),
            functions::WRITE_MULTIPLE_REGISTERS => {
                write_multiple(function, MAX_WRITE_REGISTERS, reader)
            }
            functions::REPORT_SERVER_ID => server_id(reader),
            functions::READ_FILE_RECORD => read_file_record(reader),
            functions::WRITE_FILE_RECORD => write_file_record(reader),
            functions::MASK_WRITE_REGISTER => mask_write_register(reader),
            functions::READ_FIFO_QUEUE => fifo_queue(reader),
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => encapsulated(reader),
            function if function & EXCEPTION != 0 => parse_exception(function, reader),
            function => {
                let declared = custom::find(functions, function);
                match length::check(pdu, function, declared.map(|it| it.response)) {
                    Err(Error::ILLEGAL_FUNCTION) => Err(Error::INVALID_FUNCTION),
                    checked => checked.map(|()| {
                        let data = reader.rest();
                        Response::Custom { function, data }
                    }),
                }
            }
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
    /// response is sent; [`Error::BUFFER_TOO_SMALL`] if it does not fit.
    pub fn emit(&self, pdu: &mut [u8]) -> Result<usize, Error> {
        let mut writer = Writer::new(pdu);
        self.write(&mut writer);
        if writer.length() > MAX_PDU {
            return Err(Error::MALFORMED_REPLY);
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
            Err(Error::INVALID_FUNCTION)
        }
    }

    fn write(&self, writer: &mut Writer) {
        match *self {
            Response::ReadBits { function, data } | Response::ReadRegisters { function, data } => {
                writer.u8(function);
                writer.counted(data);
            }
            Response::WriteSingleCoil { address, on } => {
                emit_write_single_coil(writer, address, on);
            }
            Response::WriteSingleRegister { address, value } => {
                writer.u8(functions::WRITE_SINGLE_REGISTER);
                writer.u16(address);
                writer.u16(value);
            }
            Response::ExceptionStatus { outputs } => {
                writer.u8(functions::READ_EXCEPTION_STATUS);
                writer.u8(outputs);
            }
            Response::Diagnostics { sub_function, data } => {
                emit_diagnostics(writer, sub_function, data);
            }
            Response::CommEventCounter { status, events } => {
                writer.u8(functions::GET_COMM_EVENT_COUNTER);
                writer.u16(status);
                writer.u16(events);
            }
            Response::CommEventLog {
                status,
                events,
                messages,
                log,
            } => emit_event_log(writer, [status, events, messages], log),
            Response::WriteMultiple {
                function,
                address,
                quantity,
            } => {
                writer.u8(function);
                writer.u16(address);
                writer.u16(quantity);
            }
            Response::ServerId { count, data } => {
                writer.u8(functions::REPORT_SERVER_ID);
                writer.u8(count);
                writer.put(data);
            }
            Response::ReadFileRecord(Records(groups))
            | Response::WriteFileRecord(Writes(groups)) => {
                writer.u8(self.function());
                writer.counted(groups);
            }
            Response::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            } => emit_mask_write_register(writer, address, and_mask, or_mask),
            Response::FifoQueue { data } => emit_fifo_queue(writer, data),
            Response::DeviceIdentification {
                code,
                conformity,
                more_follows,
                next_object,
                objects,
            } => emit_device_identification(
                writer,
                [code, conformity],
                more_follows,
                next_object,
                objects,
            ),
            Response::EncapsulatedInterface { mei_type, data } => {
                emit_encapsulated(writer, mei_type, data);
            }
            Response::Exception { function, code } => {
                writer.u8(function | EXCEPTION);
                writer.u8(code);
            }
            Response::Custom { function, data } => {
                writer.u8(function);
                writer.put(data);
            }
        }
    }
}

fn parse_exception<'a>(function: u8, reader: &mut Reader) -> Result<Response<'a>, Error> {
    let code = reader.u8().ok_or(Error::MALFORMED_REPLY)?;
    if Status::exception(code) == Status::MALFORMED_REPLY {
        return Err(Error::MALFORMED_REPLY);
    }
    Ok(Response::Exception {
        function: function & !EXCEPTION,
        code,
    })
}

fn read_bits<'a>(function: u8, reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let data = counted(reader)?;
    if data.is_empty() || data.len() > usize::from(byte_count(MAX_READ_BITS)) {
        return Err(Error::MALFORMED_REPLY);
    }
    Ok(Response::ReadBits { function, data })
}

fn write_single_coil<'a>(reader: &mut Reader) -> Result<Response<'a>, Error> {
    let (address, value) = (word(reader)?, word(reader)?);
    let on = is_on(value)?;
    Ok(Response::WriteSingleCoil { address, on })
}

fn read_registers<'a>(function: u8, reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let data = counted(reader)?;
    let most = 2 * usize::from(MAX_READ_REGISTERS);
    if data.is_empty() || data.len() > most || !data.len().is_multiple_of(2) {
        return Err(Error::MALFORMED_REPLY);
    }
    Ok(Response::ReadRegisters { function, data })
}

fn write_single_register<'a>(reader: &mut Reader) -> Result<Response<'a>, Error> {
    Ok(Response::WriteSingleRegister {
        address: word(reader)?,
        value: word(reader)?,
    })
}

/// Parses a response of 0F or 10, which writes at most `most` coils or registers.
fn write_multiple<'a>(function: u8, most: u16, reader: &mut Reader) -> Result<Response<'a>, Error> {
    let (address, quantity) = last_range(reader, most)?;
    Ok(Response::WriteMultiple {
        function,
        address,
        quantity,
    })
}

fn mask_write_register<'a>(reader: &mut Reader) -> Result<Response<'a>, Error> {
    Ok(Response::MaskWriteRegister {
        address: word(reader)?,
        and_mask: word(reader)?,
        or_mask: word(reader)?,
    })
}

fn exception_status<'a>(reader: &mut Reader) -> Result<Response<'a>, Error> {
    let outputs = byte(reader)?;
    Ok(Response::ExceptionStatus { outputs })
}

fn diagnostics<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let (sub_function, data) = sub_function_and_data(reader)?;
    if sub_function == sub_function::FORCE_LISTEN_ONLY {
        return Err(Error::MALFORMED_REPLY);
    }
    Ok(Response::Diagnostics { sub_function, data })
}

fn event_counter<'a>(reader: &mut Reader) -> Result<Response<'a>, Error> {
    Ok(Response::CommEventCounter {
        status: word(reader)?,
        events: word(reader)?,
    })
}

fn event_log<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let mut reader = Reader::new(counted(reader)?);
    let (status, events) = (word(&mut reader)?, word(&mut reader)?);
    let messages = word(&mut reader)?;
    let log = reader.rest();
    if log.len() > MAX_EVENTS {
        return Err(Error::ILLEGAL_DATA_VALUE);
    }
    Ok(Response::CommEventLog {
        status,
        events,
        messages,
        log,
    })
}

fn emit_event_log(writer: &mut Writer, words: [u16; 3], log: &[u8]) {
    writer.u8(functions::GET_COMM_EVENT_LOG);
    writer.u8((log.len() as u8).wrapping_add(6));
    for word in words {
        writer.u16(word);
    }
    writer.put(log);
}

/// In some devices the byte count covers only the id, and more bytes follow. So the result
/// contains the count and all bytes after it.
fn server_id<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let count = byte(reader)?;
    let data = reader.rest();
    if usize::from(count) > data.len() {
        return Err(Error::ILLEGAL_DATA_VALUE);
    }
    Ok(Response::ServerId { count, data })
}

fn read_file_record<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    Ok(Response::ReadFileRecord(Records::new(counted(reader)?)?))
}

fn write_file_record<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    Ok(Response::WriteFileRecord(Writes::new(counted(reader)?)?))
}

fn fifo_queue<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let (bytes, count) = (word(reader)?, word(reader)?);
    let data = reader.rest();
    let agree = count <= MAX_FIFO && bytes == 2 + 2 * count && data.len() == 2 * usize::from(count);
    if !agree {
        return Err(Error::ILLEGAL_DATA_VALUE);
    }
    Ok(Response::FifoQueue { data })
}

fn emit_fifo_queue(writer: &mut Writer, data: &[u8]) {
    writer.u8(functions::READ_FIFO_QUEUE);
    writer.u16((data.len() as u16).wrapping_add(2));
    writer.u16(data.len() as u16 / 2);
    writer.put(data);
}

fn encapsulated<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Error> {
    let mei_type = byte(reader)?;
    if mei_type != MEI_READ_DEVICE_IDENTIFICATION {
        let data = reader.rest();
        return Ok(Response::EncapsulatedInterface { mei_type, data });
    }
    let code = byte(reader)?;
    let reply = read_reply(code, reader)?;
    Ok(Response::DeviceIdentification {
        code,
        conformity: reply.conformity,
        more_follows: reply.more_follows,
        next_object: reply.next_object,
        objects: reply.objects,
    })
}

fn emit_device_identification(
    writer: &mut Writer,
    head: [u8; 2],
    more_follows: bool,
    next_object: u8,
    objects: ObjectList,
) {
    let [code, conformity] = head;
    let more = if more_follows { MORE } else { 0 };
    let head = [code, conformity, more, next_object, objects.count];
    emit_encapsulated(writer, MEI_READ_DEVICE_IDENTIFICATION, &head);
    writer.put(objects.bytes);
}
