//! Describes requests and responses in words, one line each.

pub mod names;
mod writer;

pub use writer::TextWriter;

use crate::bytes::Reader;
use crate::error::Error;
use crate::frame::{ascii, rtu, tcp, Adu, Framing};
use crate::packet::PduKind;
use crate::pdu::diagnostics::sub_function as sub;
use crate::pdu::diagnostics::CLEAR_LOG;
use crate::pdu::files::{Reads, Record, Writes};
use crate::pdu::functions;
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::pdu::EXCEPTION;

/// Number of bytes at the start of a request PDU that are needed to describe its reply.
pub const HEAD: usize = 9;

/// Writes the unit, then the word `what`, in columns of fixed width.
pub fn start(line: &mut TextWriter, unit: u8, what: &str) {
    line.put("unit ");
    line.number(unit.into());
    line.put(if unit < 10 {
        "   "
    } else if unit < 100 {
        "  "
    } else {
        " "
    });
    line.padded(what, 11);
}

/// Writes `what` and a number of bytes, for bytes that are no valid frame.
pub fn bytes(line: &mut TextWriter, what: &str, count: usize) {
    line.put(what);
    line.put(", ");
    line.number(count as u32);
    line.put(if count == 1 { " byte" } else { " bytes" });
}

/// Describes the content of a frame, or its error. `end` is the last character of an ASCII
/// frame.
pub fn frame(line: &mut TextWriter, framing: Framing, side: PduKind, frame: &[u8], end: u8) {
    let parsed = match framing {
        Framing::Rtu | Framing::RtuOverTcp => rtu::parse(frame),
        Framing::Tcp => tcp::parse(frame),
        Framing::Ascii => return characters(line, side, frame, end),
    };
    adu(line, side, parsed, frame.len());
}

/// As [`frame`], for an ASCII frame, which is decoded in a copy on the stack.
#[inline(never)]
fn characters(line: &mut TextWriter, side: PduKind, frame: &[u8], end: u8) {
    let mut copy = [0; ascii::MAX_FRAME];
    let parsed = match copy.get_mut(..frame.len()) {
        Some(copy) => {
            for (to, from) in copy.iter_mut().zip(frame) {
                *to = *from;
            }
            ascii::parse(copy, end)
        }
        None => Err(Error::MALFORMED_FRAME),
    };
    adu(line, side, parsed, frame.len());
}

/// Describes a decoded frame, or the error of a frame of `length` bytes.
fn adu(line: &mut TextWriter, side: PduKind, parsed: Result<Adu, Error>, length: usize) {
    match parsed {
        Ok(adu) if side == PduKind::Request => {
            start(line, adu.unit, "request");
            request(line, adu.pdu);
        }
        Ok(adu) => {
            let is_exception = adu.pdu.first().is_some_and(|code| code & EXCEPTION != 0);
            start(
                line,
                adu.unit,
                if is_exception { "exception" } else { "reply" },
            );
            response(line, adu.pdu, &[]);
        }
        Err(Error::INVALID_CRC) => bytes(line, "bad CRC", length),
        Err(Error::INCOMPLETE_FRAME) => bytes(line, "incomplete frame", length),
        Err(_) => bytes(line, "no frame", length),
    }
}

/// Writes the code and the name of a function.
fn function(line: &mut TextWriter, code: u8) {
    line.hex(code);
    line.byte(b' ');
    line.put(functions::name(code));
}

/// Writes the first and the last of `quantity` addresses. The last may be greater than 65535,
/// because the request may be wrong.
fn range(line: &mut TextWriter, address: u16, quantity: u16) {
    line.number(address.into());
    if quantity != 1 {
        line.put("..");
        line.number((u32::from(address) + u32::from(quantity)).saturating_sub(1));
    }
}

fn records(line: &mut TextWriter, record: Record) {
    line.put(" file ");
    line.number(record.file.into());
    line.put(if record.length == 1 {
        " record "
    } else {
        " records "
    });
    range(line, record.record, record.length);
}

fn writes(line: &mut TextWriter, writes: &Writes) {
    let mut first = true;
    for (record, data) in writes.iter() {
        line.put(if first { " " } else { "," });
        first = false;
        records(line, record);
        line.byte(b':');
        line.registers(data);
    }
}

fn masks(line: &mut TextWriter, address: u16, and_mask: u16, or_mask: u16) {
    line.number(address.into());
    line.put(": and ");
    line.hex_word(and_mask);
    line.put(" or ");
    line.hex_word(or_mask);
}

fn diagnostics(line: &mut TextWriter, code: u16, data: &[u8], is_response: bool) {
    line.put(", ");
    line.put(names::sub_function(code));
    match (code, data) {
        (sub::RETURN_QUERY_DATA, data) => {
            line.byte(b':');
            line.bytes(data);
        }
        (sub::RESTART_COMMUNICATIONS, data) if data == CLEAR_LOG.to_be_bytes() => {
            line.put(" and clear the log");
        }
        (sub::CHANGE_ASCII_INPUT_DELIMITER, [character, ..]) => {
            line.put(": ");
            line.hex(*character);
        }
        (sub::RETURN_DIAGNOSTIC_REGISTER, [high, low]) if is_response => {
            line.put(": ");
            line.hex_word(u16::from_be_bytes([*high, *low]));
        }
        (sub::BUS_MESSAGE_COUNT..=sub::BUS_CHARACTER_OVERRUN_COUNT, data) if is_response => {
            line.byte(b':');
            line.registers(data);
        }
        _ => (),
    }
}

/// Writes a PDU that cannot be decoded, as bytes.
fn malformed(line: &mut TextWriter, pdu: &[u8]) {
    if let Some((code, data)) = pdu.split_first() {
        function(line, *code);
        line.put(", malformed:");
        line.bytes(data);
    } else {
        line.put("no function");
    }
}

/// Writes data of unknown meaning, as bytes.
fn raw(line: &mut TextWriter, data: &[u8]) {
    if !data.is_empty() {
        line.byte(b':');
        line.bytes(data);
    }
}

/// Writes a PDU with an unknown function code. Returns false, and writes nothing, if the
/// function is known.
fn unknown(line: &mut TextWriter, pdu: &[u8]) -> bool {
    match pdu.split_first() {
        Some((code, data)) if functions::name(*code) == functions::name(0) => {
            function(line, *code);
            raw(line, data);
            true
        }
        _ => false,
    }
}

/// Describes a request PDU.
pub fn request(line: &mut TextWriter, pdu: &[u8]) {
    if unknown(line, pdu) {
        return;
    }
    let Ok(request) = Request::parse(pdu) else {
        return malformed(line, pdu);
    };
    function(line, request.function());
    match request {
        Request::ReadBits {
            address, quantity, ..
        }
        | Request::ReadRegisters {
            address, quantity, ..
        } => {
            line.put("  ");
            range(line, address, quantity);
        }
        Request::WriteSingleCoil { address, on } => single_coil(line, address, on),
        Request::WriteSingleRegister { address, value } => single_register(line, address, value),
        Request::ReadExceptionStatus
        | Request::GetCommEventCounter
        | Request::GetCommEventLog
        | Request::ReportServerId => (),
        Request::Diagnostics { sub_function, data } => {
            diagnostics(line, sub_function, data, false);
        }
        Request::WriteMultipleCoils {
            address,
            quantity,
            data,
        } => {
            line.put("  ");
            range(line, address, quantity);
            line.byte(b':');
            line.bits(data, quantity.into());
        }
        Request::WriteMultipleRegisters {
            address,
            quantity,
            data,
        } => {
            line.put("  ");
            range(line, address, quantity);
            line.byte(b':');
            line.registers(data);
        }
        Request::ReadFileRecord(reads) => {
            let mut first = true;
            for record in reads.iter() {
                line.put(if first { " " } else { "," });
                first = false;
                records(line, record);
            }
        }
        Request::WriteFileRecord(groups) => writes(line, &groups),
        Request::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        } => {
            line.put("  ");
            masks(line, address, and_mask, or_mask);
        }
        Request::ReadWriteMultipleRegisters {
            read_address,
            read_quantity,
            write_address,
            write_quantity,
            data,
        } => {
            line.put("  read ");
            range(line, read_address, read_quantity);
            line.put(", write ");
            range(line, write_address, write_quantity);
            line.byte(b':');
            line.registers(data);
        }
        Request::ReadFifoQueue { address } => {
            line.put("  ");
            line.number(address.into());
        }
        Request::ReadDeviceIdentification { code, object } => {
            line.put(", device identification, ");
            line.put(names::device_id(code));
            line.put(", object ");
            line.number(object.into());
        }
        Request::EncapsulatedInterface { mei_type, data } => {
            line.put(", MEI type ");
            line.hex(mei_type);
            raw(line, data);
        }
        Request::Custom { data, .. } => raw(line, data),
    }
}

fn single_coil(line: &mut TextWriter, address: u16, on: bool) {
    line.put("  ");
    line.number(address.into());
    line.put(if on { ": on" } else { ": off" });
}

fn single_register(line: &mut TextWriter, address: u16, value: u16) {
    line.put("  ");
    line.number(address.into());
    line.put(": ");
    line.number(value.into());
}

/// The arguments of a request that its reply does not repeat, read from the first bytes of
/// the request.
#[derive(Clone, Copy)]
enum Arguments {
    Nothing,
    Range(u16, u16),
    Queue(u16),
    Record(Record),
}

/// Reads the arguments from the head of a request PDU.
fn arguments(head: &[u8]) -> Arguments {
    let mut reader = Reader::new(head);
    match reader.u8() {
        Some(
            functions::READ_COILS
            | functions::READ_DISCRETE_INPUTS
            | functions::WRITE_MULTIPLE_COILS
            | functions::READ_HOLDING_REGISTERS
            | functions::READ_INPUT_REGISTERS
            | functions::WRITE_MULTIPLE_REGISTERS
            | functions::READ_WRITE_MULTIPLE_REGISTERS,
        ) => match (reader.u16(), reader.u16()) {
            (Some(address), Some(quantity)) => Arguments::Range(address, quantity),
            _ => Arguments::Nothing,
        },
        Some(functions::READ_FIFO_QUEUE) => {
            reader.u16().map_or(Arguments::Nothing, Arguments::Queue)
        }
        Some(functions::READ_FILE_RECORD) => {
            // The head contains only the first sub-request. Of the records of others, only
            // the data are written.
            let _ = reader.u8();
            let first = Reads::new(reader.rest()).ok();
            let record = first.and_then(|reads| reads.iter().next());
            record.map_or(Arguments::Nothing, Arguments::Record)
        }
        _ => Arguments::Nothing,
    }
}

/// Describes a request PDU of which only the head is known.
pub fn head(line: &mut TextWriter, head: &[u8]) {
    let Some(code) = head.first() else {
        return;
    };
    match arguments(head) {
        _ if Request::parse(head).is_ok() => request(line, head),
        Arguments::Range(address, quantity) => {
            function(line, *code);
            line.put("  ");
            range(line, address, quantity);
        }
        _ => function(line, *code),
    }
}

/// Describes a response PDU. `head` is the head of its request, from which the addresses of
/// the values are taken; it is empty if the request is unknown.
pub fn response(line: &mut TextWriter, pdu: &[u8], head: &[u8]) {
    let is_exception = pdu.first().is_some_and(|code| code & EXCEPTION != 0);
    if !is_exception && unknown(line, pdu) {
        return;
    }
    let Ok(response) = Response::parse(pdu) else {
        return malformed(line, pdu);
    };
    function(line, response.function());
    let asked = arguments(head);
    if let (
        Arguments::Range(address, quantity),
        Response::ReadBits { .. } | Response::ReadRegisters { .. },
    ) = (asked, response)
    {
        line.put("  ");
        range(line, address, quantity);
    }
    match response {
        Response::ReadBits { data, .. } => {
            let count = match asked {
                Arguments::Range(_, quantity) => quantity.into(),
                _ => 8 * data.len(),
            };
            line.byte(b':');
            line.bits(data, count);
        }
        Response::ReadRegisters { data, .. } => {
            line.byte(b':');
            line.registers(data);
        }
        Response::WriteSingleCoil { address, on } => single_coil(line, address, on),
        Response::WriteSingleRegister { address, value } => single_register(line, address, value),
        Response::ExceptionStatus { outputs } => {
            line.byte(b':');
            line.bits(&[outputs], 8);
        }
        Response::Diagnostics { sub_function, data } => diagnostics(line, sub_function, data, true),
        Response::CommEventCounter { status, events } => event_counter(line, status, events),
        Response::CommEventLog {
            status,
            events,
            messages,
            log,
        } => {
            event_counter(line, status, events);
            line.put(", messages ");
            line.number(messages.into());
            raw(line, log);
        }
        Response::WriteMultiple {
            address, quantity, ..
        } => {
            line.put("  ");
            range(line, address, quantity);
        }
        Response::ServerId { data, .. } => {
            raw(line, data);
            line.byte(b' ');
            line.quoted(data);
        }
        Response::ReadFileRecord(groups) => {
            let mut separator = " ";
            for data in groups.iter() {
                line.put(separator);
                if let (Arguments::Record(record), " ") = (asked, separator) {
                    records(line, record);
                    line.byte(b':');
                }
                line.registers(data);
                separator = ",";
            }
        }
        Response::WriteFileRecord(groups) => writes(line, &groups),
        Response::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        } => {
            line.put("  ");
            masks(line, address, and_mask, or_mask);
        }
        Response::FifoQueue { data } => {
            if let Arguments::Queue(address) = asked {
                line.put("  ");
                line.number(address.into());
            }
            line.byte(b':');
            line.registers(data);
        }
        Response::DeviceIdentification {
            code,
            more_follows,
            next_object,
            objects,
            ..
        } => {
            line.put(", device identification, ");
            line.put(names::device_id(code));
            line.byte(b':');
            for (id, value) in objects.iter() {
                line.byte(b' ');
                line.number(id.into());
                line.byte(b' ');
                line.quoted(value);
            }
            if more_follows {
                line.put(", more from object ");
                line.number(next_object.into());
            }
        }
        Response::EncapsulatedInterface { mei_type, data } => {
            line.put(", MEI type ");
            line.hex(mei_type);
            raw(line, data);
        }
        Response::Exception { code, .. } => {
            line.put(": exception ");
            line.hex(code);
            line.byte(b' ');
            line.put(names::exception(code));
        }
        Response::Custom { data, .. } => raw(line, data),
    }
}

fn event_counter(line: &mut TextWriter, status: u16, events: u16) {
    line.put(": status ");
    line.hex_word(status);
    line.put(", events ");
    line.number(events.into());
}
