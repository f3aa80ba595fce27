//! The counters of a unit's line, its listen only mode and its event log.

use super::units::{add, call_services, is_ignored_broadcast, request};
use super::{mbm_diagnostics, mbm_service, mbm_unit};
use core::ffi::c_void;
use mbm::error::Status;
use mbm::server::diagnostics::{Diagnostics, Restart};
use mbm::server::{Addressing, Indication, Reply};

/// The fields of a record that the core uses.
unsafe fn core_fields<'a>(record: *mut mbm_diagnostics) -> &'a mut Diagnostics {
    // `records.rs` asserts that the fields have the layout of the core's struct.
    &mut *(&raw mut (*record).diagnosticRegister).cast()
}

/// Serves functions 08, 0B and 0C (hex).
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    // No reference lives while the hook runs.
    let record = service.cast::<mbm_diagnostics>();
    let (pdu, length) = request(pdu, info);
    let (reply, restart) = core_fields(record).serve(pdu, length);
    if let (true, Some(hook)) = (restart != Restart::None, (*record).restart) {
        hook((*record).context, (restart == Restart::ClearLog).into());
    }
    reply.code()
}

/// Counts a frame, lets the unit serve it if it is for this unit, and counts the result.
unsafe extern "C" fn monitor(
    unit: *mut mbm_unit,
    info: *const c_void,
    addressing: u8,
    pdu: *mut u8,
) -> usize {
    // No reference to the record lives while services run.
    let record = (*unit).diagnostics;
    let addressing = match addressing {
        1 => Addressing::OWN,
        2 if !is_ignored_broadcast(info, *pdu) => Addressing::BROADCAST,
        _ => Addressing::FOREIGN,
    };
    let (bytes, length) = request(pdu, info);
    let function = bytes.first().copied().unwrap_or(0);
    let info = info.cast::<Indication>();
    let request = bytes.get(..length).unwrap_or_default();
    if !core_fields(record).count_frame(&*info, addressing, request) {
        return Reply::NO_RESPONSE.code();
    }
    let reply = call_services(unit, info.cast(), pdu);
    if reply != Reply::PENDING.code() {
        core_fields(record).count_outcome(addressing, function, Reply::from_number(reply));
    }
    reply
}

/// Serves diagnostics: functions 08, 0B and 0C (hex). Function 08 has the sub-functions
/// of the standard, 00 to 04, 0A to 12 and 14 (hex); it answers others with exception 01
/// (illegal function). After this call the unit counts the frames on its lines and logs
/// events, and a client can force it into listen only mode.
///
/// @param diagnostics  must stay valid for as long as the unit is used. Use one struct for each
///                     unit: a shared one counts for all units that share it
/// @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveDiagnostics(
    unit: *mut mbm_unit,
    diagnostics: *mut mbm_diagnostics,
) -> u8 {
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
