//! A request PDU, taken apart: [`Request::parse`] and [`Request::emit`]. The data of a parsed request
//! borrow from its bytes.

use super::custom;
use super::diagnostics::{sub_function, sub_function_and_data};
use super::fields::{
    byte, byte_count, check_end_and_range, check_within, counted, emit_diagnostics,
    emit_encapsulated, emit_mask_write_register, emit_write_single_coil, expect_end, is_on,
    last_range, word,
};
use super::files::{Reads, Writes};
use super::functions;
use super::identification::{BASIC, INDIVIDUAL, MEI_READ_DEVICE_IDENTIFICATION};
use super::length::{self, Length};
use super::limits::{
    MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS, MAX_WRITE_BITS,
    MAX_WRITE_REGISTERS,
};
use crate::bytes::{Reader, Writer};
use crate::error::Error;
use core::mem::discriminant;

/// A request PDU. Register data are in the order of the wire, high byte first. The first bit
/// of bit data is the lowest bit of the first byte.
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
    /// The exception that a server answers: [`Error::ILLEGAL_FUNCTION`] for
    /// an unknown function or sub-function, [`Error::ILLEGAL_DATA_VALUE`] for
    /// a wrong length, quantity or value, [`Error::ILLEGAL_DATA_ADDRESS`] for addresses beyond
    /// 65535.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Error> {
        Request::parse_with(pdu, &[])
    }

    /// As [`Request::parse`], with declared user-defined functions, whose PDUs must have the
    /// declared length.
    ///
    /// # Errors
    /// As [`Request::parse`].
    pub fn parse_with(pdu: &'a [u8], functions: &[custom::Function]) -> Result<Self, Error> {
        let mut reader = Reader::new(pdu);
        // The variable is changed in place: moving it would cost as much time as parsing.
        let mut request = Request::read(pdu, &mut reader, functions);
        if (request.is_ok() && !reader.is_empty()) || pdu.len() > MAX_PDU {
            request = Err(Error::ILLEGAL_DATA_VALUE);
        }
        request
    }

    fn read(
        pdu: &[u8],
        reader: &mut Reader<'a>,
        functions: &[custom::Function],
    ) -> Result<Self, Error> {
        let function = reader.u8().ok_or(Error::ILLEGAL_FUNCTION)?;
        match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => read_bits(function, reader),
            functions::READ_HOLDING_REGISTERS | functions::READ_INPUT_REGISTERS => {
                read_registers(function, reader)
            }
            functions::WRITE_SINGLE_COIL => write_single_coil(reader),
            functions::WRITE_SINGLE_REGISTER => write_single_register(reader),
            functions::READ_EXCEPTION_STATUS => Ok(Request::ReadExceptionStatus),
            functions::DIAGNOSTICS => diagnostics(reader),
            functions::GET_COMM_EVENT_COUNTER => Ok(Request::GetCommEventCounter),
            functions::GET_COMM_EVENT_LOG => Ok(Request::GetCommEventLog),
            functions::WRITE_MULTIPLE_COILS => write_multiple_coils(reader),
            functions::WRITE_MULTIPLE_REGISTERS => write_multiple_registers(reader),
            functions::REPORT_SERVER_ID => Ok(Request::ReportServerId),
            functions::READ_FILE_RECORD => read_file_record(reader),
            functions::WRITE_FILE_RECORD => write_file_record(reader),
            functions::MASK_WRITE_REGISTER => mask_write_register(reader),
            functions::READ_WRITE_MULTIPLE_REGISTERS => read_write_registers(reader),
            functions::READ_FIFO_QUEUE => read_fifo_queue(reader),
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => encapsulated(reader),
            function => {
                let declared = custom::find(functions, function);
                length::check(pdu, function, declared.map(|it| it.request))?;
                let data = reader.rest();
                Ok(Request::Custom { function, data })
            }
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
    /// request is sent; [`Error::BUFFER_TOO_SMALL`] if it does not fit.
    pub fn emit(&self, pdu: &mut [u8]) -> Result<usize, Error> {
        let mut writer = Writer::new(pdu);
        self.write(&mut writer);
        if writer.length() > MAX_PDU {
            return Err(Error::ILLEGAL_DATA_VALUE);
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
            Err(Error::ILLEGAL_FUNCTION)
        }
    }

    fn write(&self, writer: &mut Writer) {
        match *self {
            Request::ReadBits {
                function,
                address,
                quantity,
            }
            | Request::ReadRegisters {
                function,
                address,
                quantity,
            } => {
                writer.u8(function);
                writer.u16(address);
                writer.u16(quantity);
            }
            Request::WriteSingleCoil { address, on } => {
                emit_write_single_coil(writer, address, on);
            }
            Request::WriteSingleRegister { address, value } => {
                writer.u8(functions::WRITE_SINGLE_REGISTER);
                writer.u16(address);
                writer.u16(value);
            }
            Request::ReadExceptionStatus
            | Request::GetCommEventCounter
            | Request::GetCommEventLog
            | Request::ReportServerId => writer.u8(self.function()),
            Request::Diagnostics { sub_function, data } => {
                emit_diagnostics(writer, sub_function, data);
            }
            Request::WriteMultipleCoils {
                address,
                quantity,
                data,
            }
            | Request::WriteMultipleRegisters {
                address,
                quantity,
                data,
            } => {
                writer.u8(self.function());
                writer.u16(address);
                writer.u16(quantity);
                writer.counted(data);
            }
            Request::ReadFileRecord(Reads(groups)) | Request::WriteFileRecord(Writes(groups)) => {
                writer.u8(self.function());
                writer.counted(groups);
            }
            Request::MaskWriteRegister {
                address,
                and_mask,
                or_mask,
            } => emit_mask_write_register(writer, address, and_mask, or_mask),
            Request::ReadWriteMultipleRegisters {
                read_address,
                read_quantity,
                write_address,
                write_quantity,
                data,
            } => {
                writer.u8(functions::READ_WRITE_MULTIPLE_REGISTERS);
                writer.u16(read_address);
                writer.u16(read_quantity);
                writer.u16(write_address);
                writer.u16(write_quantity);
                writer.counted(data);
            }
            Request::ReadFifoQueue { address } => {
                writer.u8(functions::READ_FIFO_QUEUE);
                writer.u16(address);
            }
            Request::ReadDeviceIdentification { code, object } => {
                emit_encapsulated(writer, MEI_READ_DEVICE_IDENTIFICATION, &[code, object]);
            }
            Request::EncapsulatedInterface { mei_type, data } => {
                emit_encapsulated(writer, mei_type, data);
            }
            Request::Custom { function, data } => {
                writer.u8(function);
                writer.put(data);
            }
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

fn read_bits<'a>(function: u8, reader: &mut Reader) -> Result<Request<'a>, Error> {
    let (address, quantity) = last_range(reader, MAX_READ_BITS)?;
    Ok(Request::ReadBits {
        function,
        address,
        quantity,
    })
}

fn write_single_coil<'a>(reader: &mut Reader) -> Result<Request<'a>, Error> {
    let (address, value) = (word(reader)?, word(reader)?);
    let on = is_on(value)?;
    Ok(Request::WriteSingleCoil { address, on })
}

fn write_multiple_coils<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    let data = counted(reader)?;
    if data.len() != usize::from(byte_count(quantity)) {
        return Err(Error::ILLEGAL_DATA_VALUE);
    }
    check_end_and_range(reader, address, quantity, MAX_WRITE_BITS)?;
    Ok(Request::WriteMultipleCoils {
        address,
        quantity,
        data,
    })
}

fn read_registers<'a>(function: u8, reader: &mut Reader) -> Result<Request<'a>, Error> {
    let (address, quantity) = last_range(reader, MAX_READ_REGISTERS)?;
    Ok(Request::ReadRegisters {
        function,
        address,
        quantity,
    })
}

fn write_single_register<'a>(reader: &mut Reader) -> Result<Request<'a>, Error> {
    Ok(Request::WriteSingleRegister {
        address: word(reader)?,
        value: word(reader)?,
    })
}

fn write_multiple_registers<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    let data = values(reader, quantity)?;
    check_end_and_range(reader, address, quantity, MAX_WRITE_REGISTERS)?;
    Ok(Request::WriteMultipleRegisters {
        address,
        quantity,
        data,
    })
}

fn mask_write_register<'a>(reader: &mut Reader) -> Result<Request<'a>, Error> {
    Ok(Request::MaskWriteRegister {
        address: word(reader)?,
        and_mask: word(reader)?,
        or_mask: word(reader)?,
    })
}

fn read_write_registers<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let (read_address, read_quantity) = (word(reader)?, word(reader)?);
    let (write_address, write_quantity) = (word(reader)?, word(reader)?);
    let data = values(reader, write_quantity)?;
    // Both quantities are checked before both ranges of addresses.
    let most = usize::from(MAX_READ_WRITE_REGISTERS);
    check_within(usize::from(write_quantity), (1, most))?;
    check_end_and_range(reader, read_address, read_quantity, MAX_READ_REGISTERS)?;
    check_end_and_range(
        reader,
        write_address,
        write_quantity,
        MAX_READ_WRITE_REGISTERS,
    )?;
    Ok(Request::ReadWriteMultipleRegisters {
        read_address,
        read_quantity,
        write_address,
        write_quantity,
        data,
    })
}

/// Reads a byte count and the data of `quantity` registers.
fn values<'a>(reader: &mut Reader<'a>, quantity: u16) -> Result<&'a [u8], Error> {
    let data = counted(reader)?;
    if data.len().is_multiple_of(2) && data.len() / 2 == usize::from(quantity) {
        Ok(data)
    } else {
        Err(Error::ILLEGAL_DATA_VALUE)
    }
}

fn diagnostics<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let (sub_function, data) = sub_function_and_data(reader)?;
    let allowed = match (sub_function, data) {
        (sub_function::RETURN_QUERY_DATA, _) => true,
        (sub_function::RESTART_COMMUNICATIONS, [0x00 | 0xFF, 0]) => true,
        (sub_function::CHANGE_ASCII_INPUT_DELIMITER, [_, 0]) => true,
        (_, data) => matches!(data, [0, 0]),
    };
    if allowed {
        Ok(Request::Diagnostics { sub_function, data })
    } else {
        Err(Error::ILLEGAL_DATA_VALUE)
    }
}

fn read_file_record<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let bytes = counted(reader)?;
    expect_end(reader)?;
    Ok(Request::ReadFileRecord(Reads::new(bytes)?))
}

fn write_file_record<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let bytes = counted(reader)?;
    expect_end(reader)?;
    Ok(Request::WriteFileRecord(Writes::new(bytes)?))
}

fn read_fifo_queue<'a>(reader: &mut Reader) -> Result<Request<'a>, Error> {
    let address = word(reader)?;
    Ok(Request::ReadFifoQueue { address })
}

fn encapsulated<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Error> {
    let mei_type = byte(reader)?;
    if mei_type != MEI_READ_DEVICE_IDENTIFICATION {
        let data = reader.rest();
        return Ok(Request::EncapsulatedInterface { mei_type, data });
    }
    let (code, object) = (byte(reader)?, byte(reader)?);
    if !(BASIC..=INDIVIDUAL).contains(&code) {
        return Err(Error::ILLEGAL_DATA_VALUE);
    }
    Ok(Request::ReadDeviceIdentification { code, object })
}
