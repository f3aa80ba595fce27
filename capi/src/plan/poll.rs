//! Sending the reads that are due, and taking their replies.

use super::object::{reads, setup, time, Object};
use super::setup::mbm_planSetup;
use super::storage::mbm_plan;
use crate::client::{self, mbm_client, mbm_clientRequest, mbm_client_pending, MBM_CLIENT_DEPTH};
use crate::pointers;
use core::ffi::c_void;
use mbm::error::Status;
use mbm::plan::{schedule, Read};

/// The longest delay in milliseconds that mbm_plan_pollDelay returns: the clock of the port
/// must be read before it wraps.
const LONGEST_DELAY: u32 = 30 * 60 * 1000;

/// Queues the reads that are due, as far as there are requests for them. It does not poll the
/// client: call mbm_client_poll after it.
///
/// @param plan  the object
/// @return MBM_OK; MBM_BUSY from within a hook of the client's port; MBM_INVALID_ARGUMENT;
///         MBM_NOT_INITIALISED, also for a client that was zeroed
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_poll(plan: *mut mbm_plan) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(plan, |object| {
            match pointers::check((*object).client) {
                Status::OK => {}
                refused => return refused,
            }
            let now = time(object);
            while let Ok(index) = schedule::next(reads(object), now) {
                match queue(plan, index) {
                    Status::PENDING => {}
                    // Not now.
                    Status::BUSY | Status::QUEUE_FULL => break,
                    refused => {
                        end(plan, index, refused);
                        // `update` may have zeroed it.
                        if pointers::check(plan) != Status::OK {
                            break;
                        }
                    }
                }
            }
            Status::OK
        })
    }
}

/// A request that no read uses.
///
/// # Safety
/// `object` is begun.
unsafe fn free_slot(object: *mut Object) -> Option<u8> {
    // SAFETY: as the caller promises; the setup has so many requests.
    unsafe {
        (0..setup(object).requestCount).find(|slot| {
            let request = setup(object).requests.add((*slot).into());
            (*request).status != Status::PENDING.code()
                && reads(object).iter().all(|read| read.slot != *slot)
        })
    }
}

/// Queues a read. [`Status::PENDING`], or why not.
///
/// # Safety
/// `plan` is begun.
unsafe fn queue(plan: *mut mbm_plan, index: usize) -> Status {
    // SAFETY: as the caller promises. The data of a read lie within the plan's words.
    unsafe {
        let object = pointers::object(plan);
        let Some(slot) = free_slot(object) else {
            return Status::BUSY;
        };
        let Some(read) = reads(object).get_mut(index) else {
            return Status::INVALID_ARGUMENT;
        };
        let mbm_planSetup {
            requests,
            data,
            dataWords,
            ..
        } = *setup(object);
        if read.offset > dataWords || read.words() > dataWords - read.offset {
            return Status::INVALID_ARGUMENT;
        }
        let request = requests.add(slot.into());
        (*request).done = Some(done);
        (*request).context = plan.cast();
        (*request).reply = data.add(read.offset.into()).cast();
        (*request).replyBytes = read.words().saturating_mul(2);
        (*request).transaction = 0;
        (*request).unit = read.unit;
        let Read {
            table,
            address,
            quantity,
            ..
        } = *read;
        let status = client::read_table((*object).client, request, table, address, quantity);
        if status == Status::PENDING.code() {
            read.slot = slot;
        }
        Status::from_code(status)
    }
}

/// Takes a read that has ended, as `done` of its request.
unsafe extern "C" fn done(context: *mut c_void, request: *mut mbm_clientRequest) {
    let plan: *mut mbm_plan = context.cast();
    // SAFETY: the client calls it with what `queue` set. If the plan was zeroed since, or begun
    // anew, no read of it has this request.
    unsafe {
        if pointers::check(plan) != Status::OK {
            return;
        }
        let object = pointers::object(plan);
        let is_own = |read: &Read| {
            read.slot < setup(object).requestCount
                && setup(object).requests.add(read.slot.into()) == request
        };
        if let Some(index) = reads(object).iter().position(is_own) {
            end(plan, index, Status::from_code((*request).status));
        }
    }
}

/// Ends a read, and calls `update` for the fields of each read whose status is news.
///
/// # Safety
/// `plan` is begun; no reference into it lives, for `update` may use it, end it and zero it.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn end(plan: *mut mbm_plan, index: usize, status: Status) {
    // SAFETY: as the caller promises; looked at again after every call of `update`.
    unsafe {
        let object = pointers::object(plan);
        let now = time(object);
        schedule::end(reads(object), index, status, now, &setup(object).backoff());
        while pointers::check(plan) == Status::OK {
            let Some(update) = setup(object).update else {
                return;
            };
            let Some(news) = reads(object).iter_mut().find_map(Read::take_news) else {
                return;
            };
            for position in news {
                if pointers::check(plan) != Status::OK {
                    return;
                }
                let context = setup(object).context;
                if let Some(position) = setup(object).positions().get(position) {
                    update(context, plan, position.field() as u16);
                }
            }
        }
    }
}

/// How long mbm_plan_poll has nothing to do, so that a program may sleep until then or until
/// mbm_client_pollDelay is over, whichever comes first.
///
/// @param plan  the object
/// @return microseconds; 0 means poll now, and is returned within a hook of the client's port;
///         0xFFFFFFFF if there is nothing to do before a request of the client has ended, and
///         for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_pollDelay(plan: *mut mbm_plan) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        if pointers::check(plan) != Status::OK {
            return u32::MAX;
        }
        let object = pointers::object(plan);
        let client: *mut mbm_client = (*object).client;
        match pointers::check(client) {
            Status::OK => {}
            Status::BUSY => return 0,
            _ => return u32::MAX,
        }
        let now = time(object);
        match schedule::next(reads(object), now) {
            Err(u32::MAX) => u32::MAX,
            Err(delay) => delay.min(LONGEST_DELAY) * 1000 - (*object).rest,
            Ok(_) if mbm_client_pending(client) == MBM_CLIENT_DEPTH => u32::MAX,
            Ok(_) if free_slot(object).is_none() => u32::MAX,
            Ok(_) => 0,
        }
    }
}
