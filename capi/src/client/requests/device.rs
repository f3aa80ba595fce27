//! Requests for device information, for file records, and with functions of the user.

use super::{code_only, two_words, with_more};
use crate::client::request::RequestFields;
use crate::client::{mbm_client, mbm_clientRequest};
use crate::functions::{mbm_rule, MBM_RULE_COUNTED, MBM_RULE_FIXED, MBM_RULE_SILENCE};
use core::slice::from_raw_parts;
use mbm::error::Status;
use mbm::pdu::functions::{FunctionSpec, COUNTS, FIXED, OWN};
use mbm::pdu::header::{RequestHeader, GROUP};
use mbm::pdu::MAX_PDU;

functions! {
    (client: *mut mbm_client, request: *mut mbm_clientRequest)

    /// Function 07: reads the eight exception status outputs into one byte of `reply` (V1.1b3,
    /// 6.7).
    ///
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readExceptionStatus() = code_only(FunctionSpec::READ_EXCEPTION_STATUS);

    /// Function 08: sends the words of `data`, and reads the same number of words into `reply`
    /// (V1.1b3, 6.8). No device responds to sub-function 04, Force Listen Only Mode.
    ///
    /// @param subFunction  0 (Return Query Data) to 0x14. The client also sends the others, which
    ///                     the standard reserves, and expects a response of one word; for a
    ///                     response of another length use mbm_client_custom
    /// @param words        the number of words of `data`: 1; for sub-function 0, 1 to 125
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_diagnostics(subFunction: u16, words: u16)
        = with_more(
            FunctionSpec::DIAGNOSTICS, [subFunction.into(), words.into(), 0, 0], Some(add_words));

    /// Function 0B: reads the status word and the event count into two words of `reply` (V1.1b3,
    /// 6.9).
    ///
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_getCommEventCounter() = code_only(FunctionSpec::GET_COMM_EVENT_COUNTER);

    /// Function 0C: reads status, event count and message count, and then up to 64 events, into
    /// the bytes of `reply`. The first three have two bytes each, the high byte first. An event
    /// is one byte; the latest event is first (V1.1b3, 6.10).
    ///
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_getCommEventLog() = code_only(FunctionSpec::GET_COMM_EVENT_LOG);

    /// Function 11: reads the server id, whose format is specific to the device (V1.1b3, 6.13).
    /// `reply` receives all bytes after the byte count. Some devices count only the id and send
    /// more bytes: `reply` receives those too. In RTU frames silence ends such a reply. The
    /// client does not wait for silence if the byte count is right.
    ///
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_reportServerId() = code_only(FunctionSpec::REPORT_SERVER_ID);

    /// Function 14: reads consecutive records of one file into the words of `reply` (V1.1b3,
    /// 6.14).
    ///
    /// @param file      the file number, 1 to 65535
    /// @param record    the first record, 0 to 9999
    /// @param quantity  the number of records, 1 to 121
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readFileRecord(file: u16, record: u16, quantity: u16)
        = with_more(
            FunctionSpec::READ_FILE_RECORD, [GROUP, file.into(), record.into(), quantity.into()],
            Some(add_group));

    /// Function 15: writes the words of `data` to consecutive records of one file (V1.1b3,
    /// 6.15).
    ///
    /// @param file      the file number, 1 to 65535
    /// @param record    the first record, 0 to 9999
    /// @param quantity  the number of records, 1 to 122
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeFileRecord(file: u16, record: u16, quantity: u16)
        = with_more(
            FunctionSpec::WRITE_FILE_RECORD, [GROUP, file.into(), record.into(), quantity.into()],
            Some(add_group));

    /// Function 18: reads up to 31 registers of a FIFO queue into the words of `reply` (V1.1b3,
    /// 6.18).
    ///
    /// @param address  the FIFO pointer address of the queue, 0 to 65535
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readFifoQueue(address: u16)
        = two_words(address, 0, FunctionSpec::READ_FIFO_QUEUE);

    /// Function 2B/0E: reads objects that identify the device (V1.1b3, 6.21). `reply` receives,
    /// as on the wire: the conformity level, more follows (0 or FF), the next object id, the
    /// number of objects, and of each object its id, length and value.
    ///
    /// @param code    the read device id code, MBM_DEVICE_ID_BASIC to MBM_DEVICE_ID_INDIVIDUAL
    /// @param object  the id of the first object to read
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readDeviceIdentification(code: u8, object: u8)
        = with_more(
            FunctionSpec::READ_DEVICE_IDENTIFICATION, identification(code, object),
            Some(|_, words, _| RequestHeader::check_code(words[2] as u8)));
}

/// Any function code: sends the bytes of `data` after the function code, and reads the bytes
/// after the function code of the response into `reply`. There may be none: `length` is 0 then.
/// The length rule holds for every function code, also for one of the standard.
///
/// @param function  the function code, 1 to 127
/// @param bytes     the number of bytes of `data`, 0 to 252
/// @param response  the length rule of the response; used during this call only
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_custom(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    bytes: u16,
    response: *const mbm_rule,
) -> u8 {
    let words = [
        function.into(),
        bytes.into(),
        response.expose_provenance(),
        0,
    ];
    with_more(
        client,
        request,
        FunctionSpec::CUSTOM,
        words,
        Some(|fields, words, _| {
            let response: *const mbm_rule = core::ptr::with_exposed_provenance(words[2]);
            let Some(response) = response.as_ref() else {
                return Status::INVALID_ARGUMENT;
            };
            let (kind, most) = match response.kind {
                MBM_RULE_SILENCE => (OWN, u8::MAX),
                MBM_RULE_FIXED => (FIXED, MAX_PDU as u8),
                MBM_RULE_COUNTED => (COUNTS, MAX_PDU as u8 - 1),
                _ => return Status::INVALID_ARGUMENT,
            };
            if kind != OWN && !(1..=most).contains(&response.bytes) {
                return Status::INVALID_ARGUMENT;
            }
            let numbers = match kind {
                OWN => [0, 0],
                _ => [response.bytes, response.more],
            };
            let header = &mut fields.state.header;
            header.add_rule(words[0] as u8, words[1] as u16, kind, numbers)
        }),
    )
}

/// Forwards a request that arrived from another client: sends `function` and the bytes of
/// `body`, and reads into `reply` all bytes after the function code of the response, as on
/// the wire. Use it for a gateway: the functions of mbm_unit_serveCustom receive the same
/// `body` and return the same `reply`.
///
/// The client accepts a response only if it matches the request, as for the other functions:
/// its length, byte count, echoed address, value, quantity and records must be right. The response
/// to a function code that the standard does not define may have no data. On RTU, silence ends it,
/// and the response to sub-functions of 08 from 0x15 on. If you know the length of the response, use
/// mbm_client_custom.
///
/// No device responds to 08 with sub-function 04: the request ends with MBM_OK and `length` 0
/// after the turnaround delay.
///
/// @param request   the request; if it is queued, its `data` then points into `body`
/// @param function  the function code, 1 to 127
/// @param body      the bytes after the function code; do not change them until the request has
///                  ended; may be NULL if `bytes` is 0. For 14 and 15 it may be the records
///                  alone, as mbm_packet_addRecord builds them: the client sends their byte
///                  count before them
/// @param bytes     the number of bytes of `body`, 0 to 252
/// @return a status; see mbm_client_readCoils. Also those with which a server answers such a
///         request: MBM_ILLEGAL_DATA_VALUE if the length or a count in `body` is wrong,
///         MBM_ILLEGAL_FUNCTION if the function code is 0 or above 127
#[no_mangle]
pub unsafe extern "C" fn mbm_client_forward(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    body: *const u8,
    bytes: u16,
) -> u8 {
    forward::<true>(client, request, function, body, bytes)
}

/// As [`mbm_client_forward`]. Records without a byte count are refused unless they `MAY_LACK_COUNT`.
///
/// # Safety
/// As for [`mbm_client_forward`].
pub unsafe fn forward<const MAY_LACK_COUNT: bool>(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    body: *const u8,
    bytes: u16,
) -> u8 {
    // `data` is set to the last bytes of the body.
    let fields = request.cast::<RequestFields>();
    let previous_data = match fields.as_ref() {
        Some(fields) => fields.data,
        None => body,
    };
    let words = [function.into(), bytes.into(), body.expose_provenance(), 0];
    let status = with_more(
        client,
        request,
        FunctionSpec::CUSTOM,
        words,
        Some(|fields, words, _| {
            let body: *const u8 = core::ptr::with_exposed_provenance(words[2]);
            let header = &mut fields.state.header;
            let bytes = match words[1] {
                0 => &[],
                _ if body.is_null() => return Status::INVALID_ARGUMENT,
                count => from_raw_parts(body, count),
            };
            let function = words[0] as u8;
            let status = if MAY_LACK_COUNT {
                header.forward_groups(function, bytes)
            } else {
                header.forward(function, bytes)
            };
            if status == Status::OK {
                let head = words[1] - usize::from(header.data_length());
                fields.data = body.wrapping_add(head);
            }
            status
        }),
    );
    if status != Status::PENDING.code() && !fields.is_null() {
        (*fields).data = previous_data;
    }
    status
}

/// The words of a request for a device identification, and its code.
fn identification(code: u8, object: u8) -> [usize; 4] {
    let [first, second] = RequestHeader::identification(code, object);
    [first.into(), second.into(), code.into(), 0]
}

/// Adds the words that the request sends.
///
/// # Safety
/// As for [`add_group`].
unsafe fn add_words(fields: &mut RequestFields, words: &[usize; 4], _: Status) -> Status {
    let header = &mut fields.state.header;
    header.add_words(words[0] as u16, words[1] as u16)
}

/// Adds the group of file records that the request reads or writes.
///
/// # Safety
/// Always safe. It is unsafe only to have the type [`More`](super::More).
unsafe fn add_group(fields: &mut RequestFields, words: &[usize; 4], _: Status) -> Status {
    let [_, file, record, quantity] = *words;
    let header = &mut fields.state.header;
    header.add_group(file as u16, record as u16, quantity as u16)
}
