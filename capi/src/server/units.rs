//! Units and their services.

use super::records::{mbm_diagnostics, mbm_service, Serve};
use core::ffi::c_void;
use core::mem::offset_of;
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::server::{dispatch, only_writes, Addressing, Dispatch, Indication, Refusal, Reply};

/// The most records that one unit can serve. Each is one struct that you pass to a
/// mbm_unit_serve function.
pub const MBM_MAX_SERVICES: u8 = 16;

/// A unit that servers answer for. Initialise it with MBM_INIT, set `id`, and call an
/// mbm_unit_serve function, for example mbm_unit_serveCoils, for everything that it serves.
///
/// Each mbm_unit_serve function takes a record: a struct of yours, which must stay valid
/// for as long as the unit is used. A unit has places for MBM_MAX_SERVICES records; one
/// more returns MBM_BUFFER_TOO_SMALL. You may pass a record again, also after you have
/// zeroed and refilled it; it keeps its place. A zeroed record serves nothing until you
/// pass it again. Any number of units may share one record.
///
/// A unit may have several tables of one kind, for example holding registers 0 to 9 and 40000
/// to 40099; the same holds for callbacks, files and FIFO queues. The unit asks them in the
/// order of their registration. The first one that has all cells of a request answers it. If
/// none has all of them, the unit answers with exception 02, also where several have them
/// together.
#[repr(C)]
pub struct mbm_unit {
    /// Private: the records in the order in which the unit calls them. NULL follows the
    /// last one.
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
    /// The unit id, 1 to 247 (serial line guide V1.02, 2.2). The ids 248 to 255, which
    /// the standard reserves, are accepted. 0 answers to every id. A unit without any
    /// record does not answer. A begin function of a server refuses a greater id
    /// (MBM_INVALID_ARGUMENT). If you set one later, no request has it.
    pub id: u16,
}

/// Puts a service into the first free place of a unit, unless the unit has it already. A
/// record that is not zero keeps its `serve` function: another unit may serve it with
/// functions 16 and 17 (hex). Returns [`Status::BUSY`] for a record that is served as
/// another kind, because it would then serve other functions on every unit that has it.
///
/// # Safety
/// Each pointer is NULL or valid. `service` is the head of a record that is zero or that
/// `serve` serves.
pub(super) unsafe fn add_as(
    unit: *mut mbm_unit,
    service: *mut mbm_service,
    kind: u8,
    serve: Serve,
) -> Status {
    if unit.is_null() || service.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, and `place` is within the services of the unit.
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

/// As [`add_as`], for a family with only one kind of record.
pub(super) unsafe fn add(unit: *mut mbm_unit, service: *mut mbm_service, serve: Serve) -> u8 {
    add_as(unit, service, 1, serve).code()
}

/// As [`add`], for a family of records of which a unit serves only one: the unit would never
/// call a second one. No other family has records of this `kind`. Returns [`Status::BUSY`] for it.
pub(super) unsafe fn add_only(
    unit: *mut mbm_unit,
    service: *mut mbm_service,
    kind: u8,
    serve: Serve,
) -> u8 {
    let is_other = |known: *mut mbm_service| known != service && (*known).kind == kind;
    if !unit.is_null() && Services::new(unit).any(is_other) {
        return Status::BUSY.code();
    }
    add_as(unit, service, kind, serve).code()
}

/// The services of a unit, one after the other, up to the first free place. The code that
/// runs for one service may add others.
pub(super) struct Services {
    place: *const *mut mbm_service,
    end: *const *mut mbm_service,
}

impl Services {
    /// # Safety
    /// `unit` is a unit, and stays one while the iterator is used.
    pub(super) unsafe fn new(unit: *const mbm_unit) -> Services {
        let place = (&raw const (*unit).services).cast::<*mut mbm_service>();
        let end = place.add(MBM_MAX_SERVICES.into());
        Services { place, end }
    }
}

impl Iterator for Services {
    type Item = *mut mbm_service;

    fn next(&mut self) -> Option<*mut mbm_service> {
        if self.place == self.end {
            return None;
        }
        // SAFETY: not the end, so a place of the unit.
        unsafe {
            let service = *self.place;
            self.place = self.place.add(1);
            (!service.is_null()).then_some(service)
        }
    }
}

/// The PDU of a request, including the space that the response may take, and the length
/// of the request.
///
/// # Safety
/// Nothing else uses the PDU while the slice lives.
pub(super) unsafe fn request<'a>(pdu: *mut u8, info: *const c_void) -> (&'a mut [u8], usize) {
    let info = info.cast::<Indication>();
    let (space, length) = ((*info).space.into(), (*info).length.into());
    core::hint::assert_unchecked(length <= space);
    (from_raw_parts_mut(pdu, space), length)
}

/// Calls the services of a unit one after the other until one of them answers the request.
// In line, a server of four tables takes 12 bytes less on a Cortex-M0+ and 68 on an AVR.
#[inline(always)]
pub(super) unsafe fn call_services(
    unit: *mut mbm_unit,
    info: *const c_void,
    pdu: *mut u8,
) -> usize {
    // The loop ends at the next field, the pointer to the monitor function: see the assertion
    // below. It is not NULL if a service that declines has added diagnostics to the unit.
    let refusal = refusal_of(info);
    refusal.write(Refusal::NONE);
    let mut place = unit
        .byte_add(offset_of!(mbm_unit, services))
        .cast::<*mut mbm_service>();
    let end = (&raw mut (*unit).monitor).cast();
    while place != end && !(*place).is_null() {
        let reply = Reply::from_number(call_service(*place, info, pdu));
        if !(*refusal).note(reply) {
            return reply.code();
        }
        place = place.add(1);
    }
    (*refusal).reply().code()
}

/// What the services of the unit that were called lack.
pub(super) unsafe fn refusal_of(info: *const c_void) -> *mut Refusal {
    // `info` is part of a server, which is not constant.
    &raw mut (*info.cast::<Indication>().cast_mut()).refusal
}

const _: () = {
    let end = offset_of!(mbm_unit, services) + MBM_MAX_SERVICES as usize * size_of::<usize>();
    assert!(offset_of!(mbm_unit, monitor) == end);
};

/// Passes a request to one service. A zeroed record has no function and handles nothing.
unsafe fn call_service(service: *mut mbm_service, info: *const c_void, pdu: *mut u8) -> usize {
    match (*service).serve {
        Some(serve) => serve(service, pdu, info),
        None => Reply::NOT_HANDLED.code(),
    }
}

/// True if the unit has at least one service.
unsafe fn serves(unit: *const mbm_unit) -> bool {
    let first = (&raw const (*unit).services).cast::<*mut mbm_service>();
    !(*first).is_null()
}

/// True if every unit has an id that a request can have.
// This loop takes less flash than `all`: 12 bytes on a Cortex-M0+, 34 on an AVR.
#[inline(always)]
pub(crate) unsafe fn have_ids(units: *const mbm_unit, count: u8) -> bool {
    let (mut unit, mut left) = (units, count);
    while left != 0 {
        if (*unit).id > u8::MAX.into() {
            return false;
        }
        unit = unit.add(1);
        left -= 1;
    }
    true
}

/// True if one of the units answers this id, and for 0, the address of a broadcast.
pub(super) unsafe fn have(units: *const mbm_unit, count: u8, id: u8) -> bool {
    let (mut unit, mut left) = (units, count);
    while left != 0 {
        let known = (*unit).id;
        if id == 0 || known == 0 || known == id.into() {
            return true;
        }
        unit = unit.add(1);
        left -= 1;
    }
    false
}

/// Passes a frame to each unit. The first unit that it addresses answers.
#[cfg_attr(target_arch = "avr", inline(always))]
pub(super) unsafe fn serve(
    units: *mut mbm_unit,
    count: u8,
    info: *const Indication,
    pdu: *mut u8,
) -> usize {
    // The PDU has space for a function code, even after a damaged frame.
    let all = (*info).addressing_of_all(*pdu);
    let mut frame = UnitsForFrame {
        unit: units,
        left: count,
        info,
        pdu,
    };
    dispatch(&mut frame, all).code()
}

/// A frame, and the units that have not seen it yet. The pointers are arguments of [`serve`];
/// no reference lives while a unit runs.
struct UnitsForFrame {
    unit: *mut mbm_unit,
    left: u8,
    info: *const Indication,
    pdu: *mut u8,
}

impl Dispatch for UnitsForFrame {
    type Unit = *mut mbm_unit;

    #[inline(always)]
    fn next(&mut self) -> Option<*mut mbm_unit> {
        // SAFETY: the arguments of `serve`.
        unsafe {
            loop {
                if self.left == 0 {
                    return None;
                }
                let unit = self.unit;
                self.unit = unit.add(1);
                self.left -= 1;
                // Skips a unit without services.
                if serves(unit) {
                    return Some(unit);
                }
            }
        }
    }

    #[inline(always)]
    fn is_for(&self, unit: &*mut mbm_unit) -> bool {
        // SAFETY: the arguments of `serve`.
        unsafe { (*self.info).is_for((**unit).id) }
    }

    #[inline(always)]
    fn offer(&mut self, unit: *mut mbm_unit, addressing: Addressing) -> Option<Reply> {
        // SAFETY: the arguments of `serve`.
        let reply = unsafe {
            let (info, pdu) = (self.info.cast(), self.pdu);
            match (*unit).monitor {
                Some(monitor) => monitor(unit, info, addressing.code(), pdu),
                None if addressing == Addressing::FOREIGN => return None,
                None => call_services(unit, info, pdu),
            }
        };
        Some(Reply::from_number(reply))
    }
}

/// True for a broadcast of a function that a unit does not carry out as a broadcast.
pub(super) unsafe fn is_ignored_broadcast(info: *const c_void, function: u8) -> bool {
    (*info.cast::<Indication>()).is_broadcast() && !only_writes(function)
}

/// As [`add`], but puts the service before all others of the unit.
pub(super) unsafe fn add_first(unit: *mut mbm_unit, new: *mut mbm_service, serve: Serve) -> u8 {
    let status = add(unit, new, serve);
    if status == Status::OK.code() {
        let mut moved = new;
        let mut place = (&raw mut (*unit).services).cast::<*mut mbm_service>();
        // The loop ends at the place where `add` put `new`.
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
