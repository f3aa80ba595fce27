//! Requests: pymodbus's server reads those of mbm, and mbm reads those of pymodbus's client.

use crate::process::query;
use crate::{frame, from_hex, hex, open, read_as, FRAMINGS};
use mbm::pdu::files::{Reads, Writes};
use mbm::pdu::request::Request;

struct Case {
    mbm: Request<'static>,
    /// The call of pymodbus's client that sends the same request.
    call: &'static str,
    /// What pymodbus's server reads.
    fields: &'static str,
    /// What pymodbus's server reads in RTU framing, if that differs.
    over_rtu: Option<&'static str>,
}

fn case(mbm: Request<'static>, call: &'static str, fields: &'static str) -> Case {
    Case {
        mbm,
        call,
        fields,
        over_rtu: None,
    }
}

fn check_pymodbus_reads_mbm(case: &Case) {
    for (framing, name) in FRAMINGS {
        let sent = frame(framing, |pdu| case.mbm.emit(pdu));
        let read = query(&format!("request {name} {}", hex(&sent)));
        match case.over_rtu {
            Some(quirk) if name == "rtu" => assert_eq!(read, quirk),
            _ => assert_eq!(read, read_as(name, case.fields), "{name}"),
        }
    }
}

fn check_mbm_reads_pymodbus(case: &Case) {
    for (framing, name) in FRAMINGS {
        let mut sent = from_hex(&query(&format!("call {name} {}", case.call)));
        assert_eq!(sent, frame(framing, |pdu| case.mbm.emit(pdu)), "{name}");
        let adu = open(framing, &mut sent);
        assert_eq!(Request::parse(adu.pdu), Ok(case.mbm), "{name}");
    }
}

macro_rules! cases {
    ($($name:ident => $case:expr;)*) => { $(
        mod $name {
            use super::*;
            #[test]
            fn request_is_read_by_pymodbus() {
                check_pymodbus_reads_mbm(&$case);
            }
            #[test]
            fn request_of_pymodbus_is_read() {
                check_mbm_reads_pymodbus(&$case);
            }
        }
    )* };
}

/// A request of function 08 with one word of data.
fn diagnostics(
    sub_function: u16,
    data: &'static [u8; 2],
    call: &'static str,
    fields: &'static str,
) -> Case {
    case(Request::Diagnostics { sub_function, data }, call, fields)
}

const NONE: &[u8; 2] = &[0, 0];

cases! {
    read_coils => case(
        Request::ReadBits { function: 1, address: 0x13, quantity: 19 },
        "read_coils(0x13, count=19)",
        "ReadCoilsRequest address=19 count=19",
    );
    read_discrete_inputs => case(
        Request::ReadBits { function: 2, address: 0xC4, quantity: 22 },
        "read_discrete_inputs(0xC4, count=22)",
        "ReadDiscreteInputsRequest address=196 count=22",
    );
    read_holding_registers => case(
        Request::ReadRegisters { function: 3, address: 0x6B, quantity: 3 },
        "read_holding_registers(0x6B, count=3)",
        "ReadHoldingRegistersRequest address=107 count=3",
    );
    read_input_registers => case(
        Request::ReadRegisters { function: 4, address: 8, quantity: 1 },
        "read_input_registers(8)",
        "ReadInputRegistersRequest address=8 count=1",
    );
    write_single_coil => case(
        Request::WriteSingleCoil { address: 0xAC, on: true },
        "write_coil(0xAC, True)",
        "WriteSingleCoilRequest address=172 bits=[true]",
    );
    write_single_register => case(
        Request::WriteSingleRegister { address: 1, value: 0x8003 },
        "write_register(1, 0x8003)",
        "WriteSingleRegisterRequest address=1 registers=[32771]",
    );
    read_exception_status => case(
        Request::ReadExceptionStatus,
        "read_exception_status()",
        "ReadExceptionStatusRequest",
    );
    return_query_data => diagnostics(
        0x00, &[0xA5, 0x37], "diag_query_data(b'\\xA5\\x37')",
        "ReturnQueryDataRequest sub_function_code=0 message=a537",
    );
    return_query_data_of_two_words => Case {
        // In RTU framing, pymodbus assumes that every frame of function 08 has 8 bytes.
        over_rtu: Some("nothing"),
        ..case(
            Request::Diagnostics { sub_function: 0, data: &[1, 2, 3, 4] },
            "diag_query_data(bytes([1, 2, 3, 4]))",
            "ReturnQueryDataRequest sub_function_code=0 message=01020304",
        )
    };
    restart_communications => diagnostics(
        0x01, NONE, "diag_restart_communication(False)",
        "RestartCommunicationsOptionRequest sub_function_code=1 message=0",
    );
    restart_communications_and_clear_the_log => diagnostics(
        0x01, &[0xFF, 0], "diag_restart_communication(True)",
        "RestartCommunicationsOptionRequest sub_function_code=1 message=65280",
    );
    return_diagnostic_register => diagnostics(
        0x02, NONE, "diag_read_diagnostic_register()",
        "ReturnDiagnosticRegisterRequest sub_function_code=2 message=0",
    );
    change_ascii_input_delimiter => diagnostics(
        0x03, b"!\0", "diag_change_ascii_input_delimeter(delimiter=0x2100)",
        "ChangeAsciiInputDelimiterRequest sub_function_code=3 message=8448",
    );
    force_listen_only => diagnostics(
        0x04, NONE, "diag_force_listen_only()",
        "ForceListenOnlyModeRequest sub_function_code=4 message=0",
    );
    clear_counters => diagnostics(
        0x0A, NONE, "diag_clear_counters()",
        "ClearCountersRequest sub_function_code=10 message=0",
    );
    bus_message_count => diagnostics(
        0x0B, NONE, "diag_read_bus_message_count()",
        "ReturnBusMessageCountRequest sub_function_code=11 message=0",
    );
    bus_communication_error_count => diagnostics(
        0x0C, NONE, "diag_read_bus_comm_error_count()",
        "ReturnBusCommunicationErrorCountRequest sub_function_code=12 message=0",
    );
    bus_exception_error_count => diagnostics(
        0x0D, NONE, "diag_read_bus_exception_error_count()",
        "ReturnBusExceptionErrorCountRequest sub_function_code=13 message=0",
    );
    server_message_count => diagnostics(
        0x0E, NONE, "diag_read_device_message_count()",
        "ReturnDeviceMessageCountRequest sub_function_code=14 message=0",
    );
    server_no_response_count => diagnostics(
        0x0F, NONE, "diag_read_device_no_response_count()",
        "ReturnDeviceNoResponseCountRequest sub_function_code=15 message=0",
    );
    server_nak_count => diagnostics(
        0x10, NONE, "diag_read_device_nak_count()",
        "ReturnDeviceNAKCountRequest sub_function_code=16 message=0",
    );
    server_busy_count => diagnostics(
        0x11, NONE, "diag_read_device_busy_count()",
        "ReturnDeviceBusyCountRequest sub_function_code=17 message=0",
    );
    bus_character_overrun_count => diagnostics(
        0x12, NONE, "diag_read_bus_char_overrun_count()",
        "ReturnDeviceBusCharacterOverrunCountRequest sub_function_code=18 message=0",
    );
    clear_overrun_counter => diagnostics(
        0x14, NONE, "diag_clear_overrun_counter()",
        "ClearOverrunCountRequest sub_function_code=20 message=0",
    );
    get_comm_event_counter => case(
        Request::GetCommEventCounter,
        "diag_get_comm_event_counter()",
        "GetCommEventCounterRequest",
    );
    get_comm_event_log => case(
        Request::GetCommEventLog,
        "diag_get_comm_event_log()",
        "GetCommEventLogRequest",
    );
    write_multiple_coils => case(
        Request::WriteMultipleCoils { address: 0x13, quantity: 10, data: &[0xCD, 0x01] },
        "write_coils(0x13, [bool(0x1CD >> i & 1) for i in range(10)])",
        "WriteMultipleCoilsRequest address=19 count=10 \
         bits=[true,false,true,true,false,false,true,true,true,false]",
    );
    write_multiple_registers => case(
        Request::WriteMultipleRegisters { address: 1, quantity: 2, data: &[0, 10, 1, 2] },
        "write_registers(1, [10, 0x102])",
        "WriteMultipleRegistersRequest address=1 count=2 registers=[10,258]",
    );
    report_server_id => case(
        Request::ReportServerId,
        "report_device_id()",
        "ReportDeviceIdRequest",
    );
    read_file_record => case(
        Request::ReadFileRecord(
            Reads::new(&[6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 4]).expect("in order"),
        ),
        "read_file_record([FileRecord(4, 1, record_length=4), FileRecord(3, 9, record_length=8)])",
        // pymodbus halves the record length that it has read.
        "ReadFileRecordRequest records=[4/1/1/,3/9/2/]",
    );
    write_file_record => case(
        Request::WriteFileRecord(
            Writes::new(&[6, 0, 4, 0, 7, 0, 3, 0x06, 0xAF, 0x04, 0xBE, 0x10, 0x0D])
                .expect("in order"),
        ),
        "write_file_record([FileRecord(4, 7, bytes.fromhex('06AF04BE100D'))])",
        "WriteFileRecordRequest records=[4/7/3/06af04be100d]",
    );
    write_two_file_records => case(
        Request::WriteFileRecord(
            Writes::new(&[6, 0, 4, 0, 7, 0, 1, 1, 2, 6, 0, 5, 0, 8, 0, 2, 3, 4, 5, 6])
                .expect("in order"),
        ),
        "write_file_record([FileRecord(4, 7, bytes([1, 2])), FileRecord(5, 8, bytes([3, 4, 5, 6]))])",
        "WriteFileRecordRequest records=[4/7/1/0102,5/8/2/03040506]",
    );
    mask_write_register => case(
        Request::MaskWriteRegister { address: 4, and_mask: 0xF2, or_mask: 0x25 },
        "mask_write_register(address=4, and_mask=0xF2, or_mask=0x25)",
        "MaskWriteRegisterRequest address=4 and_mask=242 or_mask=37",
    );
    read_write_multiple_registers => case(
        Request::ReadWriteMultipleRegisters {
            read_address: 3,
            read_quantity: 6,
            write_address: 14,
            write_quantity: 3,
            data: &[0, 0xFF, 0, 0xFE, 0, 0xFD],
        },
        "readwrite_registers(read_address=3, read_count=6, write_address=14, values=[0xFF, 0xFE, 0xFD])",
        "ReadWriteMultipleRegistersRequest read_address=3 read_count=6 \
         write_address=14 write_count=3 write_registers=[255,254,253]",
    );
    read_fifo_queue => case(
        Request::ReadFifoQueue { address: 0x04DE },
        "read_fifo_queue(address=0x04DE)",
        "ReadFifoQueueRequest address=1246",
    );
    read_basic_identification => case(
        Request::ReadDeviceIdentification { code: 1, object: 0 },
        "read_device_information(read_code=1, object_id=0)",
        "ReadDeviceInformationRequest read_code=1 object_id=0",
    );
    read_regular_identification => case(
        Request::ReadDeviceIdentification { code: 2, object: 3 },
        "read_device_information(read_code=2, object_id=3)",
        "ReadDeviceInformationRequest read_code=2 object_id=3",
    );
    read_extended_identification => case(
        Request::ReadDeviceIdentification { code: 3, object: 0x80 },
        "read_device_information(read_code=3, object_id=0x80)",
        "ReadDeviceInformationRequest read_code=3 object_id=128",
    );
    read_individual_identification => case(
        Request::ReadDeviceIdentification { code: 4, object: 6 },
        "read_device_information(read_code=4, object_id=6)",
        "ReadDeviceInformationRequest read_code=4 object_id=6",
    );
    custom => case(
        Request::Custom { function: 0x41, data: &[3, 7, 8, 9] },
        "custom(bytes([7, 8, 9]))",
        "Custom data=070809",
    );
}

#[test]
fn reserved_sub_functions_are_refused_though_pymodbus_has_them() {
    for call in [
        "diag_read_iop_overrun_count()",
        "diag_getclear_modbus_response(data=3)",
    ] {
        for (framing, name) in FRAMINGS {
            let mut sent = from_hex(&query(&format!("call {name} {call}")));
            let adu = open(framing, &mut sent);
            let read = Request::parse(adu.pdu);
            assert_eq!(read, Err(mbm::error::Error::ILLEGAL_FUNCTION));
        }
    }
}

#[test]
fn a_delimiter_in_the_low_byte_is_refused_though_pymodbus_sends_it_there() {
    for (framing, name) in FRAMINGS {
        let call = "diag_change_ascii_input_delimeter(delimiter=0x21)";
        let mut sent = from_hex(&query(&format!("call {name} {call}")));
        let adu = open(framing, &mut sent);
        let read = Request::parse(adu.pdu);
        assert_eq!(read, Err(mbm::error::Error::ILLEGAL_DATA_VALUE));
    }
}
