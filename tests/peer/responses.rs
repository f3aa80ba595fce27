//! Responses: pymodbus's client reads those of mbm, and mbm reads those of pymodbus's server.

use crate::process::query;
use crate::{frame, from_hex, hex, open, read_as, FRAMINGS};
use mbm::pdu::files::{Records, Writes};
use mbm::pdu::identification::ObjectList;
use mbm::pdu::response::Response;

struct Case {
    mbm: Response<'static>,
    /// The same response, built by pymodbus's server.
    reply: &'static str,
    /// What pymodbus's client reads.
    fields: &'static str,
    /// What pymodbus's client reads in RTU framing, if that differs.
    over_rtu: Option<&'static str>,
}

fn case(mbm: Response<'static>, reply: &'static str, fields: &'static str) -> Case {
    Case {
        mbm,
        reply,
        fields,
        over_rtu: None,
    }
}

fn check_pymodbus_reads_mbm(case: &Case) {
    for (framing, name) in FRAMINGS {
        let sent = frame(framing, |pdu| case.mbm.emit(pdu));
        let read = query(&format!("response {name} {}", hex(&sent)));
        match case.over_rtu {
            Some(quirk) if name == "rtu" => assert_eq!(read, quirk),
            _ => assert_eq!(read, read_as(name, case.fields), "{name}"),
        }
    }
}

fn check_mbm_reads_pymodbus(case: &Case) {
    for (framing, name) in FRAMINGS {
        let mut sent = from_hex(&query(&format!("reply {name} {}", case.reply)));
        assert_eq!(sent, frame(framing, |pdu| case.mbm.emit(pdu)), "{name}");
        let adu = open(framing, &mut sent);
        assert_eq!(Response::parse(adu.pdu), Ok(case.mbm), "{name}");
    }
}

macro_rules! cases {
    ($($name:ident => $case:expr;)*) => { $(
        mod $name {
            use super::*;
            #[test]
            fn response_is_read_by_pymodbus() {
                check_pymodbus_reads_mbm(&$case);
            }
            #[test]
            fn response_of_pymodbus_is_read() {
                check_mbm_reads_pymodbus(&$case);
            }
        }
    )* };
}

/// A response of function 08 with one word of data.
fn diagnostics(
    sub_function: u16,
    data: &'static [u8; 2],
    reply: &'static str,
    fields: &'static str,
) -> Case {
    case(Response::Diagnostics { sub_function, data }, reply, fields)
}

const NONE: &[u8; 2] = &[0, 0];
const COUNT: &[u8; 2] = &[0x01, 0x02];

cases! {
    read_coils => case(
        Response::ReadBits { function: 1, data: &[0xCD, 0x05] },
        "ReadCoilsResponse(bits=[bool(0x5CD >> i & 1) for i in range(11)])",
        "ReadCoilsResponse \
         bits=[true,false,true,true,false,false,true,true,true,false,true,false,false,false,false,false]",
    );
    read_discrete_inputs => case(
        Response::ReadBits { function: 2, data: &[0x35] },
        "ReadDiscreteInputsResponse(bits=[bool(0x35 >> i & 1) for i in range(8)])",
        "ReadDiscreteInputsResponse bits=[true,false,true,false,true,true,false,false]",
    );
    read_holding_registers => case(
        Response::ReadRegisters { function: 3, data: &[2, 0x2B, 0, 0, 0, 0x64] },
        "ReadHoldingRegistersResponse(registers=[0x22B, 0, 100])",
        "ReadHoldingRegistersResponse registers=[555,0,100]",
    );
    read_input_registers => case(
        Response::ReadRegisters { function: 4, data: &[0, 10] },
        "ReadInputRegistersResponse(registers=[10])",
        "ReadInputRegistersResponse registers=[10]",
    );
    write_single_coil => case(
        Response::WriteSingleCoil { address: 0xAC, on: true },
        "WriteSingleCoilResponse(address=0xAC, bits=[True])",
        "WriteSingleCoilResponse address=172 bits=[true]",
    );
    write_single_register => case(
        Response::WriteSingleRegister { address: 1, value: 3 },
        "WriteSingleRegisterResponse(address=1, registers=[3])",
        "WriteSingleRegisterResponse address=1 registers=[3]",
    );
    read_exception_status => case(
        Response::ExceptionStatus { outputs: 0x6D },
        "ReadExceptionStatusResponse(status=0x6D)",
        "ReadExceptionStatusResponse status=109",
    );
    return_query_data => diagnostics(
        0x00, &[0xA5, 0x37], "ReturnQueryDataResponse(b'\\xA5\\x37')",
        "ReturnQueryDataResponse sub_function_code=0 message=a537",
    );
    return_query_data_of_two_words => Case {
        // In RTU framing, pymodbus assumes that every frame of function 08 has 8 bytes.
        over_rtu: Some("nothing"),
        ..case(
            Response::Diagnostics { sub_function: 0, data: &[1, 2, 3, 4] },
            "ReturnQueryDataResponse(bytes([1, 2, 3, 4]))",
            "ReturnQueryDataResponse sub_function_code=0 message=01020304",
        )
    };
    restart_communications => diagnostics(
        0x01, &[0xFF, 0], "RestartCommunicationsOptionResponse(0xFF00)",
        "RestartCommunicationsOptionResponse sub_function_code=1 message=65280",
    );
    return_diagnostic_register => diagnostics(
        0x02, COUNT, "ReturnDiagnosticRegisterResponse(0x102)",
        "ReturnDiagnosticRegisterResponse sub_function_code=2 message=258",
    );
    change_ascii_input_delimiter => diagnostics(
        0x03, b"!\0", "ChangeAsciiInputDelimiterResponse(0x2100)",
        "ChangeAsciiInputDelimiterResponse sub_function_code=3 message=8448",
    );
    clear_counters => diagnostics(
        0x0A, NONE, "ClearCountersResponse()",
        "ClearCountersResponse sub_function_code=10 message=0",
    );
    bus_message_count => diagnostics(
        0x0B, COUNT, "ReturnBusMessageCountResponse(0x102)",
        "ReturnBusMessageCountResponse sub_function_code=11 message=258",
    );
    bus_communication_error_count => diagnostics(
        0x0C, COUNT, "ReturnBusCommunicationErrorCountResponse(0x102)",
        "ReturnBusCommunicationErrorCountResponse sub_function_code=12 message=258",
    );
    bus_exception_error_count => diagnostics(
        0x0D, COUNT, "ReturnBusExceptionErrorCountResponse(0x102)",
        "ReturnBusExceptionErrorCountResponse sub_function_code=13 message=258",
    );
    server_message_count => diagnostics(
        0x0E, COUNT, "ReturnDeviceMessageCountResponse(0x102)",
        "ReturnDeviceMessageCountResponse sub_function_code=14 message=258",
    );
    server_no_response_count => diagnostics(
        0x0F, COUNT, "ReturnDeviceNoResponseCountResponse(0x102)",
        "ReturnDeviceNoResponseCountResponse sub_function_code=15 message=258",
    );
    server_nak_count => diagnostics(
        0x10, COUNT, "ReturnDeviceNAKCountResponse(0x102)",
        "ReturnDeviceNAKCountResponse sub_function_code=16 message=258",
    );
    server_busy_count => diagnostics(
        0x11, COUNT, "ReturnDeviceBusyCountResponse(0x102)",
        "ReturnDeviceBusyCountResponse sub_function_code=17 message=258",
    );
    bus_character_overrun_count => diagnostics(
        0x12, COUNT, "ReturnDeviceBusCharacterOverrunCountResponse(0x102)",
        "ReturnDeviceBusCharacterOverrunCountResponse sub_function_code=18 message=258",
    );
    clear_overrun_counter => diagnostics(
        0x14, NONE, "ClearOverrunCountResponse()",
        "ClearOverrunCountResponse sub_function_code=20 message=0",
    );
    comm_event_counter => case(
        Response::CommEventCounter { status: 0, events: 0x108 },
        "GetCommEventCounterResponse(status=True, count=0x108)",
        "GetCommEventCounterResponse status=true count=264",
    );
    comm_event_counter_while_busy => case(
        Response::CommEventCounter { status: 0xFFFF, events: 0x108 },
        "GetCommEventCounterResponse(status=False, count=0x108)",
        "GetCommEventCounterResponse status=false count=264",
    );
    comm_event_log => case(
        Response::CommEventLog { status: 0, events: 0x108, messages: 0x121, log: &[0x20, 0] },
        "GetCommEventLogResponse(True, message_count=0x121, event_count=0x108, events=[0x20, 0])",
        "GetCommEventLogResponse status=true event_count=264 message_count=289 events=[32,0]",
    );
    write_multiple_coils => case(
        Response::WriteMultiple { function: 15, address: 0x13, quantity: 10 },
        "WriteMultipleCoilsResponse(address=0x13, count=10)",
        "WriteMultipleCoilsResponse address=19 count=10",
    );
    write_multiple_registers => case(
        Response::WriteMultiple { function: 16, address: 1, quantity: 2 },
        "WriteMultipleRegistersResponse(address=1, count=2)",
        "WriteMultipleRegistersResponse address=1 count=2",
    );
    server_id => case(
        Response::ServerId { count: 4, data: &[b'a', b'b', b'c', 0xFF] },
        "ReportDeviceIdResponse(b'abc', True)",
        "ReportDeviceIdResponse identifier=616263 status=true",
    );
    file_records => case(
        Response::ReadFileRecord(
            Records::new(&[5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40])
                .expect("in order"),
        ),
        "ReadFileRecordResponse([FileRecord(record_data=bytes.fromhex('0DFE0020')), \
         FileRecord(record_data=bytes.fromhex('33CD0040'))])",
        "ReadFileRecordResponse records=[0/0/2/0dfe0020,0/0/2/33cd0040]",
    );
    written_file_records => case(
        Response::WriteFileRecord(
            Writes::new(&[6, 0, 4, 0, 7, 0, 3, 0x06, 0xAF, 0x04, 0xBE, 0x10, 0x0D])
                .expect("in order"),
        ),
        "WriteFileRecordResponse([FileRecord(4, 7, bytes.fromhex('06AF04BE100D'))])",
        "WriteFileRecordResponse records=[4/7/3/06af04be100d]",
    );
    mask_write_register => case(
        Response::MaskWriteRegister { address: 4, and_mask: 0xF2, or_mask: 0x25 },
        "MaskWriteRegisterResponse(4, 0xF2, 0x25)",
        "MaskWriteRegisterResponse address=4 and_mask=242 or_mask=37",
    );
    read_write_multiple_registers => case(
        Response::ReadRegisters { function: 0x17, data: &[0, 0xFE, 0x0A, 0xCD] },
        "ReadWriteMultipleRegistersResponse(registers=[0xFE, 0xACD])",
        "ReadWriteMultipleRegistersResponse registers=[254,2765]",
    );
    fifo_queue => Case {
        // In RTU framing, pymodbus assumes that this frame is two bytes shorter.
        over_rtu: Some("nothing"),
        ..case(
            Response::FifoQueue { data: &[0x01, 0xB8, 0x12, 0x84] },
            "ReadFifoQueueResponse([0x1B8, 0x1284])",
            "ReadFifoQueueResponse values=[440,4740]",
        )
    };
    basic_identification => case(
        Response::DeviceIdentification {
            code: 1,
            conformity: 0x83,
            more_follows: false,
            next_object: 0,
            objects: ObjectList::new(3, b"\x00\x01a\x01\x02bc\x02\x03def").expect("in order"),
        },
        "ReadDeviceInformationResponse(1, {0: b'a', 1: b'bc', 2: b'def'})",
        "ReadDeviceInformationResponse read_code=1 conformity=131 more_follows=0 \
         next_object_id=0 number_of_objects=3 information={0:61,1:6263,2:646566}",
    );
    identification_of_which_more_follows => case(
        Response::DeviceIdentification {
            code: 3,
            conformity: 0x83,
            more_follows: true,
            next_object: 0x81,
            objects: ObjectList::new(1, &OBJECT).expect("in order"),
        },
        "ReadDeviceInformationResponse(3, {0x80: b'x' * 200, 0x81: b'y' * 200})",
        "ReadDeviceInformationResponse read_code=3 conformity=131 more_follows=255 \
         next_object_id=129 number_of_objects=1 information={128:\
         7878787878787878787878787878787878787878787878787878787878787878787878787878787878\
         7878787878787878787878787878787878787878787878787878787878787878787878787878787878\
         7878787878787878787878787878787878787878787878787878787878787878787878787878787878\
         7878787878787878787878787878787878787878787878787878787878787878787878787878787878\
         787878787878787878787878787878787878787878787878787878787878787878787878}",
    );
    individual_identification => case(
        Response::DeviceIdentification {
            code: 4,
            conformity: 0x83,
            more_follows: false,
            next_object: 0,
            objects: ObjectList::new(1, b"\x06\x04name").expect("in order"),
        },
        "ReadDeviceInformationResponse(4, {6: b'name'})",
        "ReadDeviceInformationResponse read_code=4 conformity=131 more_follows=0 \
         next_object_id=0 number_of_objects=1 information={6:6e616d65}",
    );
    exception => case(
        Response::Exception { function: 0x18, code: 2 },
        "ExceptionResponse(0x18, 2)",
        "ExceptionResponse function_code=152 exception_code=2",
    );
    custom => case(
        Response::Custom { function: 0x41, data: &[3, 7, 8, 9] },
        "Custom(bytes([7, 8, 9]))",
        "Custom data=070809",
    );
}

/// An object of 200 bytes.
const OBJECT: [u8; 202] = {
    let mut object = [b'x'; 202];
    object[0] = 0x80;
    object[1] = 200;
    object
};

#[test]
fn a_response_to_force_listen_only_is_malformed_though_pymodbus_sends_one() {
    for (framing, name) in FRAMINGS {
        let mut sent = from_hex(&query(&format!(
            "reply {name} ForceListenOnlyModeResponse()"
        )));
        let adu = open(framing, &mut sent);
        let read = Response::parse(adu.pdu);
        assert_eq!(read, Err(mbm::error::Error::MALFORMED_REPLY));
    }
}
