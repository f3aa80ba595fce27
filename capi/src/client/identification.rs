//! A device identification, read to its end: a request that a client repeats until it has all
//! objects.

use super::object::mbm_client;
use super::request::mbm_clientRequest;
use super::requests::mbm_client_readDeviceIdentification;
use crate::packet::mbm_object;
use core::ffi::c_void;
use core::ptr::null_mut;
use core::slice::from_raw_parts;
use mbm::error::{Error, Status};
use mbm::packet::groups;
use mbm::pdu::identification::IdentificationReply;
use mbm::pdu::identification_stream::{Next, ObjectStream};

/// Reads the objects that identify a device (function 2B/0E, V1.1b3, 6.21), with as many
/// requests as the device needs. You own the storage. Initialise it with MBM_INIT, set `unit`,
/// `reply` and `replyBytes` of `request`, and `object`, and pass it to
/// mbm_identification_read. You may use it for any number of devices.
///
/// From that call until `request.status` is no longer MBM_PENDING, do not change it or the
/// memory that it points to. To give it up, pass `request` to mbm_client_cancel.
#[repr(C)]
pub struct mbm_identification {
    /// The request for one part of the objects. Set its `unit`. Its `reply` receives one
    /// reply after the other, as mbm_client_readDeviceIdentification says: 250 bytes hold
    /// any, `replyBytes` is their number. On a TCP client you may set `transaction`.
    /// mbm_identification_read sets `done`, `context` and `data`.
    ///
    /// Its `status` is that of the identification: MBM_PENDING while objects are missing;
    /// MBM_OK when `object` was called for all; MBM_NO_PROGRESS if the device repeats itself;
    /// MBM_MALFORMED_REPLY also for a reply whose objects are not whole, and for one with
    /// another object than the one that was requested alone; otherwise as for
    /// mbm_client_readCoils. Objects that were handed out before a failure are sound.
    pub request: mbm_clientRequest,
    /// Optional: mbm_client_poll calls it for each object. `object` and its data are valid
    /// during the call. It may call what `done` of a request may call: it may queue
    /// requests, and cancel, also this one, which ends the calls.
    pub object: Option<unsafe extern "C" fn(context: *mut c_void, object: *const mbm_object)>,
    /// Optional: mbm_client_poll calls it when the identification has ended, as it calls
    /// `done` of a request. It may read the next identification with the same storage.
    pub done:
        Option<unsafe extern "C" fn(context: *mut c_void, identification: *mut mbm_identification)>,
    /// Your pointer, passed to both; may be NULL.
    pub context: *mut c_void,
    /// Private.
    client: *mut mbm_client,
    /// How many objects `object` was called for, or would have been.
    pub count: u16,
    /// The conformity level in the last reply, by the standard 01 to 03 or 81 to 83 (hex). It
    /// is not checked: some devices send a wrong one, and reading does not depend on it.
    pub conformity: u8,
    /// Private.
    handingOut: u8,
    /// Private.
    stream: [u16; 2],
}

const _: () = {
    assert!(size_of::<ObjectStream>() <= 4);
    assert!(align_of::<ObjectStream>() <= align_of::<u16>());
};

/// Where the objects begin in the data of a reply: after conformity, more follows, the next
/// object and the count.
const OBJECTS: usize = 4;

/// Begins to read the objects of a device.
///
/// `done` of a request, and `object` and `done` of another identification, may call it.
///
/// @param identification  the storage, with unit, reply buffer and callbacks set
/// @param client          the client that sends the requests; it must stay valid until the
///                        identification has ended
/// @param code            MBM_DEVICE_ID_BASIC, MBM_DEVICE_ID_REGULAR or MBM_DEVICE_ID_EXTENDED:
///                        all objects of the category; a device that has fewer sends those that
///                        it has. MBM_DEVICE_ID_INDIVIDUAL: one
/// @param object          the id of the first object, 0 for all, or of the only one. A device
///                        that does not have the first object begins with its first one
/// @return MBM_PENDING if the first request is queued. Otherwise nothing has changed: MBM_BUSY
///         if the identification is pending, and from within its `object`;
///         MBM_ILLEGAL_DATA_VALUE for another `code`; MBM_INVALID_ARGUMENT if `request.reply` is
///         NULL; or another status of mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_identification_read(
    identification: *mut mbm_identification,
    client: *mut mbm_client,
    code: u8,
    object: u8,
) -> u8 {
    if identification.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // The request is not pending, so only this call uses it. While `object` runs, its call is
    // refused.
    let request = &raw mut (*identification).request;
    if (*request).status == Status::PENDING.code() || (*identification).handingOut != 0 {
        return Status::BUSY.code();
    }
    if (*request).reply.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    let before = request.read();
    (*request).done = Some(replied);
    (*request).context = identification.cast();
    (*request).data = null_mut();
    let status = mbm_client_readDeviceIdentification(client, request, code, object);
    if status != Status::PENDING.code() {
        request.write(before);
        return status;
    }
    (*identification).client = client;
    (*identification).count = 0;
    (*identification).conformity = 0;
    stream(identification).write(ObjectStream::new(code, object));
    status
}

/// The state of the stream.
///
/// # Safety
/// `identification` points to an identification.
unsafe fn stream(identification: *mut mbm_identification) -> *mut ObjectStream {
    // The storage is large enough.
    (&raw mut (*identification).stream).cast()
}

/// Parses the reply and takes it into the stream.
///
/// # Safety
/// `identification` points to an identification whose request has a reply of `length` bytes.
unsafe fn accept(identification: *mut mbm_identification, length: u8) -> Result<Next, Error> {
    // Nothing else uses the reply during this call.
    let bytes = from_raw_parts((*identification).request.reply.cast(), length.into());
    let mut state = stream(identification).read();
    let reply = IdentificationReply::parse(state.code(), bytes)?;
    let next = state.take(&reply)?;
    stream(identification).write(state);
    (*identification).conformity = reply.conformity;
    Ok(next)
}

/// Calls `object` for each object of a reply of `length` bytes, until the request has another
/// status than `status`.
///
/// # Safety
/// No reference to the identification lives.
unsafe fn hand_out(identification: *mut mbm_identification, length: u8, status: u8) {
    // No reference to the reply lives during a call of `object`, which may overwrite it: each
    // object is read anew.
    let reply: *const u8 = (*identification).request.reply.cast();
    let mut at = OBJECTS;
    while (*identification).request.status == status {
        let bytes = from_raw_parts(reply, length.into());
        let Some((id, value, size)) = bytes.get(at..).and_then(groups::object) else {
            return;
        };
        let found = mbm_object {
            data: value.as_ptr(),
            length: value.len() as u8,
            id,
        };
        at += size;
        (*identification).count = (*identification).count.wrapping_add(1);
        if let Some(object) = (*identification).object {
            (*identification).handingOut = 1;
            object((*identification).context, &raw const found);
            (*identification).handingOut = 0;
        }
    }
}

/// `done` of the request: hands out the objects of a reply and requests the next ones.
///
/// # Safety
/// mbm_identification_read passed `context` and queued the request. The client calls it.
unsafe extern "C" fn replied(context: *mut c_void, request: *mut mbm_clientRequest) {
    let identification = context.cast::<mbm_identification>();
    // SAFETY: the identification stays valid while it is pending, and its reply is not NULL.
    // No reference to it lives while a callback runs.
    unsafe {
        if (*request).status == Status::OK.code() {
            let length = (*request).length;
            let accepted = accept(identification, length);
            let status = match accepted {
                // Queued first: `object` may fill the client's queue.
                Ok(Next::Request(next)) => {
                    let code = (*stream(identification)).code();
                    let client = (*identification).client;
                    mbm_client_readDeviceIdentification(client, request, code, next)
                }
                Ok(Next::Stuck) => Status::NO_PROGRESS.code(),
                Ok(Next::End) => Status::OK.code(),
                Err(status) => status.code(),
            };
            (*request).status = status;
            if accepted.is_ok() {
                hand_out(identification, length, status);
            }
            if status == Status::PENDING.code() {
                return;
            }
        }
        if let Some(done) = (*identification).done {
            done((*identification).context, identification);
        }
    }
}
