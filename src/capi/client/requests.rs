//! One function for each request.

use super::request::Inside;
use super::{mbm_client, mbm_request, pointers, Lent};
use crate::capi::functions::{mbm_rule, rule};
use crate::error::Status;
use crate::pdu::outline::{Form, Outline};

/// The request behind a pointer, if it may be queued.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn prepare<'a>(
    client: *const mbm_client,
    request: *mut mbm_request,
) -> Result<&'a mut Inside, Status> {
    // SAFETY: as the caller promises; what is not pending is used by nobody.
    unsafe {
        match pointers::check(client) {
            Status::OK => {}
            refused => return Err(refused),
        }
        let request = request.cast::<Inside>().as_mut();
        let inside = request.ok_or(Status::INVALID_ARGUMENT)?;
        if inside.ticket.status == Status::PENDING {
            return Err(Status::BUSY);
        }
        Ok(inside)
    }
}

/// Queues a request that was built, unless that was refused.
///
/// # Safety
/// As the header demands; the request is [`prepare`]d.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn submit(client: *mut mbm_client, inside: &mut Inside, built: Status) -> Status {
    let ticket = &mut inside.ticket;
    let outline = &ticket.outline;
    let status = if built != Status::OK {
        built
    } else if outline.data_length() > 0 && inside.data.is_null() {
        Status::INVALID_ARGUMENT
    } else if !inside.reply.is_null() && u16::from(outline.known_data()) > ticket.capacity {
        Status::BUFFER_TOO_SMALL
    } else {
        let pointer = (&raw mut *inside).cast();
        // SAFETY: as the caller promises.
        return unsafe {
            match Lent::new(pointer) {
                Some(request) => {
                    let object = pointers::object(client);
                    (object.calls().queue)(object, request)
                }
                None => Status::INVALID_ARGUMENT,
            }
        };
    };
    ticket.status = status;
    status
}

/// Queues the request that `build` outlines.
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn queue(
    client: *mut mbm_client,
    request: *mut mbm_request,
    build: impl FnOnce(&mut Outline) -> Status,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        match prepare(client, request) {
            Ok(inside) => {
                let built = build(&mut inside.ticket.outline);
                submit(client, inside, built).code()
            }
            Err(refused) => refused.code(),
        }
    }
}

/// Queues a request of two words at most.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn plain(
    client: *mut mbm_client,
    request: *mut mbm_request,
    first: u16,
    second: u16,
    form: Form,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { queue(client, request, |outline| outline.set(form, first, second)) }
}

/// Function 01: reads coils into `reply`, eight to a byte, the lowest bit first, the
/// last byte padded with zeros (V1.1b3, 6.1).
///
/// This and the other functions behave alike: they queue a request and return. The
/// request has ended when its `status` is no longer MBM_PENDING: MBM_OK, an exception
/// of the device (0x01 to 0x7F), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
/// MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST,
/// MBM_LINE_BUSY, MBM_BUFFER_TOO_SMALL or MBM_CANCELLED. `reply` changes on MBM_OK only.
///
/// @param client   the object
/// @param request  the request
/// @param address  first coil, 0 to 65535, as on the wire
/// @param quantity  1 to 2000
/// @return MBM_PENDING: the request is queued; or, with nothing queued,
///         MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS for what no device
///         could accept, MBM_BROADCAST_NOT_ALLOWED, MBM_QUEUE_FULL,
///         MBM_DUPLICATE_TRANSACTION, MBM_BUFFER_TOO_SMALL if `reply` has no room
///         for the data, MBM_INVALID_ARGUMENT for `data` that are NULL,
///         MBM_NOT_INITIALISED; MBM_BUSY, with the request unchanged, if it is
///         pending already
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readCoils(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, quantity, Form::READ_COILS) }
}

/// Function 01: reads one coil into the lowest bit of a byte (V1.1b3, 6.1).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readSingleCoil(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, 1, Form::READ_COILS) }
}

/// Function 02: reads discrete inputs, as mbm_client_readCoils (V1.1b3, 6.2).
///
/// @param client   the object
/// @param request  the request
/// @param address  first input, 0 to 65535, as on the wire
/// @param quantity  1 to 2000
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readDiscreteInputs(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            Form::READ_DISCRETE_INPUTS,
        )
    }
}

/// Function 02: reads one discrete input into the lowest bit of a byte (V1.1b3, 6.2).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readSingleDiscreteInput(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, 1, Form::READ_DISCRETE_INPUTS) }
}

/// Function 03: reads holding registers into the words of `reply` (V1.1b3, 6.3).
///
/// @param client   the object
/// @param request  the request
/// @param address  first register, 0 to 65535, as on the wire
/// @param quantity  1 to 125
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readHoldingRegisters(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            Form::READ_HOLDING_REGISTERS,
        )
    }
}

/// Function 03: reads one holding register into a word (V1.1b3, 6.3).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readSingleHoldingRegister(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, 1, Form::READ_HOLDING_REGISTERS) }
}

/// Function 04: reads input registers into the words of `reply` (V1.1b3, 6.4).
///
/// @param client   the object
/// @param request  the request
/// @param address  first register, 0 to 65535, as on the wire
/// @param quantity  1 to 125
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readInputRegisters(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            Form::READ_INPUT_REGISTERS,
        )
    }
}

/// Function 04: reads one input register into a word (V1.1b3, 6.4).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readSingleInputRegister(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, 1, Form::READ_INPUT_REGISTERS) }
}

/// Function 05: switches a coil (V1.1b3, 6.5).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @param on  0 is off, anything else is on
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeSingleCoil(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    on: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            if on == 0 { 0 } else { 0xFF00 },
            Form::WRITE_SINGLE_COIL,
        )
    }
}

/// Function 06: writes a holding register (V1.1b3, 6.6).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @param value  the value
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeSingleRegister(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    value: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, value, Form::WRITE_SINGLE_REGISTER) }
}

/// Function 07: reads eight outputs into a byte (V1.1b3, 6.7).
///
/// @param client   the object
/// @param request  the request
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readExceptionStatus(
    client: *mut mbm_client,
    request: *mut mbm_request,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, 0, 0, Form::READ_EXCEPTION_STATUS) }
}

/// Function 08: sends the words of `data`, and reads as many into `reply` (V1.1b3,
/// 6.8). Nobody responds to sub-function 04, Force Listen Only Mode.
///
/// @param client   the object
/// @param request  the request
/// @param subFunction  0 (Return Query Data) to 0x14
/// @param words  1; 1 to 125 for sub-function 0
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_diagnostics(
    client: *mut mbm_client,
    request: *mut mbm_request,
    subFunction: u16,
    words: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.diagnostics(subFunction, words)
        })
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
    request: *mut mbm_request,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, 0, 0, Form::GET_COMM_EVENT_COUNTER) }
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
    request: *mut mbm_request,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, 0, 0, Form::GET_COMM_EVENT_LOG) }
}

/// Function 0F: writes the coils of `data`, eight to a byte, the lowest bit first
/// (V1.1b3, 6.11).
///
/// @param client   the object
/// @param request  the request
/// @param address  first coil, 0 to 65535, as on the wire
/// @param quantity  1 to 1968
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeMultipleCoils(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            Form::WRITE_MULTIPLE_COILS,
        )
    }
}

/// Function 10: writes the words of `data` (V1.1b3, 6.12).
///
/// @param client   the object
/// @param request  the request
/// @param address  first register, 0 to 65535, as on the wire
/// @param quantity  1 to 123
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeMultipleRegisters(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            Form::WRITE_MULTIPLE_REGISTERS,
        )
    }
}

/// Function 11: reads what the device says of itself, as it likes (V1.1b3, 6.13).
///
/// @param client   the object
/// @param request  the request
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_reportServerId(
    client: *mut mbm_client,
    request: *mut mbm_request,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, 0, 0, Form::REPORT_SERVER_ID) }
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
    request: *mut mbm_request,
    file: u16,
    record: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.read_file_record(file, record, quantity)
        })
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
    request: *mut mbm_request,
    file: u16,
    record: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.write_file_record(file, record, quantity)
        })
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
    request: *mut mbm_request,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { queue(client, request, |outline| outline.read_file_records(bytes)) }
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
    request: *mut mbm_request,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { queue(client, request, |outline| outline.write_file_records(bytes)) }
}

/// Function 16: sets a holding register to (register & andMask) | (orMask & ~andMask)
/// (V1.1b3, 6.16).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @param andMask  bits to keep
/// @param orMask  bits to set where none are kept
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_maskWriteRegister(
    client: *mut mbm_client,
    request: *mut mbm_request,
    address: u16,
    andMask: u16,
    orMask: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.mask_write_register(address, andMask, orMask)
        })
    }
}

/// Function 17: writes the words of `data`, then reads into the words of `reply`
/// (V1.1b3, 6.17).
///
/// @param client   the object
/// @param request  the request
/// @param readAddress  first register to read
/// @param readQuantity  1 to 125
/// @param writeAddress  first register to write
/// @param writeQuantity  1 to 121
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readWriteMultipleRegisters(
    client: *mut mbm_client,
    request: *mut mbm_request,
    readAddress: u16,
    readQuantity: u16,
    writeAddress: u16,
    writeQuantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.read_write_registers(readAddress, readQuantity, writeAddress, writeQuantity)
        })
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
    request: *mut mbm_request,
    address: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, 0, Form::READ_FIFO_QUEUE) }
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
    request: *mut mbm_request,
    code: u8,
    object: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.read_device_identification(code, object)
        })
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
    request: *mut mbm_request,
    meiType: u8,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        queue(client, request, |outline| {
            outline.encapsulated(meiType, bytes)
        })
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
    request: *mut mbm_request,
    function: u8,
    bytes: u16,
    response: *const mbm_rule,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let rule = response.as_ref().and_then(|response| rule(*response));
        queue(client, request, |outline| match rule {
            Some(rule) => outline.custom(function, bytes, rule),
            None => Status::INVALID_ARGUMENT,
        })
    }
}
