//! Parses and writes complete request PDUs. The data of a parsed request borrow from its
//! bytes.

use super::files::{Reads, Writes};
use super::functions;
use super::length::{self, Length};
use super::limits::MAX_PDU;
pub use super::message::Request;
use super::{bits, custom, diagnostics, files, identification, registers};
use crate::bytes::{Reader, Writer};
use crate::error::Status;
use core::mem::discriminant;

impl<'a> Request<'a> {
    /// Parses a request PDU. The functions 65 to 72 and 100 to 110 are user-defined.
    ///
    /// # Errors
    /// The exception that a server answers: [`Status::ILLEGAL_FUNCTION`] for
    /// an unknown function or sub-function, [`Status::ILLEGAL_DATA_VALUE`] for
    /// a wrong length, quantity or value, [`Status::ILLEGAL_DATA_ADDRESS`] for addresses beyond
    /// 65535.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Status> {
        Request::parse_with(pdu, &[])
    }

    /// As [`Request::parse`], with declared user-defined functions, whose PDUs must have the
    /// declared length.
    ///
    /// # Errors
    /// As [`Request::parse`].
    pub fn parse_with(pdu: &'a [u8], functions: &[custom::Function]) -> Result<Self, Status> {
        let mut reader = Reader::new(pdu);
        // The variable is changed in place: moving it would cost as much time as parsing.
        let mut request = Request::read(pdu, &mut reader, functions);
        if (request.is_ok() && !reader.is_empty()) || pdu.len() > MAX_PDU {
            request = Err(Status::ILLEGAL_DATA_VALUE);
        }
        request
    }

    fn read(
        pdu: &[u8],
        reader: &mut Reader<'a>,
        functions: &[custom::Function],
    ) -> Result<Self, Status> {
        let function = reader.u8().ok_or(Status::ILLEGAL_FUNCTION)?;
        match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => {
                bits::parse_read(function, reader)
            }
            functions::READ_HOLDING_REGISTERS | functions::READ_INPUT_REGISTERS => {
                registers::parse_read(function, reader)
            }
            functions::WRITE_SINGLE_COIL => bits::parse_write_single(reader),
            functions::WRITE_SINGLE_REGISTER => registers::parse_write_single(reader),
            functions::READ_EXCEPTION_STATUS => Ok(Request::ReadExceptionStatus),
            functions::DIAGNOSTICS => diagnostics::parse_diagnostics(reader),
            functions::GET_COMM_EVENT_COUNTER => Ok(Request::GetCommEventCounter),
            functions::GET_COMM_EVENT_LOG => Ok(Request::GetCommEventLog),
            functions::WRITE_MULTIPLE_COILS => bits::parse_write_multiple(reader),
            functions::WRITE_MULTIPLE_REGISTERS => registers::parse_write_multiple(reader),
            functions::REPORT_SERVER_ID => Ok(Request::ReportServerId),
            functions::READ_FILE_RECORD => files::parse_read(reader),
            functions::WRITE_FILE_RECORD => files::parse_write(reader),
            functions::MASK_WRITE_REGISTER => registers::parse_mask_write(reader),
            functions::READ_WRITE_MULTIPLE_REGISTERS => registers::parse_read_write(reader),
            functions::READ_FIFO_QUEUE => files::parse_fifo(reader),
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => identification::parse(reader),
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
    /// request is sent; [`Status::BUFFER_TOO_SMALL`] if it does not fit.
    pub fn emit(&self, pdu: &mut [u8]) -> Result<usize, Status> {
        let mut writer = Writer::new(pdu);
        self.write(&mut writer);
        if writer.length() > MAX_PDU {
            return Err(Status::ILLEGAL_DATA_VALUE);
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
            Err(Status::ILLEGAL_FUNCTION)
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
                bits::emit_write_single(writer, address, on);
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
                diagnostics::emit_diagnostics(writer, sub_function, data);
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
            } => registers::emit_mask_write(writer, address, and_mask, or_mask),
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
                identification::emit_identification(writer, code, object);
            }
            Request::EncapsulatedInterface { mei_type, data } => {
                identification::emit(writer, mei_type, data);
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
                sub_function: diagnostics::sub_function::FORCE_LISTEN_ONLY,
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
