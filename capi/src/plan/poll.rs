//! Sending the reads that are due, and taking their replies.

use super::mbm_plan;
use super::object::{time, Object};
use super::MBM_PLAN_LONGEST_INTERVAL;
use crate::client::{self, mbm_clientRequest, mbm_client_pending, MBM_CLIENT_DEPTH};
use crate::pointers;
use core::ptr::null_mut;
use mbm::error::Status;
use mbm::plan::{Position, Read};

/// The longest delay in milliseconds that mbm_plan_pollDelay returns: the clock of the port
/// must be read before it wraps.
const LONGEST_DELAY: u32 = 30 * 60 * 1000;

/// Takes the replies that have arrived, calls `update` for the fields of each read that has
/// ended, and queues the reads that are due, as far as there are requests for them. It does not
/// poll the client: call mbm_client_poll after it.
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_poll(plan: *mut mbm_plan) -> u8 {
    pointers::with(plan, |object| {
        match pointers::check((*object).client) {
            Status::OK => {}
            refused => return refused,
        }
        time(object);
        let setup = (*object).setup();
        for slot in 0..setup.requestCount {
            let request = setup.requests.add(slot.into());
            let status = Status::from_code((*request).status);
            if status == Status::PENDING {
                continue;
            }
            let now = (*object).millis;
            let (reads, schedule) = ((*object).reads(), &(*object).schedule);
            let ended = read_of(request);
            let mut is_of_unit = false;
            if let Some(ended) = ended {
                is_of_unit = schedule.end(reads, ended, status, now, &setup.backoff());
                (*request).context = null_mut();
            }
            if let Some(next) = schedule.next(reads, now) {
                queue(object, request, next);
            }
            if let Some(ended) = ended {
                if !update(plan, ended, is_of_unit) {
                    break;
                }
            }
        }
        Status::OK
    })
}

/// The read of a request. `None` for a request that the plan does not use.
///
/// # Safety
/// The request is one of a begun plan.
pub(super) unsafe fn read_of<'a>(request: *const mbm_clientRequest) -> Option<&'a Read> {
    // SAFETY: `queue` sets it, and mbm_plan_begin resets it.
    unsafe { (*request).context.cast::<Read>().as_ref() }
}

/// Queues a read, the next one of the schedule, as a request.
///
/// # Safety
/// `object` is begun, with this request and this read. The request is not pending.
pub(super) unsafe fn queue(object: *const Object, request: *mut mbm_clientRequest, read: &Read) {
    // The data of a read lie within the plan's words.
    (*request).done = None;
    (*request).reply = (*object).setup().data.add(read.offset.into()).cast();
    (*request).replyBytes = read.words() * 2;
    (*request).transaction = 0;
    (*request).unit = read.unit.into();
    let (address, quantity) = (read.address, read.quantity);
    let status = client::read_table((*object).client, request, read.table, address, quantity);
    match Status::from_code(status) {
        // Not now.
        Status::BUSY | Status::QUEUE_FULL => {}
        // If it was refused, the next poll ends the read.
        _ => {
            (*request).context = (&raw const *read).cast_mut().cast();
            (*object).schedule.begin((*object).reads());
        }
    }
}

/// Calls `update` for the fields of a read that has ended, or of all reads of its unit. Returns
/// false if the plan has ended or was begun again meanwhile.
///
/// # Safety
/// `plan` is begun; no reference into it lives, for `update` may use it, begin it again,
/// end it and zero it.
#[inline(always)] // Of two callers a program has one.
pub(super) unsafe fn update(plan: *mut mbm_plan, ended: *const Read, is_of_unit: bool) -> bool {
    // Looked at again after every call of `update`.
    let object = pointers::object(plan);
    let begins = (*object).begins;
    // These stay as they are until the plan ends.
    let setup = (*object).setup;
    let positions: *const Position = (*setup).positions.cast();
    let reads: *const Read = (*setup).reads.cast();
    let index = ended.offset_from(reads) as usize;
    let mut place = if is_of_unit {
        0
    } else {
        (*positions.add(index)).first()
    };
    while place < (*setup).fieldCount.into() {
        let field = (*positions.add(place)).field();
        let read = reads.add((*positions.add(field)).read());
        if read != ended && !is_of_unit {
            break;
        }
        if (*read).unit == (*ended).unit {
            if let Some(update) = (*setup).update {
                update((*setup).context, plan, field as u16);
                if pointers::check(plan) != Status::OK || (*object).begins != begins {
                    return false;
                }
            }
        }
        place += 1;
    }
    true
}

/// How long mbm_plan_poll has nothing to do, so that a program may sleep until then or until
/// mbm_client_pollDelay is over, whichever comes first.
///
/// @return microseconds; 0 means poll now, and is returned within a hook of the client's port;
///         0xFFFFFFFF if there is nothing to do before a request of the client has ended, and for
///         an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_pollDelay(plan: *mut mbm_plan) -> u32 {
    if pointers::check(plan) != Status::OK {
        return u32::MAX;
    }
    let object = pointers::object(plan);
    let client = (*object).client;
    match pointers::check(client) {
        Status::OK => {}
        Status::BUSY => return 0,
        _ => return u32::MAX,
    }
    let now = time(object);
    let setup = (*object).setup();
    let mut is_free = false;
    for slot in 0..setup.requestCount {
        let request = setup.requests.add(slot.into());
        if (*request).status == Status::PENDING.code() {
            continue;
        }
        if read_of(request).is_some() {
            return 0;
        }
        is_free = true;
    }
    if !is_free || mbm_client_pending(client) == MBM_CLIENT_DEPTH {
        return u32::MAX;
    }
    let (reads, schedule) = ((*object).reads(), &(*object).schedule);
    match schedule.idle(reads, now) {
        idle if idle > MBM_PLAN_LONGEST_INTERVAL => u32::MAX,
        idle => idle.min(LONGEST_DELAY) * 1000,
    }
}
