//! Counters of a line, listen only mode and event log.

use super::units::{add, is_unheard, request, walk};
use super::{mbm_diagnostics, mbm_service, mbm_unit};
use core::ffi::c_void;
use mbm::error::Status;
use mbm::server::diagnostics::{Diagnostics, Restart};
use mbm::server::{Addressing, Reply, RequestInfo};

/// What the core keeps in a record.
///
/// # Safety
/// `record` is one, and nothing else uses it while the reference lives.
unsafe fn line<'a>(record: *mut mbm_diagnostics) -> &'a mut Diagnostics {
    // SAFETY: as the caller promises; the fields are those of the core, as is
    // asserted above.
    unsafe { &mut *(&raw mut (*record).diagnosticRegister).cast() }
}

/// Serves 08, 0B and 0C.
///
/// # Safety
/// `service` is the head of a record; `pdu` has the bytes and room of `info`.
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    // SAFETY: as the caller promises; no reference lives while the hook runs.
    unsafe {
        let record = service.cast::<mbm_diagnostics>();
        let (pdu, length) = request(pdu, info);
        let (reply, restart) = line(record).serve(pdu, length);
        if let (true, Some(hook)) = (restart != Restart::None, (*record).restart) {
            hook((*record).context, (restart == Restart::ClearLog).into());
        }
        reply.code()
    }
}

/// Takes notice of a frame, has it served, and of what became of it.
///
/// # Safety
/// `unit` is one with a record; `pdu` has the bytes and room of `info`.
unsafe extern "C" fn monitor(
    unit: *mut mbm_unit,
    info: *const c_void,
    addressing: u8,
    pdu: *mut u8,
) -> usize {
    // SAFETY: as the caller promises; no reference to the record lives while
    // services are at work.
    unsafe {
        let record = (*unit).diagnostics;
        let addressing = match addressing {
            1 => Addressing::OWN,
            2 if !is_unheard(info, *pdu) => Addressing::BROADCAST,
            _ => Addressing::FOREIGN,
        };
        let (bytes, length) = request(pdu, info);
        let function = bytes.first().copied().unwrap_or(0);
        let info = info.cast::<RequestInfo>();
        let request = bytes.get(..length).unwrap_or_default();
        if !line(record).count_frame(&*info, addressing, request) {
            return Reply::NO_RESPONSE.code();
        }
        let reply = walk(unit, info.cast(), pdu);
        if reply != Reply::PENDING.code() {
            line(record).count_outcome(addressing, function, Reply::from_number(reply));
        }
        reply
    }
}

/// Serves diagnostics: functions 08, 0B and 0C. Of 08 it serves the sub-functions that
/// the standard defines, 00 to 04, 0A to 12 and 14; others are exception 01. From now
/// on the unit counts what its lines bring, logs events, and can be forced into
/// listen only mode.
///
/// @param unit         the unit
/// @param diagnostics  yours, for as long as the unit is used; one for each unit, or
///                     it counts for all that share it
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUSY if the unit has
///         another record of diagnostics; MBM_BUFFER_TOO_SMALL if it has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveDiagnostics(
    unit: *mut mbm_unit,
    diagnostics: *mut mbm_diagnostics,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if !unit.is_null() {
            let has = (*unit).diagnostics;
            if !has.is_null() && has != diagnostics {
                return Status::BUSY.code();
            }
        }
        let status = add(unit, diagnostics.cast(), serve);
        if status == Status::OK.code() {
            (*unit).diagnostics = diagnostics;
            (*unit).monitor = Some(monitor);
        }
        status
    }
}
