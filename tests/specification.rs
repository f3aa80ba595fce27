//! The examples of the Modbus application protocol V1.1b3, clause 6. Each is read with the
//! meaning that the standard gives it, and written again byte for byte.

#[path = "common/vectors.rs"]
mod vectors;

use mbm::pdu::files::{Reads, Record, Records, Writes};
use mbm::pdu::identification::{ObjectList, BASIC, EXTENDED, INDIVIDUAL, REGULAR};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use vectors::pdu;

/// Checks that the vector `name` is read as `expected`, and that `expected` is written as that
/// vector.
fn request(name: &str, expected: Request) {
    let bytes = pdu(name);
    assert_eq!(Request::parse(&bytes), Ok(expected), "{name}");
    assert_eq!(bytes.first(), Some(&expected.function()));
    let mut buffer = vec![0; bytes.len()];
    assert_eq!(expected.emit(&mut buffer), Ok(bytes.len()), "{name}");
    assert_eq!(buffer, bytes, "{name}");
}

/// Like [`request`], for a response.
fn response(name: &str, expected: Response) {
    let bytes = pdu(name);
    assert_eq!(Response::parse(&bytes), Ok(expected), "{name}");
    assert_eq!(bytes[0] & 0x7F, expected.function());
    let mut buffer = vec![0; bytes.len()];
    assert_eq!(expected.emit(&mut buffer), Ok(bytes.len()), "{name}");
    assert_eq!(buffer, bytes, "{name}");
}

fn read_bits(function: u8, address: u16, quantity: u16) -> Request<'static> {
    Request::ReadBits {
        function,
        address,
        quantity,
    }
}

fn read_registers(function: u8, address: u16, quantity: u16) -> Request<'static> {
    Request::ReadRegisters {
        function,
        address,
        quantity,
    }
}

#[test]
fn read_coils() {
    request("spec-01-6.1", read_bits(1, 0x13, 0x13));
    let data = &[0xCD, 0x6B, 0x05];
    response(
        "spec-01-6.1-answer",
        Response::ReadBits { function: 1, data },
    );
}

#[test]
fn read_discrete_inputs() {
    request("spec-02-6.2", read_bits(2, 0xC4, 0x16));
    let data = &[0xAC, 0xDB, 0x35];
    response(
        "spec-02-6.2-answer",
        Response::ReadBits { function: 2, data },
    );
}

#[test]
fn read_holding_registers() {
    request("spec-03-6.3", read_registers(3, 0x6B, 3));
    let data = &[0x02, 0x2B, 0, 0, 0, 0x64];
    let read = Response::ReadRegisters { function: 3, data };
    response("spec-03-6.3-answer", read);
}

#[test]
fn read_input_registers() {
    request("spec-04-6.4", read_registers(4, 8, 1));
    let data = &[0, 0x0A];
    let read = Response::ReadRegisters { function: 4, data };
    response("spec-04-6.4-answer", read);
}

#[test]
fn write_single_coil() {
    let (address, on) = (0xAC, true);
    request("spec-05-6.5", Request::WriteSingleCoil { address, on });
    let echo = Response::WriteSingleCoil { address, on };
    response("spec-05-6.5-answer", echo);
    let (address, on) = (0xFFFF, false);
    request("05-off", Request::WriteSingleCoil { address, on });
    response("05-off-answer", Response::WriteSingleCoil { address, on });
}

#[test]
fn write_single_register() {
    let (address, value) = (1, 3);
    let write = Request::WriteSingleRegister { address, value };
    request("spec-06-6.6", write);
    let echo = Response::WriteSingleRegister { address, value };
    response("spec-06-6.6-answer", echo);
}

#[test]
fn read_exception_status() {
    request("spec-07-6.7", Request::ReadExceptionStatus);
    let status = Response::ExceptionStatus { outputs: 0x6D };
    response("spec-07-6.7-answer", status);
}

fn diagnostics(name: &str, sub_function: u16, asked: &[u8], answered: Option<&[u8]>) {
    let data = asked;
    request(name, Request::Diagnostics { sub_function, data });
    if let Some(data) = answered {
        let answer = Response::Diagnostics { sub_function, data };
        response(&format!("{name}-answer"), answer);
    }
}

#[test]
fn diagnostics_return_query_data() {
    diagnostics("spec-08-6.8", 0, &[0xA5, 0x37], Some(&[0xA5, 0x37]));
    diagnostics("08-00-two-words", 0, &[1, 2, 3, 4], Some(&[1, 2, 3, 4]));
}

#[test]
fn diagnostics_of_every_other_sub_function() {
    diagnostics("08-01-restart", 1, &[0, 0], Some(&[0, 0]));
    let clear = &[0xFF, 0];
    diagnostics("08-01-restart-clear-log", 1, clear, Some(clear));
    let register = Some(&[0x12, 0x34][..]);
    diagnostics("08-02-diagnostic-register", 2, &[0, 0], register);
    diagnostics("08-03-ascii-delimiter", 3, b"!\0", Some(b"!\0"));
    diagnostics("08-04-listen-only", 4, &[0, 0], None);
    diagnostics("08-0A-clear-counters", 0x0A, &[0, 0], Some(&[0, 0]));
    for (name, sub_function) in [
        ("08-0B-bus-messages", 0x0B),
        ("08-0C-bus-errors", 0x0C),
        ("08-0D-exceptions", 0x0D),
        ("08-0E-server-messages", 0x0E),
        ("08-0F-no-responses", 0x0F),
        ("08-10-naks", 0x10),
        ("08-11-busies", 0x11),
        ("08-12-overruns", 0x12),
    ] {
        diagnostics(name, sub_function, &[0, 0], Some(&[0, 0xFF]));
    }
    diagnostics("08-14-clear-overruns", 0x14, &[0, 0], Some(&[0, 0]));
}

#[test]
fn get_comm_event_counter() {
    request("spec-0B-6.9", Request::GetCommEventCounter);
    let (status, events) = (0xFFFF, 0x0108);
    let counter = Response::CommEventCounter { status, events };
    response("spec-0B-6.9-answer", counter);
}

#[test]
fn get_comm_event_log() {
    request("spec-0C-6.10", Request::GetCommEventLog);
    let event_log = |status, log| Response::CommEventLog {
        status,
        events: 0x0108,
        messages: 0x0121,
        log,
    };
    response("spec-0C-6.10-answer", event_log(0, &[0x20, 0]));
    let log: Vec<u8> = (0..64).collect();
    response("0C-full-log-answer", event_log(0xFFFF, &log));
}

#[test]
fn write_multiple_coils() {
    let write = Request::WriteMultipleCoils {
        address: 0x13,
        quantity: 10,
        data: &[0xCD, 0x01],
    };
    request("spec-0F-6.11", write);
    let wrote = Response::WriteMultiple {
        function: 0x0F,
        address: 0x13,
        quantity: 10,
    };
    response("spec-0F-6.11-answer", wrote);
}

#[test]
fn write_multiple_registers() {
    let write = Request::WriteMultipleRegisters {
        address: 1,
        quantity: 2,
        data: &[0, 0x0A, 1, 2],
    };
    request("spec-10-6.12", write);
    let wrote = Response::WriteMultiple {
        function: 0x10,
        address: 1,
        quantity: 2,
    };
    response("spec-10-6.12-answer", wrote);
}

#[test]
fn report_server_id() {
    request("11-by-the-standard", Request::ReportServerId);
    let data = &[0x6D, 0x62, 0x6D, 0x31, 0xFF, 2];
    let id = Response::ServerId { count: 6, data };
    response("11-by-the-standard-answer", id);
}

#[test]
fn report_server_id_keeps_data_after_the_counted_bytes() {
    let id = [0x11, 2, 1, 2, 0, 1, 2];
    let data = &[1, 2, 0, 1, 2];
    let expected = Response::ServerId { count: 2, data };
    assert_eq!(Response::parse(&id), Ok(expected));
}

#[test]
fn read_file_record() {
    let bytes = [6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 2];
    let reads = Reads::new(&bytes).unwrap();
    request("spec-14-6.14", Request::ReadFileRecord(reads));
    let record = |file, record, length| Record {
        file,
        record,
        length,
    };
    let named: Vec<_> = reads.iter().collect();
    assert_eq!(named, [record(4, 1, 2), record(3, 9, 2)]);

    let bytes = [5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40];
    let records = Records::new(&bytes).unwrap();
    response("spec-14-6.14-answer", Response::ReadFileRecord(records));
    let data: Vec<_> = records.iter().collect();
    assert_eq!(data, [[0x0D, 0xFE, 0, 0x20], [0x33, 0xCD, 0, 0x40]]);
    assert_eq!(reads.response_length(), 2 + bytes.len());
}

#[test]
fn write_file_record() {
    let bytes = [6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D];
    let writes = Writes::new(&bytes).unwrap();
    request("spec-15-6.15", Request::WriteFileRecord(writes));
    response("spec-15-6.15-answer", Response::WriteFileRecord(writes));
    let record = Record {
        file: 4,
        record: 7,
        length: 3,
    };
    let named: Vec<_> = writes.iter().collect();
    assert_eq!(named, [(record, &bytes[7..])]);
}

#[test]
fn several_sub_requests_of_write_file_record() {
    let bytes = pdu("15-two-sub-requests");
    let writes = Writes::new(&bytes[2..]).unwrap();
    request("15-two-sub-requests", Request::WriteFileRecord(writes));
    let data: Vec<_> = writes.iter().map(|(_, data)| data).collect();
    assert_eq!(data, [&[0xAA, 0xBB][..], &[1, 2, 3, 4]]);
}

#[test]
fn mask_write_register() {
    let (address, and_mask, or_mask) = (4, 0xF2, 0x25);
    let write = Request::MaskWriteRegister {
        address,
        and_mask,
        or_mask,
    };
    request("spec-16-6.16", write);
    let echo = Response::MaskWriteRegister {
        address,
        and_mask,
        or_mask,
    };
    response("spec-16-6.16-answer", echo);
}

#[test]
fn read_write_multiple_registers() {
    let both = Request::ReadWriteMultipleRegisters {
        read_address: 3,
        read_quantity: 6,
        write_address: 0x0E,
        write_quantity: 3,
        data: &[0, 0xFF, 0, 0xFF, 0, 0xFF],
    };
    request("spec-17-6.17", both);
    let data = &[0, 0xFE, 0x0A, 0xCD, 0, 1, 0, 3, 0, 0x0D, 0, 0xFF];
    let function = 0x17;
    response(
        "spec-17-6.17-answer",
        Response::ReadRegisters { function, data },
    );
}

#[test]
fn read_fifo_queue() {
    request("spec-18-6.18", Request::ReadFifoQueue { address: 0x04DE });
    let data = &[0x01, 0xB8, 0x12, 0x84];
    response("spec-18-6.18-answer", Response::FifoQueue { data });
    response("18-empty-answer", Response::FifoQueue { data: &[] });
}

/// The objects in the form in which they are sent.
fn objects(values: &[(u8, &str)]) -> Vec<u8> {
    let bytes = values.iter().flat_map(|(id, value)| {
        let head = [*id, value.len() as u8];
        head.into_iter().chain(value.bytes())
    });
    bytes.collect()
}

/// Checks that the response `name` has the read code and conformity level `levels`, names
/// `next` as the next object, and has these values.
fn identification(name: &str, levels: [u8; 2], next: Option<u8>, values: &[(u8, &str)]) {
    let bytes = objects(values);
    let objects = ObjectList::new(values.len() as u8, &bytes).unwrap();
    let answer = Response::DeviceIdentification {
        code: levels[0],
        conformity: levels[1],
        more_follows: next.is_some(),
        next_object: next.unwrap_or(0),
        objects,
    };
    response(name, answer);
    assert_eq!(usize::from(objects.count()), values.len());
    let found: Vec<_> = objects.iter().collect();
    let values: Vec<_> = values.iter().map(|(id, v)| (*id, v.as_bytes())).collect();
    assert_eq!(found, values);
}

const VENDOR: (u8, &str) = (0, "Company identification");
const REVISION: (u8, &str) = (2, "V2.11");

#[test]
fn read_device_identification() {
    let (code, object) = (BASIC, 0);
    let basic = Request::ReadDeviceIdentification { code, object };
    request("spec-2B-6.21", basic);
    let product = (1, "Product code XX");
    let values = &[VENDOR, product, REVISION];
    identification("spec-2B-6.21-answer", [BASIC, 1], None, values);
}

#[test]
fn read_device_identification_in_two_transactions() {
    let product = (1, "Product code XXXXXXXXXXXXXXXX");
    let name = "spec-2B-6.21-first-of-two-answer";
    identification(name, [BASIC, 1], Some(2), &[VENDOR, product]);
    let (code, object) = (BASIC, 2);
    let more = Request::ReadDeviceIdentification { code, object };
    request("spec-2B-6.21-second-of-two", more);
    let name = "spec-2B-6.21-second-of-two-answer";
    identification(name, [BASIC, 1], None, &[REVISION]);
}

#[test]
fn read_device_identification_regular_extended_and_individual() {
    let ask = |name, code, object| {
        request(name, Request::ReadDeviceIdentification { code, object });
    };
    ask("2B-0E-regular", REGULAR, 0);
    ask("2B-0E-extended", EXTENDED, 0x80);
    ask("2B-0E-individual", INDIVIDUAL, 2);
    let url = &[(3, "http://example.org")];
    identification("2B-0E-regular-answer", [REGULAR, 0x82], None, url);
    let own = &[(0x80, "\u{1}\u{2}")];
    identification("2B-0E-extended-answer", [EXTENDED, 0x83], Some(0x81), own);
    let name = "2B-0E-individual-answer";
    identification(name, [INDIVIDUAL, 0x81], None, &[REVISION]);
}

#[test]
fn read_device_identification_with_unusual_conformity_level_or_next_object_id() {
    let objects = objects(&[(0, "A")]);
    for (name, conformity, next_object) in [
        ("2B-0E-conformity-of-nobody-answer", 0, 0),
        ("2B-0E-conformity-84-answer", 0x84, 0),
        ("2B-0E-next-without-more-answer", 1, 1),
    ] {
        let expected = Response::DeviceIdentification {
            code: BASIC,
            conformity,
            more_follows: false,
            next_object,
            objects: ObjectList::new(1, &objects).unwrap(),
        };
        response(name, expected);
    }
}

#[test]
fn encapsulated_interface_transport_of_any_type() {
    let (mei_type, data) = (0x0D, &[0, 0x2A, 0][..]);
    let canopen = Request::EncapsulatedInterface { mei_type, data };
    request("2B-0D-canopen", canopen);
    let answer = Response::EncapsulatedInterface { mei_type, data };
    response("2B-0D-canopen-answer", answer);
    let (mei_type, data) = (0xFF, &[][..]);
    let other = Request::EncapsulatedInterface { mei_type, data };
    request("2B-any-mei", other);
}

#[test]
fn exceptions() {
    request("spec-01-7", read_bits(1, 0x04A1, 1));
    let (function, code) = (1, 2);
    let refused = Response::Exception { function, code };
    response("spec-01-7-answer", refused);
}
