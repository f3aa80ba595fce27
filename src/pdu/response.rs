//! Parses and writes complete response PDUs. The data of a parsed response borrow from its
//! bytes.

use super::files::{Records, Writes};
use super::functions;
use super::limits::{MAX_PDU, MAX_WRITE_BITS, MAX_WRITE_REGISTERS};
pub use super::message::Response;
use super::{bits, custom, diagnostics, files, identification, length, registers, EXCEPTION};
use crate::bytes::{Reader, Writer};
use crate::error::Status;
use core::mem::discriminant;

impl<'a> Response<'a> {
    /// Parses a response PDU. The functions 65 to 72 and 100 to 110 are user-defined.
    ///
    /// # Errors
    /// [`Status::INVALID_FUNCTION`] for an unknown function, [`Status::MALFORMED_REPLY`] for
    /// all other errors.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Status> {
        Response::parse_with(pdu, &[])
    }

    /// As [`Response::parse`], with declared user-defined functions, whose PDUs must have the
    /// declared length.
    ///
    /// # Errors
    /// As [`Response::parse`].
    pub fn parse_with(pdu: &'a [u8], functions: &[custom::Function]) -> Result<Self, Status> {
        let mut reader = Reader::new(pdu);
        // The variable is changed in place: moving it would cost as much time as parsing.
        let mut response = Response::read(pdu, &mut reader, functions);
        let in_order = match response {
            Ok(_) => reader.is_empty() && pdu.len() <= MAX_PDU,
            Err(status) => status == Status::INVALID_FUNCTION && pdu.len() <= MAX_PDU,
        };
        if !in_order {
            response = Err(Status::MALFORMED_REPLY);
        }
        response
    }

    fn read(
        pdu: &[u8],
        reader: &mut Reader<'a>,
        functions: &[custom::Function],
    ) -> Result<Self, Status> {
        let function = reader.u8().ok_or(Status::MALFORMED_REPLY)?;
        match function {
            functions::READ_COILS | functions::READ_DISCRETE_INPUTS => {
                bits::parse_read_response(function, reader)
            }
            functions::READ_HOLDING_REGISTERS
            | functions::READ_INPUT_REGISTERS
            | functions::READ_WRITE_MULTIPLE_REGISTERS => {
                registers::parse_read_response(function, reader)
            }
            functions::WRITE_SINGLE_COIL => bits::parse_write_single_response(reader),
            functions::WRITE_SINGLE_REGISTER => registers::parse_write_single_response(reader),
            functions::READ_EXCEPTION_STATUS => diagnostics::parse_exception_status(reader),
            functions::DIAGNOSTICS => diagnostics::parse_diagnostics_response(reader),
            functions::GET_COMM_EVENT_COUNTER => diagnostics::parse_event_counter(reader),
            functions::GET_COMM_EVENT_LOG => diagnostics::parse_event_log(reader),
            functions::WRITE_MULTIPLE_COILS => {
                registers::parse_write_multiple_response(function, MAX_WRITE_BITS, reader)
            }
            functions::WRITE_MULTIPLE_REGISTERS => {
                registers::parse_write_multiple_response(function, MAX_WRITE_REGISTERS, reader)
            }
            functions::REPORT_SERVER_ID => diagnostics::parse_server_id(reader),
            functions::READ_FILE_RECORD => files::parse_read_response(reader),
            functions::WRITE_FILE_RECORD => files::parse_write_response(reader),
            functions::MASK_WRITE_REGISTER => registers::parse_mask_write_response(reader),
            functions::READ_FIFO_QUEUE => files::parse_fifo_response(reader),
            functions::ENCAPSULATED_INTERFACE_TRANSPORT => identification::parse_response(reader),
            function if function & EXCEPTION != 0 => parse_exception(function, reader),
            function => {
                let declared = custom::find(functions, function);
                match length::check(pdu, function, declared.map(|it| it.response)) {
                    Err(Status::ILLEGAL_FUNCTION) => Err(Status::INVALID_FUNCTION),
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
    /// response is sent; [`Status::BUFFER_TOO_SMALL`] if it does not fit.
    pub fn emit(&self, pdu: &mut [u8]) -> Result<usize, Status> {
        let mut writer = Writer::new(pdu);
        self.write(&mut writer);
        if writer.length() > MAX_PDU {
            return Err(Status::MALFORMED_REPLY);
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
            Err(Status::INVALID_FUNCTION)
        }
    }

    fn write(&self, writer: &mut Writer) {
        match *self {
            Response::ReadBits { function, data } | Response::ReadRegisters { function, data } => {
                writer.u8(function);
                writer.counted(data);
            }
            Response::WriteSingleCoil { address, on } => {
                bits::emit_write_single(writer, address, on);
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
                diagnostics::emit_diagnostics(writer, sub_function, data);
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
            } => diagnostics::emit_event_log(writer, [status, events, messages], log),
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
            } => registers::emit_mask_write(writer, address, and_mask, or_mask),
            Response::FifoQueue { data } => files::emit_fifo_response(writer, data),
            Response::DeviceIdentification {
                code,
                conformity,
                more_follows,
                next_object,
                objects,
            } => identification::emit_identification_response(
                writer,
                [code, conformity],
                more_follows,
                next_object,
                objects,
            ),
            Response::EncapsulatedInterface { mei_type, data } => {
                identification::emit(writer, mei_type, data);
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

fn parse_exception<'a>(function: u8, reader: &mut Reader) -> Result<Response<'a>, Status> {
    let code = reader.u8().ok_or(Status::MALFORMED_REPLY)?;
    if Status::exception(code) == Status::MALFORMED_REPLY {
        return Err(Status::MALFORMED_REPLY);
    }
    Ok(Response::Exception {
        function: function & !EXCEPTION,
        code,
    })
}
