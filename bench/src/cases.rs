//! The rows: each function with frames of usual length, over RTU and TCP.

use crate::libmodbus;
use crate::ours::{answer, emit, open, receive, receive_bits, validate, Model};
use crate::rmodbus_side::{self as theirs, Ask};
use crate::{Row, Work};
use mbm::frame::Framing;
use mbm::pdu::files::{Reads, Records, Writes};
use mbm::pdu::identification::ObjectList;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use rmodbus::ModbusProto;
use std::hint::black_box;

/// Ten registers, and nineteen coils, as they travel.
const WORDS: &[u8; 20] =
    b"\x12\x34\x56\x78\x9A\xBC\xDE\xF0\x01\x23\x45\x67\x89\xAB\xCD\xEF\0\x01\0\x02";
const VALUES: [u16; 10] = [
    0x1234, 0x5678, 0x9ABC, 0xDEF0, 0x0123, 0x4567, 0x89AB, 0xCDEF, 1, 2,
];
const COILS: &[u8; 3] = &[0xCD, 0x6B, 0x05];
const ON: [bool; 19] = [
    true, false, true, true, false, false, true, true, true, true, false, true, false, true, true,
    false, true, false, true,
];

/// As many registers as a read may ask for.
const MOST: &[u8; 250] = &[0x5A; 250];

/// The rows of one function. Request and response are built in each call, as a
/// program builds them; `$ask` is rmodbus's function, `$served` says whether
/// mbm's model and libmodbus's server answer.
macro_rules! function {
    ($rows:ident, $framing:expr, $name:literal, $request:expr, $response:expr, $ask:expr, $served:expr) => {{
        let framing = $framing;
        let over_tcp = framing == Framing::Tcp;
        let proto = if over_tcp {
            ModbusProto::TcpUdp
        } else {
            ModbusProto::Rtu
        };
        let name = if over_tcp { "TCP" } else { "RTU" };
        let ask: Option<Ask> = $ask;
        let mut buffer = [0; 260];
        let length = emit(framing, &mut buffer, |pdu| $request.emit(pdu)).expect("a request");
        let request = buffer[..length].to_vec();
        let length = emit(framing, &mut buffer, |pdu| $response.emit(pdu)).expect("a response");
        let response = buffer[..length].to_vec();
        let row = |work, mbm, rmodbus, libmodbus| Row {
            framing: name,
            function: $name,
            work,
            mbm,
            rmodbus,
            libmodbus,
        };
        $rows.push(row(
            "emit request",
            Box::new(move || {
                let length = emit(framing, &mut buffer, |pdu| $request.emit(pdu));
                black_box(&buffer);
                length.expect("a request");
            }),
            ask.map(|ask| theirs::emit_request(proto, ask)),
            None,
        ));
        let frame = request.clone();
        $rows.push(row(
            "parse request",
            Box::new(move || {
                let adu = open(framing, black_box(&frame)).expect("a frame");
                let request = Request::parse(adu.pdu);
                assert!(request.is_ok());
                black_box(&request);
            }),
            ask.map(|_| theirs::parse_request(proto, request.clone())),
            $served.then(|| libmodbus::serve(over_tcp, request.clone(), false)),
        ));
        if $served {
            let frame = request.clone();
            let mut model = Model::new();
            $rows.push(row(
                "answer",
                Box::new(move || {
                    let length = answer(framing, black_box(&frame), &mut buffer, &mut model);
                    black_box(&buffer);
                    length.expect("a response");
                }),
                ask.map(|_| theirs::answer(proto, request.clone())),
                Some(libmodbus::serve(over_tcp, request, true)),
            ));
        } else {
            $rows.push(row(
                "emit response",
                Box::new(move || {
                    let length = emit(framing, &mut buffer, |pdu| $response.emit(pdu));
                    black_box(&buffer);
                    length.expect("a response");
                }),
                None,
                None,
            ));
        }
        let frame = response.clone();
        let query = ask.and_then(theirs::written);
        let mut words = [0; 125];
        let receive: Work = match ask {
            Some(Ask::Coils(..) | Ask::Discretes(..)) => {
                Box::new(move || receive_bits(framing, black_box(&frame)))
            }
            _ => Box::new(move || receive(framing, black_box(&frame), &mut words)),
        };
        $rows.push(row(
            "parse response",
            receive,
            // Of the response to a write it reads no field.
            ask.filter(|_| query.is_none())
                .map(|ask| theirs::parse_response(proto, ask, response.clone())),
            None,
        ));
        if let Some(query) = query {
            let frame = response.clone();
            $rows.push(row(
                "judge response",
                Box::new(move || validate(framing, &query, black_box(&frame))),
                ask.map(|ask| theirs::parse_response(proto, ask, response)),
                None,
            ));
        }
    }};
}

/// The rows of each function: its name, a request and a response, what rmodbus is asked, and whether
/// mbm's model and libmodbus's server answer.
macro_rules! functions {
    ($rows:ident, $framing:ident; $($name:literal => $request:expr, $response:expr, $ask:expr, $served:expr;)*) => {
        $(function!($rows, $framing, $name, $request, $response, $ask, $served);)*
    };
}

fn rows_of(framing: Framing, rows: &mut Vec<Row>) {
    functions! { rows, framing;
        "01 Read Coils, 19" =>
            Request::ReadBits { function: 1, address: black_box(16), quantity: black_box(19) },
            Response::ReadBits { function: 1, data: black_box(COILS) }, Some(Ask::Coils(16, 19)), true;
        "02 Read Discrete Inputs, 19" =>
            Request::ReadBits { function: 2, address: black_box(16), quantity: black_box(19) },
            Response::ReadBits { function: 2, data: black_box(COILS) }, Some(Ask::Discretes(16, 19)), true;
        "03 Read Holding Registers, 10" =>
            Request::ReadRegisters { function: 3, address: black_box(107), quantity: black_box(10) },
            Response::ReadRegisters { function: 3, data: black_box(WORDS) }, Some(Ask::Holdings(107, 10)), true;
        "03 Read Holding Registers, 125" =>
            Request::ReadRegisters { function: 3, address: black_box(107), quantity: black_box(125) },
            Response::ReadRegisters { function: 3, data: black_box(MOST) }, Some(Ask::Holdings(107, 125)), true;
        "04 Read Input Registers, 10" =>
            Request::ReadRegisters { function: 4, address: black_box(107), quantity: black_box(10) },
            Response::ReadRegisters { function: 4, data: black_box(WORDS) }, Some(Ask::Inputs(107, 10)), true;
        "05 Write Single Coil" =>
            Request::WriteSingleCoil { address: black_box(172), on: black_box(true) },
            Response::WriteSingleCoil { address: black_box(172), on: black_box(true) }, Some(Ask::SetCoil(172)), true;
        "06 Write Single Register" =>
            Request::WriteSingleRegister { address: black_box(1), value: black_box(3) },
            Response::WriteSingleRegister { address: black_box(1), value: black_box(3) }, Some(Ask::SetHolding(1, 3)), true;
        "0F Write Multiple Coils, 19" =>
            Request::WriteMultipleCoils { address: black_box(16), quantity: black_box(19), data: black_box(COILS) },
            Response::WriteMultiple { function: 15, address: black_box(16), quantity: black_box(19) }, Some(Ask::SetCoils(16, &ON)), true;
        "10 Write Multiple Registers, 10" =>
            Request::WriteMultipleRegisters { address: black_box(1), quantity: black_box(10), data: black_box(WORDS) },
            Response::WriteMultiple { function: 16, address: black_box(1), quantity: black_box(10) }, Some(Ask::SetHoldings(1, &VALUES)), true;
        "16 Mask Write Register" =>
            Request::MaskWriteRegister { address: black_box(4), and_mask: black_box(0xF2), or_mask: black_box(0x25) },
            Response::MaskWriteRegister { address: black_box(4), and_mask: black_box(0xF2), or_mask: black_box(0x25) }, None, true;
        "17 Read/Write Multiple Registers, 10" =>
            Request::ReadWriteMultipleRegisters { read_address: black_box(3), read_quantity: black_box(10), write_address: black_box(14), write_quantity: black_box(10), data: black_box(WORDS) },
            Response::ReadRegisters { function: 0x17, data: black_box(WORDS) }, None, true;
        "07 Read Exception Status" =>
            Request::ReadExceptionStatus,
            Response::ExceptionStatus { outputs: black_box(0x6D) }, None, false;
        "08 Diagnostics" =>
            Request::Diagnostics { sub_function: black_box(0), data: black_box(&[0xA5, 0x37]) },
            Response::Diagnostics { sub_function: black_box(0), data: black_box(&[0xA5, 0x37]) }, None, false;
        "0B Get Comm Event Counter" =>
            Request::GetCommEventCounter,
            Response::CommEventCounter { status: black_box(0), events: black_box(0x108) }, None, false;
        "0C Get Comm Event Log, 2" =>
            Request::GetCommEventLog,
            Response::CommEventLog { status: black_box(0), events: black_box(0x108), messages: black_box(0x121), log: black_box(&[0x20, 0]) }, None, false;
        "11 Report Server ID" =>
            Request::ReportServerId,
            Response::ServerId { count: black_box(4), data: black_box(b"abc\xFF") }, None, false;
        "14 Read File Record, 2 groups" =>
            Request::ReadFileRecord(Reads::new(black_box(&[6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 2])).expect("in order")),
            Response::ReadFileRecord(Records::new(black_box(&[5, 6, 13, 254, 0, 32, 5, 6, 51, 205, 0, 64])).expect("in order")), None, false;
        "15 Write File Record, 3 records" =>
            Request::WriteFileRecord(Writes::new(black_box(&[6, 0, 4, 0, 7, 0, 3, 6, 175, 4, 190, 16, 13])).expect("in order")),
            Response::WriteFileRecord(Writes::new(black_box(&[6, 0, 4, 0, 7, 0, 3, 6, 175, 4, 190, 16, 13])).expect("in order")), None, false;
        "18 Read FIFO Queue, 2" =>
            Request::ReadFifoQueue { address: black_box(0x04DE) },
            Response::FifoQueue { data: black_box(&[1, 184, 18, 132]) }, None, false;
        "2B/0E Read Device Identification, 3 objects" =>
            Request::ReadDeviceIdentification { code: black_box(1), object: black_box(0) },
            Response::DeviceIdentification { code: black_box(1), conformity: black_box(0x83), more_follows: false, next_object: 0, objects: ObjectList::new(3, black_box(b"\x00\x01a\x01\x02bc\x02\x03def")).expect("in order") }, None, false;
    }
}

/// All rows.
pub fn rows() -> Vec<Row> {
    let mut rows = Vec::new();
    rows_of(Framing::Rtu, &mut rows);
    rows_of(Framing::Tcp, &mut rows);
    rows
}
