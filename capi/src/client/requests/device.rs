//! Requests for what a device tells of itself, its files, and functions of the
//! user's.

use super::{bare, plain, special};
use crate::client::request::RequestFields;
use crate::client::{mbm_client, mbm_clientRequest};
use crate::functions::{mbm_rule, MBM_RULE_COUNTED, MBM_RULE_FIXED, MBM_RULE_SILENCE};
use crate::pointers::lent_or_none;
use mbm::error::Status;
use mbm::pdu::function_spec::{FunctionSpec, COUNTS, FIXED, OWN};
use mbm::pdu::header::{RequestHeader, GROUP};
use mbm::pdu::limits::MAX_PDU;

/// Function 07: reads eight outputs into a byte (V1.1b3, 6.7).
///
/// @param client   the object
/// @param request  the request
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readExceptionStatus(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { bare(client, request, FunctionSpec::READ_EXCEPTION_STATUS) }
}

/// Function 08: sends the words of `data`, and reads as many into `reply` (V1.1b3,
/// 6.8). No device responds to sub-function 04, Force Listen Only Mode.
///
/// @param client   the object
/// @param request  the request
/// @param subFunction  0 (Return Query Data) to 0x14. Others, which the standard
///                     reserves, are sent as they are, and a response of one word is
///                     expected; for one of another length see mbm_client_custom
/// @param words  1; 1 to 125 for sub-function 0
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_diagnostics(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    subFunction: u16,
    words: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::DIAGNOSTICS,
            [subFunction.into(), words.into(), 0, 0],
            Some(|inside, words, _| {
                let header = &mut inside.state.header;
                header.add_words(words[0] as u16, words[1] as u16)
            }),
        )
    }
}

/// Function 0B: reads the status word and the event count into two words (V1.1b3,
/// 6.9).
///
/// @param client   the object
/// @param request  the request
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getCommEventCounter(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { bare(client, request, FunctionSpec::GET_COMM_EVENT_COUNTER) }
}

/// Function 0C: reads status, event count and message count, two bytes each with the
/// high byte first, and up to 64 events, the latest first (V1.1b3, 6.10).
///
/// @param client   the object
/// @param request  the request
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getCommEventLog(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { bare(client, request, FunctionSpec::GET_COMM_EVENT_LOG) }
}

/// Function 11: reads what the device says of itself, as it likes (V1.1b3, 6.13). `reply`
/// gets all that follows the byte count, also from a device that counts its id alone
/// and sends more. In RTU frames the silence after it ends such a reply; one that
/// counts right is not waited for.
///
/// @param client   the object
/// @param request  the request
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_reportServerId(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { bare(client, request, FunctionSpec::REPORT_SERVER_ID) }
}

/// Function 14: reads records in a row of one file into words (V1.1b3, 6.14).
///
/// @param client   the object
/// @param request  the request
/// @param file  1 to 65535
/// @param record  first record, 0 to 9999
/// @param quantity  1 to 121
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readFileRecord(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    file: u16,
    record: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::READ_FILE_RECORD,
            [GROUP, file.into(), record.into(), quantity.into()],
            Some(add_group),
        )
    }
}

/// Function 15: writes the words of `data` to records in a row of one file (V1.1b3,
/// 6.15).
///
/// @param client   the object
/// @param request  the request
/// @param file  1 to 65535
/// @param record  first record, 0 to 9999
/// @param quantity  1 to 122
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeFileRecord(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    file: u16,
    record: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::WRITE_FILE_RECORD,
            [GROUP, file.into(), record.into(), quantity.into()],
            Some(add_group),
        )
    }
}

/// Function 14 of several groups: `data` are the sub-requests as on the wire, seven
/// bytes each; `reply` gets the sub-responses as on the wire (V1.1b3, 6.14).
///
/// @param client   the object
/// @param request  the request
/// @param bytes  7 to 245, a multiple of 7
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readFileRecords(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::READ_FILE_RECORDS,
            [bytes.into(), 0, 0, 0],
            Some(|inside, words, _| inside.state.header.read_file_records(words[0] as u16)),
        )
    }
}

/// Function 15 of several groups: `data` are the sub-requests as on the wire (V1.1b3,
/// 6.15).
///
/// @param client   the object
/// @param request  the request
/// @param bytes  9 to 251
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeFileRecords(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::WRITE_FILE_RECORDS,
            [bytes.into(), 0, 0, 0],
            Some(|inside, words, _| inside.state.header.write_file_records(words[0] as u16)),
        )
    }
}

/// Function 18: reads up to 31 registers of a queue into words (V1.1b3, 6.18).
///
/// @param client   the object
/// @param request  the request
/// @param address  the pointer address of the queue
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readFifoQueue(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, 0, FunctionSpec::READ_FIFO_QUEUE) }
}

/// Function 2B/0E: reads objects that identify the device (V1.1b3, 6.21). `reply` gets,
/// as on the wire, conformity level, more follows (0 or FF), the next object id, how
/// many objects there are, and of each its id, length and value.
///
/// @param client   the object
/// @param request  the request
/// @param code  1 basic, 2 regular, 3 extended, 4 one object
/// @param object  the object to begin with
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readDeviceIdentification(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    code: u8,
    object: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let [first, second] = RequestHeader::identification(code, object);
        special(
            client,
            request,
            FunctionSpec::READ_DEVICE_IDENTIFICATION,
            [first.into(), second.into(), code.into(), 0],
            Some(|_, words, _| RequestHeader::check_code(words[2] as u8)),
        )
    }
}

/// Function 2B of any MEI type: sends bytes of `data` and reads what comes (V1.1b3,
/// 6.19). On RTU, silence ends the response.
///
/// @param client   the object
/// @param request  the request
/// @param meiType  0x0D is CANopen
/// @param bytes  0 to 251
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_encapsulatedInterfaceTransport(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    meiType: u8,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::ENCAPSULATED,
            [usize::from(meiType) << 8, bytes.into(), 0, 0],
            Some(|inside, words, _| inside.state.header.follow(words[1] as u16)),
        )
    }
}

/// Any function: sends bytes of `data` behind the function code, and reads what is
/// behind it in the response.
///
/// @param client    the object
/// @param request   the request
/// @param function  1 to 127
/// @param bytes     0 to 252
/// @param response  how long the response is; used during this call only
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_custom(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    bytes: u16,
    response: *const mbm_rule,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let words = [
            function.into(),
            bytes.into(),
            response.expose_provenance(),
            0,
        ];
        special(
            client,
            request,
            FunctionSpec::CUSTOM,
            words,
            Some(|inside, words, _| {
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
                let numbers = [response.bytes, response.more];
                let header = &mut inside.state.header;
                header.add_rule(words[0] as u8, words[1] as u16, kind, numbers)
            }),
        )
    }
}

/// Any request, as it arrived from another client: sends `function` and the bytes of
/// `body`, and reads into `reply` all bytes that follow the function code of the
/// response, as on the wire. This is what a gateway needs: `body` and `reply` are
/// what the functions of mbm_unit_serveCustom get and return.
///
/// A response counts only if it answers this request, as in the functions above: its
/// length, byte count, echoed address, value, quantity and records must be right. Of a
/// function that the standard does not define, and of sub-functions of 08 from 0x15 on,
/// silence ends the response on RTU. If you know its length, use mbm_client_custom.
///
/// 08 with sub-function 04 gets no response: it ends with MBM_OK and `length` 0 after
/// the turnaround delay.
///
/// @param client    the object
/// @param request   the request; if it is queued, its `data` then points into `body`
/// @param function  1 to 127
/// @param body      the bytes after the function code; leave them alone until the
///                  request has ended; may be NULL if there are none
/// @param bytes     0 to 252
/// @return a status; see mbm_client_readCoils. MBM_ILLEGAL_DATA_VALUE also for a body
///         whose length or counts are wrong, MBM_ILLEGAL_FUNCTION for function 0 or
///         one above 127: what a server answers to such a request
#[no_mangle]
pub unsafe extern "C" fn mbm_client_forward(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    body: *const u8,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands. The data are the last bytes of the body.
    unsafe {
        let inside = request.cast::<RequestFields>();
        let before = match inside.as_ref() {
            Some(inside) => inside.data,
            None => body,
        };
        let words = [function.into(), bytes.into(), body.expose_provenance(), 0];
        let status = special(
            client,
            request,
            FunctionSpec::CUSTOM,
            words,
            Some(|inside, words, _| {
                let body = core::ptr::with_exposed_provenance(words[2]);
                let header = &mut inside.state.header;
                let Some(whole) = lent_or_none(body, words[1]) else {
                    return Status::INVALID_ARGUMENT;
                };
                let built = header.forward(words[0] as u8, whole);
                if built == Status::OK {
                    let head = words[1] - usize::from(header.data_length());
                    inside.data = body.wrapping_add(head);
                }
                built
            }),
        );
        if status != Status::PENDING.code() && !inside.is_null() {
            (*inside).data = before;
        }
        status
    }
}

/// The group of file records that a request reads or writes.
///
/// # Safety
/// None is needed; this is a [`More`](super::More).
unsafe fn add_group(inside: &mut RequestFields, words: &[usize; 4], _: Status) -> Status {
    let [_, file, record, quantity] = *words;
    let header = &mut inside.state.header;
    header.add_group(file as u16, record as u16, quantity as u16)
}
