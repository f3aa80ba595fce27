//! The requests of a client: a function for each one of the standard, and those for functions of
//! the user.

use super::object::{mbm_client, queue};
use super::request::{mbm_clientRequest, RequestFields, RequestPtr};
use crate::functions::{mbm_rule, MBM_RULE_COUNTED, MBM_RULE_FIXED, MBM_RULE_SILENCE};
use crate::pointers;
use core::slice::from_raw_parts;
use mbm::client::{ClientRequest as _, RequestState};
use mbm::error::Status;
use mbm::pdu::files::GROUP;
use mbm::pdu::functions::{coil_value, FunctionSpec, COUNTS, FIXED, OWN};
use mbm::pdu::MAX_PDU;

/// The arguments of a C function that makes a request: its function code, and the arguments
/// after `client` and `request`, which are the words at the start of the PDU.
#[derive(Clone, Copy)]
struct Arguments {
    function: FunctionSpec,
    words: [usize; 4],
}

impl Arguments {
    fn two_words(function: FunctionSpec, first: u16, second: u16) -> Arguments {
        let words = [first.into(), second.into(), 0, 0];
        Arguments { function, words }
    }
}

/// The further steps of a function after [`RequestState::set_all`]. It receives the status
/// of that function, and returns the status of the request.
type More = fn(&mut RequestFields, &[usize; 4], Status) -> Status;

/// Checks whether the request may be queued.
unsafe fn prepare(client: *const mbm_client, request: *mut mbm_clientRequest) -> Status {
    match pointers::check(client) {
        Status::OK if request.is_null() => Status::INVALID_ARGUMENT,
        Status::OK if (*request).status == Status::PENDING.code() => Status::BUSY,
        Status::OK => {
            // The C program may have zeroed a pending request, so search the queue.
            let object = pointers::object(client);
            match RequestPtr::new(request) {
                Some(request) if queue(object).holds(|queued| *queued == request) => Status::BUSY,
                _ => Status::OK,
            }
        }
        other => other,
    }
}

/// Builds a request and queues it; or returns the status that says why it is refused.
///
/// # Safety
/// [`prepare`] returned [`Status::OK`] for the request.
unsafe fn submit(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> Status {
    // Nothing else uses the request.
    let fields = &mut *request.cast::<RequestFields>();
    let state = &mut fields.state;
    let mut status = state.set_all(arguments.function, &arguments.words);
    if let Some(more) = more {
        status = more(fields, &arguments.words, status);
    }
    let state = &fields.state;
    if status != Status::OK {
    } else if state.data_length() > 0 && fields.data.is_null() {
        status = Status::INVALID_ARGUMENT;
    } else if !fields.reply.is_null() && u16::from(state.known_data()) > fields.state.capacity {
        status = Status::BUFFER_TOO_SMALL;
    } else if let Some(request) = RequestPtr::new(request) {
        return match queue(pointers::object(client)).enqueue(request) {
            Ok(()) => Status::PENDING,
            Err(refused) => refused.state().status,
        };
    }
    fields.state.status = status;
    fields.state.exception = 0;
    status
}

/// Queues a request. (The calling convention of C extends the status to a word, as the calling
/// function must return it: that saves 40 bytes on a Cortex-M0+.)
#[allow(improper_ctypes_definitions)] // C does not call it.
unsafe extern "C" fn queue_request(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> u8 {
    // `prepare` returned OK before `submit`.
    let status = match prepare(client, request) {
        Status::OK => submit(client, request, arguments, more),
        refused => refused,
    };
    status.code()
}

/// Queues a request that has at most two words.
unsafe extern "C" fn two_words(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    first: u16,
    second: u16,
    function: FunctionSpec,
) -> u8 {
    let arguments = Arguments::two_words(function, first, second);
    queue_request(client, request, &arguments, None)
}

/// Queues a read of a table of the data model, by the number of its function, 01 to 04.
pub(crate) unsafe fn read_table(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    address: u16,
    quantity: u16,
) -> u8 {
    let function = FunctionSpec::reads_table(function);
    two_words(client, request, address, quantity, function)
}

/// Queues a request that consists of its function code only.
unsafe extern "C" fn code_only(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: FunctionSpec,
) -> u8 {
    two_words(client, request, 0, 0, function)
}

/// Queues a request that needs up to four words, or further steps.
#[inline(always)]
unsafe fn with_more(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: FunctionSpec,
    words: [usize; 4],
    more: Option<More>,
) -> u8 {
    queue_request(client, request, &Arguments { function, words }, more)
}

/// Adds the registers that the request writes.
fn add_write(fields: &mut RequestFields, words: &[usize; 4], readable: Status) -> Status {
    let state = &mut fields.state;
    match state.add_write(words[2] as u16, words[3] as u16) {
        Status::OK => readable,
        refused => refused,
    }
}

functions! {
    (client: *mut mbm_client, request: *mut mbm_clientRequest)

    /// Function 01: reads coils into the bytes of `reply`, eight in each byte. The first coil is
    /// the lowest bit; the last byte is padded with zeros (V1.1b3, 6.1).
    ///
    /// This and the other functions that make a request queue the request and return. The
    /// request has ended when its `status` is no longer MBM_PENDING. Then `status` is MBM_OK, an
    /// exception of the device (0x01 to 0x7F), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
    /// MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST,
    /// MBM_LINE_BUSY, MBM_CONNECT_TIMED_OUT, MBM_BUFFER_TOO_SMALL or MBM_CANCELLED. `reply` changes
    /// only if it is MBM_OK.
    ///
    /// @param address   the first coil, 0 to 65535, as on the wire
    /// @param quantity  the number of coils, 1 to 2000
    /// @return MBM_PENDING if the request is queued. Otherwise nothing was queued, and the
    ///         request's `status` is the same: MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS
    ///         for a request that no device could accept, MBM_BROADCAST_NOT_ALLOWED,
    ///         MBM_QUEUE_FULL, MBM_DUPLICATE_TRANSACTION, MBM_BUFFER_TOO_SMALL if `reply` cannot
    ///         hold the data, MBM_INVALID_ARGUMENT if `data` is NULL. With the request unchanged:
    ///         MBM_BUSY also if the request is pending already
    fn mbm_client_readCoils(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_COILS);

    /// Function 02: reads discrete inputs into the bytes of `reply`, as mbm_client_readCoils
    /// does (V1.1b3, 6.2).
    ///
    /// @param address   the first input, 0 to 65535, as on the wire
    /// @param quantity  the number of inputs, 1 to 2000
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readDiscreteInputs(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_DISCRETE_INPUTS);

    /// Function 03: reads holding registers into the words of `reply` (V1.1b3, 6.3).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 125
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readHoldingRegisters(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_HOLDING_REGISTERS);

    /// Function 04: reads input registers into the words of `reply` (V1.1b3, 6.4).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 125
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readInputRegisters(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_INPUT_REGISTERS);

    /// Function 05: switches one coil on or off (V1.1b3, 6.5).
    ///
    /// @param address  the coil, 0 to 65535, as on the wire
    /// @param on       0 is off, any other value is on
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeSingleCoil(address: u16, on: u8)
        = two_words(address, coil_value(on != 0), FunctionSpec::WRITE_SINGLE_COIL);

    /// Function 06: writes one holding register (V1.1b3, 6.6).
    ///
    /// @param address  the register, 0 to 65535, as on the wire
    /// @param value    its new value
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeSingleRegister(address: u16, value: u16)
        = two_words(address, value, FunctionSpec::WRITE_SINGLE_REGISTER);

    /// Function 0F: writes coils from the bytes of `data`, eight in each byte. The first coil is
    /// the lowest bit (V1.1b3, 6.11).
    ///
    /// @param address   the first coil, 0 to 65535, as on the wire
    /// @param quantity  the number of coils, 1 to 1968
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeMultipleCoils(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::WRITE_MULTIPLE_COILS);

    /// Function 10: writes the words of `data` to holding registers (V1.1b3, 6.12).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 123
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeMultipleRegisters(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::WRITE_MULTIPLE_REGISTERS);

    /// Function 16: sets a holding register to (register & andMask) | (orMask & ~andMask)
    /// (V1.1b3, 6.16).
    ///
    /// @param address  the register, 0 to 65535, as on the wire
    /// @param andMask  1 for each bit of the register to keep
    /// @param orMask   the new value of the bits that are not kept
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_maskWriteRegister(address: u16, andMask: u16, orMask: u16)
        = with_more(
            FunctionSpec::MASK_WRITE_REGISTER, [address.into(), andMask.into(), orMask.into(), 0],
            None);

    /// Function 17: the device writes the words of `data` to holding registers first. Then it
    /// reads holding registers, which arrive in the words of `reply` (V1.1b3, 6.17).
    ///
    /// @param readAddress    the first register to read, 0 to 65535
    /// @param readQuantity   the number of registers to read, 1 to 125
    /// @param writeAddress   the first register to write, 0 to 65535
    /// @param writeQuantity  the number of registers to write, 1 to 121
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readWriteMultipleRegisters(
        readAddress: u16, readQuantity: u16, writeAddress: u16, writeQuantity: u16)
        = with_more(
            FunctionSpec::READ_WRITE_REGISTERS,
            [readAddress.into(), readQuantity.into(), writeAddress.into(), writeQuantity.into()],
            Some(add_write));

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

    /// Function 14 with several groups: reads records of several files, or of several ranges.
    /// `data` contains the groups as on the wire, seven bytes each, as mbm_packet_addRecord
    /// builds them. `reply` receives the sub-responses as on the wire: of each group its length
    /// after this byte, the reference type 6, and the words, the high byte first (V1.1b3, 6.14).
    ///
    /// @param bytes  the number of bytes of `data`, 7 to 245, a multiple of 7
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readFileRecords(bytes: u16)
        = with_more(
            FunctionSpec::READ_FILE_RECORDS, [bytes.into(), 0, 0, 0],
            Some(|fields, words, _| fields.state.read_file_records(words[0] as u16)));

    /// Function 15 with several groups: writes records of several files, or of several ranges.
    /// `data` contains the groups as on the wire, as mbm_packet_addRecord builds them (V1.1b3,
    /// 6.15).
    ///
    /// @param bytes  the number of bytes of `data`, 9 to 251
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeFileRecords(bytes: u16)
        = with_more(
            FunctionSpec::WRITE_FILE_RECORDS, [bytes.into(), 0, 0, 0],
            Some(|fields, words, _| fields.state.write_file_records(words[0] as u16)));

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
            Some(|_, words, _| RequestState::check_code(words[2] as u8)));

    /// Function 2B with any MEI type: sends the bytes of `data` after the MEI type, and reads the
    /// bytes after the MEI type of the response into `reply` (V1.1b3, 6.19). On RTU, silence ends
    /// the response.
    ///
    /// @param meiType  the MEI type, for example MBM_MEI_CANOPEN, 0 to 255
    /// @param bytes    the number of bytes of `data`, 0 to 251
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_encapsulatedInterfaceTransport(meiType: u8, bytes: u16)
        = with_more(
            FunctionSpec::ENCAPSULATED, [usize::from(meiType) << 8, bytes.into(), 0, 0],
            Some(|fields, words, _| fields.state.follow(words[1] as u16)));
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
            let state = &mut fields.state;
            state.add_rule(words[0] as u8, words[1] as u16, kind, numbers)
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
            let state = &mut fields.state;
            let bytes = match words[1] {
                0 => &[],
                _ if body.is_null() => return Status::INVALID_ARGUMENT,
                // SAFETY: `body` has `bytes` bytes.
                count => unsafe { from_raw_parts(body, count) },
            };
            let function = words[0] as u8;
            let status = if MAY_LACK_COUNT {
                state.forward_groups(function, bytes)
            } else {
                state.forward(function, bytes)
            };
            if status == Status::OK {
                let head = words[1] - usize::from(state.data_length());
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
    let [first, second] = RequestState::identification(code, object);
    [first.into(), second.into(), code.into(), 0]
}

/// Adds the words that the request sends.
fn add_words(fields: &mut RequestFields, words: &[usize; 4], _: Status) -> Status {
    let state = &mut fields.state;
    state.add_words(words[0] as u16, words[1] as u16)
}

/// Adds the group of file records that the request reads or writes.
fn add_group(fields: &mut RequestFields, words: &[usize; 4], _: Status) -> Status {
    let [_, file, record, quantity] = *words;
    let state = &mut fields.state;
    state.add_group(file as u16, record as u16, quantity as u16)
}
