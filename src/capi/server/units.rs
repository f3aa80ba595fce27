//! Units and their services.

use super::{custom, mbm_diagnostics};
use crate::error::Status;
use crate::pdu::custom::Rule;
use crate::server::{only_writes, Concern, Heading, Reply};
use crate::FIRMWARE;
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;

/// What the functions named mbm_server_serve... hang onto a unit: one family of
/// functions. The head of each record that they take; not for you.
#[repr(C)]
pub struct mbm_service {
    /// The service behind it.
    pub next: *mut mbm_service,
    /// Serves a request, if it is one of this family.
    pub serve: Option<
        unsafe extern "C" fn(
            service: *mut mbm_service,
            pdu: *mut u8,
            heading: *const c_void,
        ) -> u16,
    >,
}

/// The function of a service. `pdu` points to the PDU of a request that `heading`
/// tells of, and returns a [`Reply`].
pub(super) type Serve =
    unsafe extern "C" fn(service: *mut mbm_service, pdu: *mut u8, heading: *const c_void) -> u16;

/// A unit that servers answer for. Zero it, set `id`, and say what it serves with
/// mbm_server_serveCoils and its sisters.
#[repr(C)]
pub struct mbm_unit {
    /// Not for you.
    pub services: *mut mbm_service,
    /// Not for you.
    pub serve: Option<
        unsafe extern "C" fn(
            unit: *mut mbm_unit,
            heading: *const c_void,
            concern: u8,
            pdu: *mut u8,
        ) -> u16,
    >,
    /// Not for you.
    pub diagnostics: *mut mbm_diagnostics,
    /// The unit id, 1 to 247 (serial line guide V1.02, 2.2); 248 to 255, which the
    /// standard reserves, are taken as they are. 0 answers to every id. A unit that
    /// serves nothing is silent, as if it were not there.
    pub id: u8,
}

/// Hangs a service behind those that a unit has; once, however often it is asked.
///
/// # Safety
/// Each pointer is NULL or points to what it says, and `service` is the head of
/// a record that `serve` serves.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn add(unit: *mut mbm_unit, service: *mut mbm_service, serve: Serve) -> u8 {
    if unit.is_null() || service.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL; services hang together as this function hung them.
    unsafe {
        let mut place = &raw mut (*unit).services;
        while *place != service {
            if (*place).is_null() {
                *place = service;
                (*service).next = core::ptr::null_mut();
                (*service).serve = Some(serve);
            } else {
                place = &raw mut (**place).next;
            }
        }
    }
    Status::OK.code()
}

/// The PDU of a request with the room behind it, and its length.
///
/// # Safety
/// As for [`Serve`]; nothing else uses the PDU while the slice lives.
pub(super) unsafe fn request<'a>(pdu: *mut u8, heading: *const c_void) -> (&'a mut [u8], usize) {
    // SAFETY: as the caller promises.
    unsafe {
        let heading = heading.cast::<Heading>();
        let room = usize::from((*heading).room);
        (from_raw_parts_mut(pdu, room), (*heading).length.into())
    }
}

/// Has the services of a unit look at a request, one after the other.
///
/// # Safety
/// `unit` is one, and `pdu` has the bytes and the room that `heading` says.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
pub(super) unsafe fn walk(unit: *mut mbm_unit, pdu: *mut u8, heading: *const Heading) -> u16 {
    // SAFETY: as the caller promises.
    unsafe {
        let mut service = (*unit).services;
        while !service.is_null() {
            // A service that hangs there has its function.
            let serve = (*service).serve.unwrap_unchecked();
            let reply = serve(service, pdu, heading.cast());
            if reply != Reply::NOT_MINE.code() {
                return reply;
            }
            service = (*service).next;
        }
    }
    Reply::ILLEGAL_FUNCTION.code()
}

/// Has each unit look at a frame; the first that it is for answers.
///
/// # Safety
/// `units` points to `count` units, and `pdu` has the bytes and the room that
/// `heading` says.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
pub(super) unsafe fn serve(
    units: *mut mbm_unit,
    count: u8,
    heading: *const Heading,
    pdu: *mut u8,
) -> u16 {
    // SAFETY: as the caller promises.
    unsafe {
        // One unit alone, which takes no notice of what is others', and is asked by
        // its id: soon done.
        if !FIRMWARE
            && count == 1
            && (*units).serve.is_none()
            && (*heading).length != 0
            && (*heading).to == (*units).id
            && (*heading).to != 0
            && !(*units).services.is_null()
        {
            return walk(units, pdu, heading);
        }
        serve_each(units, count, heading, pdu)
    }
}

/// [`serve`], whatever the units.
///
/// # Safety
/// As for [`serve`].
#[cfg_attr(not(target_os = "none"), inline(never))]
unsafe fn serve_each(
    units: *mut mbm_unit,
    count: u8,
    heading: *const Heading,
    pdu: *mut u8,
) -> u16 {
    let mut answer = Reply::SILENT.code();
    // SAFETY: as the caller promises.
    unsafe {
        let mut unit = units;
        let end = units.add(count.into());
        let mut all = (*heading).concern_of_all();
        while unit != end {
            let mut concern = all;
            if concern == Concern::Own && !(*heading).is_for((*unit).id) {
                concern = Concern::Foreign;
            }
            // Only who takes notice of all frames has a function for that, and a
            // unit without any service is none.
            let mut reply = Reply::SILENT.code();
            if let Some(monitor) = (*unit).serve {
                reply = monitor(unit, heading.cast(), concern as u8, pdu);
            } else if (*unit).services.is_null() {
                concern = Concern::Foreign;
            } else if concern != Concern::Foreign {
                reply = walk(unit, pdu, heading);
            }
            if concern == Concern::Own {
                answer = reply;
                all = Concern::Foreign;
            }
            unit = unit.add(1);
        }
    }
    answer
}

/// True for a broadcast of a function that is not carried out then.
///
/// # Safety
/// As for [`Serve`].
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn is_unheard(heading: *const c_void, function: u8) -> bool {
    // SAFETY: as the caller promises.
    unsafe { (*heading.cast::<Heading>()).is_broadcast() && !only_writes(function) }
}

/// Hangs a service before all that a unit has.
///
/// # Safety
/// As for [`add`].
pub(super) unsafe fn add_first(unit: *mut mbm_unit, service: *mut mbm_service, serve: Serve) -> u8 {
    // SAFETY: as the caller promises. Its place among the others is left first.
    unsafe {
        let status = add(unit, service, serve);
        if status == Status::OK.code() {
            let mut place = &raw mut (*unit).services;
            while *place != service {
                place = &raw mut (**place).next;
            }
            *place = (*service).next;
            (*service).next = (*unit).services;
            (*unit).services = service;
        }
        status
    }
}

/// The length rule that a unit has for a user's function.
///
/// # Safety
/// `units` points to `count` units.
pub(super) unsafe fn rule(units: *const mbm_unit, count: u8, function: u8) -> Option<Rule> {
    // SAFETY: as the caller promises.
    unsafe {
        for index in 0..count {
            let mut service = (*units.add(index.into())).services.cast_const();
            while !service.is_null() {
                if let Some(rule) = custom::rule(service, function) {
                    return Some(rule);
                }
                service = (*service).next;
            }
        }
    }
    None
}
