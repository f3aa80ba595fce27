//! The responder: takes a request frame, writes a response frame.

use super::buffers::Core;
use super::mbm_unit;
use super::units;
use crate::framing::mbm_framing;
use crate::pointers::In;
use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::server::respond;
use mbm::server::{Indication, Reply, Units};

/// The units that C passed, how many, and the connection that the request came from.
struct RespondUnits(*mut mbm_unit, u8, *mut c_void);

impl Units for RespondUnits {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        // SAFETY: mbm_unit_respond requires `self.1` units. In place of a server, they get
        // storage in which only the fields that services use are set.
        let reply = unsafe {
            let mut server = MaybeUninit::<Core>::uninit();
            let server = server.as_mut_ptr();
            (&raw mut (*server).request).write(*info);
            (&raw mut (*server).port.context).write(self.2);
            let info = &raw const (*server).request;
            units::serve(self.0, self.1, info, pdu.as_mut_ptr())
        };
        Reply::from_number(reply)
    }
}

/// Answers one request without a server: reads a request frame from a buffer and writes
/// the response frame over it.
///
/// @param units       the units to serve: one unit, or an array of units
/// @param count       how many units
/// @param connection  your pointer, which hooks and functions of yours get as the connection
///                    that the request came from; may be NULL
/// @param framing     the framing. Its `functions` are not used: units know their own functions
/// @param frame       holds the complete request; receives the response
/// @param length      length of the request in bytes
/// @param capacity    size of `frame` in bytes. 256 hold every response in RTU, 513 in ASCII,
///                    260 in TCP. A longer response becomes exception 04
/// @param response    receives the length of the response in bytes; 0 without a response: after
///                    a damaged frame, a request for another unit, a broadcast, and with any
///                    status but MBM_OK
/// @return a status; MBM_PENDING if a function of yours returned MBM_REPLY_PENDING: write the
///         request into `frame` again before the next call; MBM_INVALID_ARGUMENT for a unit with
///         an id above 255
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_respond(
    units: *mut mbm_unit,
    count: u8,
    connection: *mut c_void,
    framing: In<mbm_framing>,
    frame: *mut u8,
    length: u16,
    capacity: u16,
    response: *mut u16,
) -> u8 {
    if !response.is_null() {
        // SAFETY: not NULL, so it points to a length.
        unsafe { response.write(0) }
    }
    let (framing, delimiter) = match framing.get() {
        Ok(fields) => (fields.of_frames(), fields.end()),
        Err(_) => return Status::INVALID_ARGUMENT.code(),
    };
    let framing = match framing {
        Ok(framing) if !units.is_null() && !frame.is_null() && !response.is_null() => framing,
        _ => return Status::INVALID_ARGUMENT.code(),
    };
    if length > capacity || !units::have_ids(units, count) {
        return Status::INVALID_ARGUMENT.code();
    }
    let buffer = from_raw_parts_mut(frame, capacity.into());
    let answer = respond(
        framing,
        delimiter,
        buffer,
        length.into(),
        &mut RespondUnits(units, count, connection),
    );
    match answer {
        Ok(length) => {
            response.write(length as u16);
            Status::OK.code()
        }
        Err(status) => status.code(),
    }
}
