//! A plan that divides the reads that a device refuses.

use super::mbm_plan;
use super::object::{time, Object};
use super::poll;
use super::setup::mbm_planSetup;
use crate::client::mbm_clientRequest;
use crate::pointers;
use core::ptr::null_mut;
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::plan::split::{Finding, Splitter};
use mbm::plan::Read;

/// Storage of mbm_plan_pollSplitting. Initialise it with MBM_INIT, and set `blocks`. It is one
/// plan's alone.
#[repr(C)]
pub struct mbm_planSplitting {
    /// Storage: as many as fields.
    pub blocks: *mut u16,
    /// After this time a field that the device does not have is tried again, and neighbours that
    /// could not be joined are tried as one, in milliseconds; 0 means 600000, ten minutes.
    pub retryMs: u32,
    /// Private.
    pub triedAt: u32,
    /// How many reads there is storage for in `reads` of the setup; 0 means `readCount` of the
    /// setup. As many as fields always suffice.
    pub readCount: u16,
    /// Private.
    pub begins: u8,
    /// Private.
    pub state: u8,
}

/// `state`: the storage is in use.
const STARTED: u8 = 1;
/// `state`: reads may be joined when one has ended.
const UNSETTLED: u8 = 2;

/// The default of `retryMs`.
const RETRY_MS: u32 = 600_000;

/// As mbm_plan_poll, for devices that lack some fields of the table, or that refuse long reads:
/// call it instead. Zeroed storage is a plan that has found nothing yet.
///
/// If a device refuses a read with the exceptions 02 or 03, the read is divided, again and again,
/// until what is refused is one field. Only that field gets the status MBM_ILLEGAL_DATA_ADDRESS
/// or MBM_ILLEGAL_DATA_VALUE, with a call of `update`; mbm_plan_getStatus returns it from then on.
/// Meanwhile the other fields keep their status. Neighbours that the device has are read together
/// again. A field that was found not to be there has a read of its own, which is sent again each
/// `retryMs`: the device may have it later. Fields that share all their addresses are one.
///
/// Where the storage does not suffice, a read stays as it is, and its fields have its status.
/// A read that is divided needs another one in `reads`. Bits, and fields that share some of their
/// addresses, also need spare words in `data`: four times the words of their reads, and
/// one for each field of bits, always suffice.
///
/// Use only one of the two functions for a plan until it has ended or is begun again. The storage
/// stays valid until then.
///
/// @param splitting  what was found, and storage
/// @return as mbm_plan_poll; MBM_INVALID_ARGUMENT without `blocks`
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_pollSplitting(
    plan: *mut mbm_plan,
    splitting: *mut mbm_planSplitting,
) -> u8 {
    if splitting.is_null() || (*splitting).blocks.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    pointers::with(plan, |object| poll_splitting(plan, object, splitting))
}

/// As mbm_plan_poll, whose loop it repeats: with one for both, that of mbm_plan_poll takes more
/// firmware.
///
/// # Safety
/// `object` is that of `plan`, which is begun; `splitting` is as the header demands.
unsafe fn poll_splitting(
    plan: *mut mbm_plan,
    object: *mut Object,
    splitting: *mut mbm_planSplitting,
) -> Status {
    match pointers::check((*object).client) {
        Status::OK => {}
        refused => return refused,
    }
    time(object);
    start(object, splitting);
    let begins = (*object).begins;
    let mut has_ended = false;
    let setup = (*object).setup();
    for slot in 0..setup.requestCount {
        let request = setup.requests.add(slot.into());
        let status = Status::from_code((*request).status);
        if status == Status::PENDING {
            continue;
        }
        let ended = poll::read_of(request).map(core::ptr::from_ref);
        let mut told = None;
        if let Some(ended) = ended {
            (*request).context = null_mut();
            has_ended = true;
            told = end(object, splitting, ended, status);
        }
        if let Some(next) = (*object).schedule.next((*object).reads(), (*object).millis) {
            poll::queue(object, request, next);
        }
        if let (Some(ended), Some(is_of_unit)) = (ended, told) {
            if !poll::update(plan, ended, is_of_unit) {
                return Status::OK;
            }
        }
    }
    if has_ended && (*object).begins == begins {
        settle(object, splitting);
    }
    Status::OK
}

/// Begins with a plan that was begun since the last call.
unsafe fn start(object: *mut Object, splitting: *mut mbm_planSplitting) {
    if (*splitting).state & STARTED != 0 && (*splitting).begins == (*object).begins {
        return;
    }
    (*splitting).begins = (*object).begins;
    (*splitting).state = STARTED;
    (*splitting).triedAt = time(object);
    change(object, splitting, |splitter| splitter.start());
}

/// Calls `act` with the parts of the plan, and notes how many reads there are after that.
unsafe fn change<T>(
    object: *mut Object,
    splitting: *mut mbm_planSplitting,
    act: impl FnOnce(&mut Splitter) -> T,
) -> T {
    let setup: &mbm_planSetup = (*object).setup();
    let fields = usize::from(setup.fieldCount);
    let reads = match (*splitting).readCount {
        0 => setup.readCount,
        own => own.min(setup.fieldCount),
    };
    let mut splitter = Splitter {
        fields: setup.fields(),
        positions: from_raw_parts_mut(setup.positions.cast(), fields),
        reads: from_raw_parts_mut(setup.reads.cast(), reads.into()),
        data: from_raw_parts_mut(setup.data, setup.dataWords.into()),
        blocks: from_raw_parts_mut((*splitting).blocks, fields),
        count: (*object).read_count.into(),
    };
    let result = act(&mut splitter);
    (*object).read_count = splitter.count as u16;
    result
}

/// The time after which something that failed is tried again.
unsafe fn retry_ms(splitting: *const mbm_planSplitting) -> u32 {
    match (*splitting).retryMs {
        0 => RETRY_MS,
        own => own.min(super::MBM_PLAN_LONGEST_INTERVAL),
    }
}

/// Notes how a read ended. Returns whether its status is that of all reads of its unit; `None` if the
/// read was divided: the program is not told then.
///
/// # Safety
/// `object` is begun, with this read; no reference to its reads lives.
unsafe fn end(
    object: *mut Object,
    splitting: *mut mbm_planSplitting,
    ended: *const Read,
    status: Status,
) -> Option<bool> {
    let (now, retry_ms) = ((*object).millis, retry_ms(splitting));
    let before = (*ended).status();
    let index = (*ended).index((*object).reads());
    let (reads, backoff) = ((*object).reads(), (*object).setup().backoff());
    let schedule = &(*object).schedule;
    let is_of_unit = schedule.end_divided(reads, &*ended, status, now, &backoff);
    let finding = change(object, splitting, |splitter| {
        splitter.end(index, before, now, retry_ms)
    });
    if finding != Finding::Nothing {
        (*splitting).state |= UNSETTLED;
        schedule.renew((*object).reads(), now);
    }
    (finding != Finding::Divided).then_some(is_of_unit)
}

/// Joins reads as far as they can be.
unsafe fn settle(object: *mut Object, splitting: *mut mbm_planSplitting) {
    let now = (*object).millis;
    if now.wrapping_sub((*splitting).triedAt) >= retry_ms(splitting) {
        (*splitting).triedAt = now;
        (*splitting).state |= UNSETTLED;
        change(object, splitting, |splitter| splitter.forgive());
    }
    if (*splitting).state & UNSETTLED == 0 {
        return;
    }
    let setup = (*object).setup();
    let reads: *const Read = setup.reads.cast();
    let moved = |from: usize, to: usize| {
        for slot in 0..setup.requestCount {
            let request: *mut mbm_clientRequest = setup.requests.add(slot.into());
            if (*request).context == reads.add(from).cast_mut().cast() {
                (*request).context = reads.add(to).cast_mut().cast();
            }
        }
    };
    if change(object, splitting, |splitter| splitter.join(now, moved)) {
        (*splitting).state &= !UNSETTLED;
    }
    (*object).schedule.renew((*object).reads(), now);
}
