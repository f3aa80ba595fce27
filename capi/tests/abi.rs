//! Sizes, offsets and constants are the same in C and in Rust. The test compiles and runs a C
//! program that includes `mbm.h`, and compares what it prints with the values in Rust.

use mbm::pdu::functions;
use mbm_c::*;
use std::fs;
use std::mem::{align_of, offset_of, size_of};
use std::path::Path;
use std::process::Command;

/// Pairs of a C expression and its value in Rust.
macro_rules! probes {
    (sizes: $($type:ident)*; offsets: $($owner:ident { $($field:ident)* })*; constants: $($constant:ident)*;) => {
        vec![
            $((format!("sizeof({})", stringify!($type)), size_of::<$type>() as u64),
              (format!("alignof({})", stringify!($type)), align_of::<$type>() as u64),)*
            $($((format!("offsetof({}, {})", stringify!($owner), stringify!($field)),
                 offset_of!($owner, $field) as u64),)*)*
            $((stringify!($constant).to_owned(), u64::from($constant)),)*
        ]
    };
}

fn probes() -> Vec<(String, u64)> {
    probes! {
        sizes: mbm_port mbm_counters mbm_line mbm_node mbm_nodeCallbacks mbm_registers mbm_ring mbm_dmaRing mbm_rule mbm_function
            mbm_length mbm_packet mbm_record mbm_object mbm_framing mbm_server mbm_unit
            mbm_service mbm_registerTable mbm_bitTable mbm_dataCallbacks mbm_file mbm_files mbm_fifo
            mbm_fifos mbm_access mbm_accessHooks mbm_recordHooks mbm_exceptionStatus mbm_serverId mbm_serverIdentification mbm_request mbm_custom
            mbm_functionMask mbm_diagnostics mbm_sniffer mbm_event mbm_client mbm_clientRequest mbm_clientUnit mbm_linkHooks
            mbm_plan mbm_planPosition mbm_planRead mbm_planSetup mbm_planUnitLimits
            mbm_planExcludedRange mbm_planReadInfo mbm_planField mbm_trace mbm_traceRecord
            mbm_gateway mbm_gatewayRoute mbm_gatewayLine mbm_gatewayConnection mbm_gatewayRequest
            mbm_gatewayConfig mbm_identification mbm_link mbm_linkCounters;
        offsets:
            mbm_port { context read write micros flush preTransmission postTransmission idle }
            mbm_counters { requests replies exceptions badCrc timeouts foreignFrames
                resynchronisations bytesSent bytesReceived }
            mbm_clientRequest { done context data reply replyBytes transaction unit status exception
                length timeoutMs retryLimit }
            mbm_identification { request object done context count conformity }
            mbm_clientUnit { requests replies exceptions retries delayUs unit status retryLimit
                timeoutMs }
            mbm_linkHooks { context disconnect connect status }
            mbm_linkCounters { attempts failed connected lost }
            mbm_planUnitLimits { bitsPerRead registersPerRead unit }
            mbm_planExcludedRange { first last unit table }
            mbm_planReadInfo { intervalMs address quantity unit table status }
            mbm_planSetup { fields positions reads data requests units excluded update context
                backoffMs longestBackoffMs fieldCount readCount dataWords bitsPerRead bitGap
                registersPerRead registerGap requestCount unitCount excludedCount }
            mbm_traceRecord { bytes timeUs length direction kind status }
            mbm_gatewayRoute { first last line unit }
            mbm_gatewayLine { client context isReady inFlight }
            mbm_gatewayConfig { routes lines connections requests requestCount routeCount lineCount
                connectionCount }
            mbm_rule { kind bytes more }
            mbm_function { code request response }
            mbm_length { bytes kind }
            mbm_packet { data dataLength transaction address quantity writeAddress writeQuantity
                value andMask orMask subFunction commStatus eventCount messageCount kind unit
                function exceptionCode exceptionStatus byteCount meiType readDeviceIdCode objectId
                conformity moreFollows nextObjectId objectCount }
            mbm_record { data file record length }
            mbm_object { data length id }
            mbm_framing { functions functionCount kind delimiter }
            mbm_registers { data first count kind order }
            mbm_service { serve kind }
            mbm_unit { services monitor diagnostics id }
            mbm_registerTable { service words valid hooks base size }
            mbm_bitTable { service bits valid hooks base size }
            mbm_dataCallbacks { service context isValid get set hooks }
            mbm_file { records size number }
            mbm_files { service files count hooks }
            mbm_access { data connection address quantity file unit function }
            mbm_accessHooks { context beforeRead beforeWrite afterWrite }
            mbm_recordHooks { hooks call }
            mbm_fifo { words address count }
            mbm_fifos { service fifos count }
            mbm_exceptionStatus { service outputs }
            mbm_serverId { service id additional idLength additionalLength running }
            mbm_serverIdentification { service objects count }
            mbm_request { data connection length unit function }
            mbm_custom { service serve context code length }
            mbm_functionMask { service off }
            mbm_diagnostics { service restart context diagnosticRegister busMessages
                busCommunicationErrors exceptionErrors serverMessages noResponses naks busy
                characterOverruns events listenOnly hidden }
            mbm_event { frame pdu packet timeUs responseTimeUs frameLength pduLength length address
                quantity kind status unit function requestHead requestHeadLength };
        constants:
            MBM_OK MBM_ILLEGAL_FUNCTION MBM_ILLEGAL_DATA_ADDRESS MBM_ILLEGAL_DATA_VALUE
            MBM_SERVER_DEVICE_FAILURE MBM_ACKNOWLEDGE MBM_SERVER_DEVICE_BUSY
            MBM_MEMORY_PARITY_ERROR MBM_GATEWAY_PATH_UNAVAILABLE
            MBM_GATEWAY_TARGET_FAILED_TO_RESPOND MBM_INVALID_SLAVE_ID MBM_INVALID_FUNCTION
            MBM_RESPONSE_TIMED_OUT MBM_INVALID_CRC MBM_INVALID_ARGUMENT MBM_MALFORMED_REPLY
            MBM_LINK_LOST MBM_BUSY MBM_BROADCAST_NOT_ALLOWED MBM_BUFFER_TOO_SMALL
            MBM_NOT_INITIALISED MBM_PENDING MBM_LINE_BUSY MBM_CANCELLED
            MBM_INCOMPLETE_FRAME MBM_MALFORMED_FRAME MBM_QUEUE_FULL
            MBM_DUPLICATE_TRANSACTION MBM_NOT_PENDING MBM_NO_PROGRESS MBM_OUT_OF_RANGE
            MBM_CONNECT_TIMED_OUT MBM_NOT_AVAILABLE MBM_MALFORMED_VALUE MBM_CLIENT_DEPTH MBM_ACCEPT_UNIT MBM_ACCEPT_TRANSACTION
            MBM_LINK_CLOSE_NEVER MBM_LINK_CLOSE_WHEN_IDLE MBM_LINK_CLOSE_AFTER_FAILURE
            MBM_BACKOFF_NONE MBM_BACKOFF_FIXED MBM_BACKOFF_LINEAR MBM_BACKOFF_EXPONENTIAL
            MBM_NO_RETRIES MBM_LINK_IS_DOWN MBM_LINK_IS_CONNECTING MBM_LINK_IS_UP
            MBM_LINK_EVENT_CONNECTED MBM_LINK_EVENT_LOST MBM_LINK_EVENT_FAILED
            MBM_MAX_READ_REGISTERS MBM_MAX_WRITE_REGISTERS MBM_MAX_READ_WRITE_REGISTERS
            MBM_MAX_READ_BITS MBM_MAX_WRITE_BITS MBM_MAX_FRAME MBM_DIAGNOSTICS_RETURN_QUERY_DATA
            MBM_DIAGNOSTICS_RESTART_COMMUNICATIONS MBM_DIAGNOSTICS_RETURN_DIAGNOSTIC_REGISTER
            MBM_DIAGNOSTICS_CHANGE_ASCII_INPUT_DELIMITER MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY
            MBM_DIAGNOSTICS_CLEAR_COUNTERS MBM_DIAGNOSTICS_BUS_MESSAGE_COUNT
            MBM_DIAGNOSTICS_BUS_COMMUNICATION_ERROR_COUNT
            MBM_DIAGNOSTICS_BUS_EXCEPTION_ERROR_COUNT MBM_DIAGNOSTICS_SERVER_MESSAGE_COUNT
            MBM_DIAGNOSTICS_SERVER_NO_RESPONSE_COUNT MBM_DIAGNOSTICS_SERVER_NAK_COUNT
            MBM_DIAGNOSTICS_SERVER_BUSY_COUNT MBM_DIAGNOSTICS_BUS_CHARACTER_OVERRUN_COUNT
            MBM_DIAGNOSTICS_CLEAR_OVERRUN_COUNTER MBM_MEI_CANOPEN
            MBM_MEI_READ_DEVICE_IDENTIFICATION MBM_DEVICE_ID_BASIC MBM_DEVICE_ID_REGULAR
            MBM_DEVICE_ID_EXTENDED MBM_DEVICE_ID_INDIVIDUAL MBM_RULE_SILENCE MBM_RULE_FIXED
            MBM_RULE_COUNTED MBM_PACKET_REQUEST MBM_PACKET_RESPONSE MBM_PACKET_EXCEPTION
            MBM_MAX_PDU MBM_LENGTH_EXACT MBM_LENGTH_AT_LEAST MBM_LENGTH_SILENCE
            MBM_LENGTH_UNKNOWN MBM_FRAMING_RTU MBM_FRAMING_ASCII MBM_FRAMING_TCP
            MBM_FRAMING_RTU_OVER_TCP MBM_FRAMING_NONE MBM_VERSION_MAJOR MBM_VERSION_MINOR
            MBM_VERSION_PATCH MBM_MAX_TCP_FRAME MBM_MAX_ASCII_FRAME MBM_ORDER_DEFAULT
            MBM_ORDER_ABCD MBM_ORDER_CDAB MBM_ORDER_BADC MBM_ORDER_DCBA MBM_ORDER_EFGHABCD
            MBM_ORDER_CDABGHEF MBM_ORDER_FEHGBADC MBM_ORDER_DCBAHGFE MBM_TEXT_LOW_BYTES
            MBM_TEXT_HIGH_BYTES MBM_TEXT_SPACES MBM_DATE_SUMMER_TIME MBM_DATE_UNRELIABLE MBM_REGISTERS_OF_WORDS
            MBM_REGISTERS_OF_BYTES MBM_REGISTERS_INTO_WORDS MBM_REGISTERS_INTO_BYTES
            MBM_REPLY_EXCEPTION MBM_REPLY_NONE MBM_REPLY_PENDING MBM_REPLY_DECLINED MBM_EVENT_REQUEST MBM_EVENT_REPLY MBM_EVENT_EXCEPTION
            MBM_EVENT_UNPAIRED MBM_EVENT_TIMEOUT MBM_EVENT_BAD_CRC MBM_EVENT_NOISE MBM_DIRECTION_BOTH
            MBM_DIRECTION_CLIENT MBM_DIRECTION_SERVER MBM_MIN_SNIFFER_BUFFER MBM_MAX_SNIFFER_FUNCTIONS
            MBM_MAX_SERVICES MBM_TABLE_COILS MBM_TABLE_DISCRETE_INPUTS
            MBM_TABLE_HOLDING_REGISTERS MBM_TABLE_INPUT_REGISTERS MBM_TYPE_BIT MBM_TYPE_UINT16
            MBM_TYPE_INT16 MBM_TYPE_UINT32 MBM_TYPE_INT32 MBM_TYPE_UINT64 MBM_TYPE_INT64
            MBM_TYPE_FLOAT MBM_TYPE_DOUBLE MBM_TYPE_TEXT MBM_TYPE_REGISTERS MBM_PLAN_LONGEST_INTERVAL
            MBM_PLAN_MAX_FIELDS MBM_CONVERSION_STANDARD MBM_CONVERSION_POWER MBM_TRACE_RECEIVED MBM_TRACE_SENT MBM_MIN_TRACE_BUFFER
            MBM_GATEWAY_LOCAL MBM_GATEWAY_ALL_LINES MBM_GATEWAY_UNIT_0;
    }
}

/// The values of the expressions in C: compiles and runs a C program that prints them.
fn values_in_c(compiler: &mut Command, expressions: &[String], folder: &Path) -> Vec<u64> {
    let mut source = String::from(
        "#include <stdalign.h>\n#include <stddef.h>\n#include <stdio.h>\n#include \"mbm.h\"\nint main(void)\n{\n",
    );
    for expression in expressions {
        source += &format!("    printf(\"%llu\\n\", (unsigned long long)({expression}));\n");
    }
    source += "    return 0;\n}\n";
    let file = folder.join("probe.c");
    let program = folder.join("probe");
    fs::write(&file, source).expect("the probe is written");
    let compiled = compiler
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror"])
        .arg("-I")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("include"))
        .arg(&file)
        .arg("-o")
        .arg(&program)
        .status()
        .expect("the C compiler runs");
    assert!(compiled.success());
    let output = Command::new(&program).output().expect("the probe runs");
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| line.parse().expect("a number"))
        .collect()
}

#[test]
fn sizes_offsets_and_constants_agree_with_c() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let host = &format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let probes = probes();
    let expressions: Vec<String> = probes.iter().map(|(name, _)| name.clone()).collect();
    let mut compiler = cc::Build::new()
        .target(host)
        .host(host)
        .opt_level(0)
        .get_compiler()
        .to_command();
    let values = values_in_c(&mut compiler, &expressions, folder);
    assert_eq!(values.len(), probes.len());
    for ((name, rust), c) in probes.iter().zip(values) {
        assert_eq!(*rust, c, "{name}");
    }
}

/// The constants of the header that are numbers.
fn constants() -> Vec<(String, u64)> {
    let parts = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/include/mbm")).unwrap();
    let header: String = parts
        .map(|part| std::fs::read_to_string(part.unwrap().path()).unwrap())
        .collect();
    let defined = header.lines().filter_map(|line| {
        let (name, value) = line.strip_prefix("#define ")?.split_once(' ')?;
        let value = value.trim().trim_end_matches('u').parse().ok()?;
        name.starts_with("MBM_").then(|| (name.to_string(), value))
    });
    defined.collect()
}

#[test]
fn the_probes_include_every_constant_of_the_header() {
    let mut defined: Vec<_> = constants().into_iter().map(|(name, _)| name).collect();
    defined.retain(|name| !name.starts_with("MBM_FC_"));
    let mut probed: Vec<_> = probes().into_iter().map(|(name, _)| name).collect();
    probed.retain(|name| name.starts_with("MBM_"));
    for name in &defined {
        assert!(
            probed.contains(name),
            "`probes` in capi/tests/abi.rs lacks {name}"
        );
    }
    assert_eq!(defined.len(), probed.len());
}

#[test]
fn the_function_codes_of_the_header_are_those_of_the_table() {
    let mut defined = constants();
    defined.retain(|(name, _)| name.starts_with("MBM_FC_"));
    assert_eq!(defined.len(), functions::CODES.len());
    for (name, code) in defined {
        let code = u8::try_from(code).unwrap();
        let words = functions::name(code)
            .to_uppercase()
            .replace([' ', '/'], "_");
        assert_eq!(name, format!("MBM_FC_{words}"));
    }
}

#[test]
fn every_status_constant_has_its_own_text() {
    let text = |status| {
        // SAFETY: mbm_status_text returns a constant string.
        let pointer = mbm_status_text(status);
        unsafe { std::ffi::CStr::from_ptr(pointer) }
            .to_str()
            .unwrap()
            .to_owned()
    };
    let statuses: Vec<u8> = (0..=0x0B).chain(0xE0..=0xF2).chain([0xF8]).collect();
    let mut texts: Vec<String> = statuses.iter().map(|status| text(*status)).collect();
    texts.sort();
    texts.dedup();
    // 07 and 09 have the same text: the standard does not name these exception codes.
    assert_eq!(texts.len(), statuses.len() - 1);
    assert_eq!(text(0xFF), "not a status");
}
