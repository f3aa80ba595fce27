//! Units and their services.

use super::records::{is_custom, is_of_another, mbm_diagnostics, mbm_service, Serve};
use core::ffi::c_void;
use core::mem::offset_of;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::error::Status;
use mbm::server::{
    dispatch, first_reply, only_writes, Addressing, Dispatch, Reply, RequestInfo, ANY,
};
use mbm::FIRMWARE;

/// Most records that one unit serves, each handed to a mbm_unit_serve function.
pub const MBM_MAX_SERVICES: u8 = 16;

/// A unit that servers answer for. Zero it, set `id`, and say what it serves with
/// mbm_unit_serveCoils and its sisters.
///
/// Each of those takes a record of yours, which stays valid for as long as the
/// unit is used. A unit has places for MBM_MAX_SERVICES records; one more is
/// refused with MBM_BUFFER_TOO_SMALL. A record may be handed over again, also
/// after you have zeroed and refilled it, and keeps its place. A zeroed record
/// serves nothing until it is handed over again. One record may serve any number
/// of units.
#[repr(C)]
pub struct mbm_unit {
    /// Private: the records, in the order in which they are asked, then NULL.
    pub services: [*mut mbm_service; MBM_MAX_SERVICES as usize],
    /// Private: NULL in a unit without diagnostics.
    pub monitor: Option<
        unsafe extern "C" fn(
            unit: *mut mbm_unit,
            info: *const c_void,
            addressing: u8,
            pdu: *mut u8,
        ) -> usize,
    >,
    /// Private.
    pub diagnostics: *mut mbm_diagnostics,
    /// The unit id, 1 to 247 (serial line guide V1.02, 2.2); 248 to 255, which the
    /// standard reserves, are taken as they are. 0 answers to every id. A unit that
    /// serves nothing is silent, as if it were not there.
    pub id: u8,
}

/// Puts a service into the first free place of a unit, unless it has one there
/// already. A record that is not zeroed keeps its function: another unit may have
/// it, with functions 16 and 17. One that is served as another kind, for it would answer
/// other functions on each unit that has it, is [`Status::BUSY`].
///
/// # Safety
/// Each pointer is NULL or points to what it says, and `service` is the head of
/// a record, zeroed or served by `serve`.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn add_as(
    unit: *mut mbm_unit,
    service: *mut mbm_service,
    kind: u8,
    serve: Serve,
) -> Status {
    if unit.is_null() || service.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, and the place is one of the unit's.
    unsafe {
        let known = (*service).kind;
        if known != 0 && known != kind {
            return Status::BUSY;
        }
        let mut place = (&raw mut (*unit).services).cast::<*mut mbm_service>();
        let end = place.add(MBM_MAX_SERVICES.into());
        while !(*place).is_null() && *place != service {
            place = place.add(1);
            if place == end {
                return Status::BUFFER_TOO_SMALL;
            }
        }
        *place = service;
        (*service).kind = kind;
        if (*service).serve.is_none() {
            (*service).serve = Some(serve);
        }
    }
    Status::OK
}

/// As [`add_as`], of a family with one kind of records.
///
/// # Safety
/// As for [`add_as`].
pub(super) unsafe fn add(unit: *mut mbm_unit, service: *mut mbm_service, serve: Serve) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { add_as(unit, service, 1, serve) }.code()
}

/// The places of a unit, one after the other, up to the first that is free. What
/// is called for one may fill others.
pub(super) struct Places {
    place: *const *mut mbm_service,
    end: *const *mut mbm_service,
}

impl Places {
    /// # Safety
    /// `unit` is one, and stays so while its places are looked at.
    #[inline(always)]
    pub(super) unsafe fn new(unit: *const mbm_unit) -> Places {
        // SAFETY: as the caller promises.
        unsafe {
            let place = (&raw const (*unit).services).cast::<*mut mbm_service>();
            let end = place.add(MBM_MAX_SERVICES.into());
            Places { place, end }
        }
    }
}

impl Iterator for Places {
    type Item = *mut mbm_service;

    #[inline(always)]
    fn next(&mut self) -> Option<*mut mbm_service> {
        if self.place == self.end {
            return None;
        }
        // SAFETY: not the end, so one of the places.
        unsafe {
            let service = *self.place;
            self.place = self.place.add(1);
            (!service.is_null()).then_some(service)
        }
    }
}

/// The PDU of a request with the room behind it, and its length.
///
/// # Safety
/// As for [`Serve`]; nothing else uses the PDU while the slice lives.
pub(super) unsafe fn request<'a>(pdu: *mut u8, info: *const c_void) -> (&'a mut [u8], usize) {
    // SAFETY: as the caller promises.
    unsafe {
        let info = info.cast::<RequestInfo>();
        let (space, length) = ((*info).space.into(), (*info).length.into());
        core::hint::assert_unchecked(length <= space);
        (from_raw_parts_mut(pdu, space), length)
    }
}

/// Has the services of a unit look at a request, one after the other.
///
/// # Safety
/// `unit` is one, and `pdu` has the bytes and the room that `info` says.
pub(super) unsafe fn walk(unit: *mut mbm_unit, info: *const c_void, pdu: *mut u8) -> usize {
    // SAFETY: as the caller promises; a PDU has a byte at least.
    unsafe {
        let replies = Places::new(unit).map(|service| ask(service, info, pdu));
        first_reply(replies.map(Reply::from_number)).code()
    }
}

/// As [`walk`], of a unit without diagnostics, which ends where all places are taken too:
/// behind the last of them stands the pointer to what diagnostics need, which is NULL.
///
/// # Safety
/// As for [`walk`]; the unit has no `monitor`.
#[inline(always)]
unsafe fn walk_alone(unit: *mut mbm_unit, info: *const c_void, pdu: *mut u8) -> usize {
    // SAFETY: as the caller promises; what is read stands in the unit, for the places end
    // with NULL. A hook that gives the unit diagnostics meanwhile is called by a service
    // that serves the request, which ends the walk.
    unsafe {
        let mut place = unit
            .byte_add(offset_of!(mbm_unit, services))
            .cast::<*mut mbm_service>();
        while !(*place).is_null() {
            let service = *place;
            let reply = ask(service, info, pdu);
            if reply != Reply::NOT_HANDLED.code() {
                return reply;
            }
            place = place.add(1);
            // Where one function of the user's stands, there are often more.
            if !FIRMWARE && is_custom(service) {
                place = pass(unit, place, *pdu);
            }
        }
    }
    Reply::ILLEGAL_FUNCTION.code()
}

/// The first place from this one on that has no function of the user's of another code.
/// A host calls none of these, and looks at four at a time.
///
/// # Safety
/// `place` is one of the unit's, or the end of them, behind which is NULL.
#[inline(never)]
unsafe fn pass(
    unit: *const mbm_unit,
    mut place: *mut *mut mbm_service,
    function: u8,
) -> *mut *mut mbm_service {
    // SAFETY: as the caller promises; where the fourth place from here on has a record, so
    // have those before it.
    unsafe {
        let is_passed = |place: *mut *mut mbm_service| is_of_another(*place, function);
        let last = unit
            .byte_add(offset_of!(mbm_unit, services))
            .cast::<*mut mbm_service>()
            .add(MBM_MAX_SERVICES as usize - 4);
        while place.cast_const() <= last
            && !(*place.add(3)).is_null()
            && (0..4).all(|index| is_passed(place.add(index)))
        {
            place = place.add(4);
        }
        while !(*place).is_null() && is_passed(place) {
            place = place.add(1);
        }
    }
    place
}

const _: () = {
    let end = offset_of!(mbm_unit, services) + MBM_MAX_SERVICES as usize * size_of::<usize>();
    assert!(offset_of!(mbm_unit, monitor) == end);
};

/// Has a service look at a request. A record that was zeroed has no function.
///
/// # Safety
/// As for [`Serve`].
#[inline(always)]
unsafe fn ask(service: *mut mbm_service, info: *const c_void, pdu: *mut u8) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        match (*service).serve {
            Some(serve) => serve(service, pdu, info),
            None => Reply::NOT_HANDLED.code(),
        }
    }
}

/// True if a unit serves something.
///
/// # Safety
/// `unit` is one.
#[inline(always)]
unsafe fn serves(unit: *const mbm_unit) -> bool {
    // SAFETY: as the caller promises.
    unsafe {
        let first = (&raw const (*unit).services).cast::<*mut mbm_service>();
        !(*first).is_null()
    }
}

/// Has each unit look at a frame; the first that it is for answers.
///
/// # Safety
/// `units` points to `count` units, and `pdu` has the bytes and the room that
/// `info` says.
#[inline(always)]
pub(super) unsafe fn serve(
    units: *mut mbm_unit,
    count: u8,
    info: *const RequestInfo,
    pdu: *mut u8,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        // One unit alone, which takes no notice of what is others', and is asked by
        // its id: soon done.
        if !FIRMWARE
            && count == 1
            && (*units).monitor.is_none()
            && (*info).length != 0
            && (*info).to == (*units).id
            && (*info).to != ANY
            && serves(units)
        {
            return walk_alone(units, info.cast(), pdu);
        }
        serve_each(units, count, info, pdu)
    }
}

/// [`serve`], whatever the units.
///
/// # Safety
/// As for [`serve`].
#[cfg_attr(target_arch = "avr", inline(always))]
#[cfg_attr(not(target_arch = "avr"), inline(never))]
unsafe fn serve_each(
    units: *mut mbm_unit,
    count: u8,
    info: *const RequestInfo,
    pdu: *mut u8,
) -> usize {
    // SAFETY: as the caller promises.
    let all = unsafe { (*info).addressing_of_all() };
    let mut frame = Frame {
        unit: units,
        left: count,
        info,
        pdu,
    };
    dispatch(&mut frame, all).code()
}

/// A frame that the units are asked about, and those that are not asked yet.
///
/// The pointers are as for [`serve`]; no reference lives while a unit is asked.
struct Frame {
    unit: *mut mbm_unit,
    left: u8,
    info: *const RequestInfo,
    pdu: *mut u8,
}

impl Dispatch for Frame {
    type Unit = *mut mbm_unit;

    #[inline(always)]
    fn next(&mut self, all: Addressing) -> Option<*mut mbm_unit> {
        // SAFETY: as for `serve`.
        unsafe {
            loop {
                if !FIRMWARE && all != Addressing::BROADCAST {
                    let passed = foreign(self.unit, self.left, self.info, all);
                    self.left -= passed;
                    self.unit = self.unit.add(passed.into());
                }
                if self.left == 0 {
                    return None;
                }
                let unit = self.unit;
                self.unit = unit.add(1);
                self.left -= 1;
                // A unit that serves nothing is as if it were not there.
                if serves(unit) {
                    return Some(unit);
                }
            }
        }
    }

    #[inline(always)]
    fn is_for(&self, unit: &*mut mbm_unit) -> bool {
        // SAFETY: as for `serve`.
        unsafe { (*self.info).is_for((**unit).id) }
    }

    #[inline(always)]
    fn offer(&mut self, unit: *mut mbm_unit, addressing: Addressing) -> Option<Reply> {
        // SAFETY: as for `serve`.
        let reply = unsafe {
            let (info, pdu) = (self.info.cast(), self.pdu);
            match (*unit).monitor {
                Some(monitor) => monitor(unit, info, addressing.code(), pdu),
                None if addressing == Addressing::FOREIGN => return None,
                None => walk_alone(unit, info, pdu),
            }
        };
        Some(Reply::from_number(reply))
    }
}

/// How many of these units, up to the first other, neither answer a frame nor take
/// notice of it, where it is no broadcast: a host calls none of them.
///
/// # Safety
/// `units` points to `count` units.
#[inline(always)]
unsafe fn foreign(
    units: *const mbm_unit,
    count: u8,
    info: *const RequestInfo,
    all: Addressing,
) -> u8 {
    // SAFETY: as the caller promises; no function of theirs runs meanwhile.
    let (info, units) = unsafe { (&*info, from_raw_parts(units, count.into())) };
    let takes_notice = |unit: &mbm_unit| unit.monitor.is_some();
    let answers = |unit: &mbm_unit| unit.id == info.to || unit.id == ANY;
    if all == Addressing::FOREIGN {
        before(units, takes_notice)
    } else if info.is_for_any() {
        0
    } else {
        before(units, |unit| answers(unit) || takes_notice(unit))
    }
}

/// How many units come before the first of which this is true; four at a time.
#[inline(always)]
fn before(units: &[mbm_unit], is_it: impl Fn(&mbm_unit) -> bool) -> u8 {
    let (fours, _) = units.as_chunks::<4>();
    let is_in = |four: &[mbm_unit; 4]| four.iter().any(&is_it);
    let passed = 4 * fours.iter().position(is_in).unwrap_or(fours.len());
    let mut rest = units.iter().skip(passed);
    (passed + rest.position(&is_it).unwrap_or(units.len() - passed)) as u8
}

/// True for a broadcast of a function that is not carried out then.
///
/// # Safety
/// As for [`Serve`].
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn is_unheard(info: *const c_void, function: u8) -> bool {
    // SAFETY: as the caller promises.
    unsafe { (*info.cast::<RequestInfo>()).is_broadcast() && !only_writes(function) }
}

/// As [`add`], and moves the service before all others of the unit.
///
/// # Safety
/// As for [`add`].
pub(super) unsafe fn add_first(unit: *mut mbm_unit, new: *mut mbm_service, serve: Serve) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        let status = add(unit, new, serve);
        if status == Status::OK.code() {
            let mut moved = new;
            let mut place = (&raw mut (*unit).services).cast::<*mut mbm_service>();
            // The one that stands in the place of `new` moves no further.
            loop {
                core::ptr::swap(place, &raw mut moved);
                if moved == new {
                    break;
                }
                place = place.add(1);
            }
        }
        status
    }
}
