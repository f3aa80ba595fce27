//! The responder: a frame in, a frame out.

use super::mbm_unit;
use super::units;
use crate::framing::mbm_framing;
use crate::pointers::get;
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::server::respond::respond;
use mbm::server::{Reply, RequestInfo, Units};

/// Units of C.
struct RespondUnits(*mut mbm_unit, u8);

impl Units for RespondUnits {
    fn serve(&mut self, info: &RequestInfo, pdu: &mut [u8]) -> Reply {
        // SAFETY: mbm_unit_respond demands so many units.
        let reply = unsafe { units::serve(self.0, self.1, info, pdu.as_mut_ptr()) };
        Reply::from_number(reply)
    }
}

/// Answers one request, without a server: takes a frame from a buffer and writes
/// the response frame over it.
///
/// @param units      what is served: one unit, or an array of them
/// @param count      how many units
/// @param framing    how frames look; of it, `functions` are not used, for the units
///                   know theirs
/// @param frame      the whole request, and room for the response
/// @param length     bytes of the request
/// @param capacity   bytes of the buffer: 256 hold any response in RTU, 513 in
///                   ASCII, 260 over TCP; a longer response becomes exception 04
/// @param response   receives the bytes of the response; 0 where there is none: for a
///                   damaged frame, another unit, a broadcast, and with any status
///                   but MBM_OK
/// @return MBM_OK; MBM_PENDING, with the buffer to be filled anew, if a function
///         of yours is not done; MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_respond(
    units: *mut mbm_unit,
    count: u8,
    framing: *const mbm_framing,
    frame: *mut u8,
    length: u16,
    capacity: u16,
    response: *mut u16,
) -> u8 {
    if !response.is_null() {
        // SAFETY: not NULL, so room for a length.
        unsafe { response.write(0) }
    }
    // SAFETY: as the header demands.
    let (framing, delimiter) = match unsafe { get(framing) } {
        Some(told) => (told.of_frames(), told.end()),
        None => return Status::INVALID_ARGUMENT.code(),
    };
    let framing = match framing {
        Ok(framing) if !units.is_null() && !frame.is_null() && !response.is_null() => framing,
        _ => return Status::INVALID_ARGUMENT.code(),
    };
    if length > capacity {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL; the rest as the header demands.
    unsafe {
        let buffer = from_raw_parts_mut(frame, capacity.into());
        let answer = respond(
            framing,
            delimiter,
            buffer,
            length.into(),
            &mut RespondUnits(units, count),
        );
        match answer {
            Ok(length) => {
                response.write(length as u16);
                Status::OK.code()
            }
            Err(status) => status.code(),
        }
    }
}
