//! Describes requests and responses in words, one line each.

mod writer;

pub use writer::TextWriter;

use crate::error::Error;
use crate::frame::{ascii, rtu, tcp, Adu, Framing};
use crate::packet::PduKind;
use crate::pdu::diagnostics::sub_function as sub;
use crate::pdu::diagnostics::CLEAR_LOG;
use crate::pdu::fields::{Byte, Data, Fields, Flag, Word};
use crate::pdu::files::{Reads, Record, Writes};
use crate::pdu::functions::{self, READ_FILE_RECORD};
use crate::pdu::identification::{
    BASIC, EXTENDED, INDIVIDUAL, MEI_READ_DEVICE_IDENTIFICATION, REGULAR,
};
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::pdu::EXCEPTION;

/// Number of bytes at the start of a request PDU that are needed to describe its reply.
pub const HEAD: usize = 9;

/// Writes the unit, then the word `what`, in columns of fixed width.
///
/// ```
/// use mbm::text::{start, TextWriter};
///
/// let mut text = [0; 32];
/// let mut line = TextWriter::new(&mut text);
/// start(&mut line, 17, "request");
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"unit 17  request    ");
/// # Ok::<(), mbm::Error>(())
/// ```
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
///
/// ```
/// use mbm::text::{bytes, TextWriter};
///
/// let mut text = [0; 32];
/// let mut line = TextWriter::new(&mut text);
/// bytes(&mut line, "noise", 3);
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"noise, 3 bytes");
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn bytes(line: &mut TextWriter, what: &str, count: usize) {
    line.put(what);
    line.put(", ");
    line.number(count as u32);
    line.put(if count == 1 { " byte" } else { " bytes" });
}

/// Describes the content of a frame, or its error. `end` is the last character of an ASCII
/// frame.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::packet::PduKind;
/// use mbm::text::{frame, TextWriter};
///
/// let mut text = [0; 80];
/// let mut line = TextWriter::new(&mut text);
/// let bytes = [17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55];
/// frame(&mut line, Framing::Rtu, PduKind::Request, &bytes, END);
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"unit 17  request    06 write single register  109: 888");
/// # Ok::<(), mbm::Error>(())
/// ```
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
        None => Err(Error::MalformedFrame),
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
        Err(Error::InvalidCrc) => bytes(line, "bad CRC", length),
        Err(Error::IncompleteFrame) => bytes(line, "incomplete frame", length),
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
    to_last(line, address, quantity);
}

/// Writes the last of `quantity` addresses, if there are several.
fn to_last(line: &mut TextWriter, address: u16, quantity: u16) {
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

fn diagnostics(line: &mut TextWriter, code: u16, data: &[u8], is_response: bool) {
    line.put(", ");
    line.put(sub_function_name(code));
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
///
/// ```
/// use mbm::text::{request, TextWriter};
///
/// let mut text = [0; 80];
/// let mut line = TextWriter::new(&mut text);
/// request(&mut line, &[3, 0, 107, 0, 2]);
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"03 read holding registers  107..108");
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn request(line: &mut TextWriter, pdu: &[u8]) {
    if unknown(line, pdu) {
        return;
    }
    let Ok(request) = Request::parse(pdu) else {
        return malformed(line, pdu);
    };
    function(line, request.function());
    match request {
        Request::Diagnostics { sub_function, data } => {
            diagnostics(line, sub_function, data, false);
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
        request => request.give(&mut Words::new(line, &[])),
    }
}

/// The first record of a request of function 14. For other functions only the data of the
/// records are written.
fn first_record(head: &[u8]) -> Option<Record> {
    match head {
        [READ_FILE_RECORD, _, groups @ ..] => Reads::new(groups).ok()?.iter().next(),
        _ => None,
    }
}

/// Describes the fields of a request or response in words.
struct Words<'a, 'b> {
    line: &'a mut TextWriter<'b>,
    /// The first address and the quantity of the request of a response.
    asked: (Option<u16>, Option<u16>),
    /// The address that was last written.
    address: Option<u16>,
    /// The quantity of the request or response, or of the request of a response.
    quantity: Option<u16>,
}

impl<'a, 'b> Words<'a, 'b> {
    /// `head` is the head of the request of a response; it is empty for a request.
    fn new(line: &'a mut TextWriter<'b>, head: &[u8]) -> Self {
        let asked = functions::range(head);
        Words {
            line,
            asked,
            address: None,
            quantity: asked.1,
        }
    }

    fn address(&mut self, before: &str, address: u16) {
        self.line.put(before);
        self.line.number(address.into());
        self.address = Some(address);
    }

    fn masked(&mut self, before: &str, mask: u16) {
        self.line.put(before);
        self.line.hex_word(mask);
    }

    fn number(&mut self, before: &str, number: u16) {
        self.line.put(before);
        self.line.number(number.into());
    }

    /// Writes the address and the quantity of the request, unless the response has an address.
    fn range_asked(&mut self) {
        if let (None, (Some(address), quantity)) = (self.address, self.asked) {
            self.line.put("  ");
            range(self.line, address, quantity.unwrap_or(1));
        }
    }
}

impl<'a> Fields<'a> for Words<'_, '_> {
    const IS_SOURCE: bool = false;

    fn byte(&mut self, field: Byte, value: &mut u8) {
        let line = &mut *self.line;
        match (field, *value) {
            (Byte::ExceptionStatus, outputs) => {
                line.byte(b':');
                line.bits(&[outputs], 8);
            }
            (Byte::ExceptionCode, code) => {
                line.put(": exception ");
                line.hex(code);
                line.byte(b' ');
                line.put(exception_name(code));
            }
            // The read device id code follows.
            (Byte::MeiType, MEI_READ_DEVICE_IDENTIFICATION) => (),
            (Byte::MeiType, mei_type) => {
                line.put(", MEI type ");
                line.hex(mei_type);
            }
            (Byte::ReadDeviceIdCode, code) => {
                line.put(", device identification, ");
                line.put(device_id_name(code));
            }
            (Byte::ObjectId, object) => self.number(", object ", object.into()),
            _ => (),
        }
    }

    fn word(&mut self, field: Word, value: &mut u16) {
        let value = *value;
        match field {
            Word::Address => self.address("  ", value),
            Word::ReadAddress => self.address("  read ", value),
            Word::WriteAddress => self.address(", write ", value),
            Word::Quantity | Word::WriteQuantity => {
                self.quantity = Some(value);
                to_last(self.line, self.address.unwrap_or_default(), value);
            }
            Word::Value => self.number(": ", value),
            Word::AndMask => self.masked(": and ", value),
            Word::OrMask => self.masked(" or ", value),
            Word::CommStatus => self.masked(": status ", value),
            Word::EventCount => self.number(", events ", value),
            Word::MessageCount => self.number(", messages ", value),
            Word::SubFunction => (),
        }
    }

    fn flag(&mut self, field: Flag, value: &mut bool) {
        if field == Flag::Coil {
            self.line.put(if *value { ": on" } else { ": off" });
        }
    }

    fn counted(&mut self, kind: Data, data: &mut &'a [u8]) {
        Fields::rest(self, kind, data);
    }

    fn rest(&mut self, kind: Data, data: &mut &'a [u8]) {
        match kind {
            Data::Bits => {
                self.range_asked();
                let count = self.quantity.map_or(8 * data.len(), usize::from);
                self.line.byte(b':');
                self.line.bits(data, count);
            }
            Data::Registers => {
                self.range_asked();
                self.line.byte(b':');
                self.line.registers(data);
            }
            Data::Bytes => raw(self.line, data),
            Data::Characters => {
                raw(self.line, data);
                self.line.byte(b' ');
                self.line.quoted(data);
            }
        }
    }
}

/// Describes a request PDU by its head, if the rest is not known.
///
/// ```
/// use mbm::text::{head, TextWriter};
///
/// let mut text = [0; 80];
/// let mut line = TextWriter::new(&mut text);
/// head(&mut line, &[0x10, 0, 107, 0, 2]);
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"10 write multiple registers  107..108");
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn head(line: &mut TextWriter, head: &[u8]) {
    let Some(code) = head.first() else {
        return;
    };
    if Request::parse(head).is_ok() {
        return request(line, head);
    }
    function(line, *code);
    if let (Some(address), Some(quantity)) = functions::range(head) {
        line.put("  ");
        range(line, address, quantity);
    }
}

/// Describes a response PDU. `head` is the head of its request, from which the addresses of
/// the values are taken; it is empty if the request is unknown.
///
/// ```
/// use mbm::text::{response, TextWriter};
///
/// let mut text = [0; 80];
/// let mut line = TextWriter::new(&mut text);
/// response(&mut line, &[3, 4, 0x02, 0x2B, 0, 100], &[3, 0, 107, 0, 2]);
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"03 read holding registers  107..108: 555 100");
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn response(line: &mut TextWriter, pdu: &[u8], head: &[u8]) {
    let is_exception = pdu.first().is_some_and(|code| code & EXCEPTION != 0);
    if !is_exception && unknown(line, pdu) {
        return;
    }
    let Ok(response) = Response::parse(pdu) else {
        return malformed(line, pdu);
    };
    function(line, response.function());
    match response {
        Response::Diagnostics { sub_function, data } => diagnostics(line, sub_function, data, true),
        Response::ReadFileRecord(groups) => {
            let mut separator = " ";
            let mut first = first_record(head);
            for data in groups.iter() {
                line.put(separator);
                if let Some(record) = first.take() {
                    records(line, record);
                    line.byte(b':');
                }
                line.registers(data);
                separator = ",";
            }
        }
        Response::WriteFileRecord(groups) => writes(line, &groups),
        Response::DeviceIdentification {
            code,
            more_follows,
            next_object,
            objects,
            ..
        } => {
            line.put(", device identification, ");
            line.put(device_id_name(code));
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
        response => response.give(&mut Words::new(line, head)),
    }
}

/// The name of a sub-function of function 08, diagnostics.
const fn sub_function_name(code: u16) -> &'static str {
    match code {
        sub::RETURN_QUERY_DATA => "return query data",
        sub::RESTART_COMMUNICATIONS => "restart communications option",
        sub::RETURN_DIAGNOSTIC_REGISTER => "return diagnostic register",
        sub::CHANGE_ASCII_INPUT_DELIMITER => "change ASCII input delimiter",
        sub::FORCE_LISTEN_ONLY => "force listen only mode",
        sub::CLEAR_COUNTERS => "clear counters and diagnostic register",
        sub::BUS_MESSAGE_COUNT => "return bus message count",
        sub::BUS_COMMUNICATION_ERROR_COUNT => "return bus communication error count",
        sub::BUS_EXCEPTION_ERROR_COUNT => "return bus exception error count",
        sub::SERVER_MESSAGE_COUNT => "return server message count",
        sub::SERVER_NO_RESPONSE_COUNT => "return server no response count",
        sub::SERVER_NAK_COUNT => "return server NAK count",
        sub::SERVER_BUSY_COUNT => "return server busy count",
        sub::BUS_CHARACTER_OVERRUN_COUNT => "return bus character overrun count",
        sub::CLEAR_OVERRUN_COUNTER => "clear overrun counter and flag",
        _ => "unknown sub-function",
    }
}

/// The name of an exception code (V1.1b3, 7).
const fn exception_name(code: u8) -> &'static str {
    match code {
        0x01 => "illegal function",
        0x02 => "illegal data address",
        0x03 => "illegal data value",
        0x04 => "server device failure",
        0x05 => "acknowledge",
        0x06 => "server device busy",
        0x08 => "memory parity error",
        0x0A => "gateway path unavailable",
        0x0B => "gateway target device failed to respond",
        _ => "unknown code",
    }
}

/// The name of a read device id code (V1.1b3, 6.21).
const fn device_id_name(code: u8) -> &'static str {
    match code {
        BASIC => "basic",
        REGULAR => "regular",
        EXTENDED => "extended",
        INDIVIDUAL => "individual",
        _ => "unknown",
    }
}
