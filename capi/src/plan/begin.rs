//! Beginning and ending a plan.

use super::mbm_plan;
use super::setup::mbm_planSetup;
use crate::client::object::queue;
use crate::client::{self, mbm_client, mbm_client_cancel};
use crate::pointers::{self, Out};
use core::ptr::null_mut;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::error::Status;
use mbm::plan::group::{self, Refusal};
use mbm::plan::{Position, Read};

/// Groups the fields of a table into reads. mbm_plan_poll sends them from then on.
///
/// Fields with the same unit, table and interval are read together, and may overlap: what
/// several of them share is read once. The plan covers them within the limits by the fewest
/// reads, and among such plans by the fewest bits or registers. All reads are due at once; the
/// rounds after the first are spread, so that reads of one interval follow each other at equal
/// distances.
///
/// You may call it again at any time, also from `update`, but not from a hook of the client's
/// port. The plan then first ends, as by mbm_plan_end, unless the call is refused for NULL, a
/// count out of range, a unit above 255 of limits or of an excluded range, or a client that was
/// never begun.
///
/// @param client  the client that sends the reads, begun; the program may use it too, and other
///                plans
/// @param setup   table, limits and storage; it stays valid and as it is until the plan ends
/// @param field   gets the index of the field that is wrong, 0xFFFF if it is none; may be NULL
/// @return MBM_OK. The status of a field: MBM_INVALID_ARGUMENT for an unknown table, type or order,
///         a type that the table does not have, bits beyond those of a register, a unit above 255,
///         an interval out of range, a negative divisor or a scale of a text;
///         MBM_BROADCAST_NOT_ALLOWED for unit 0, unless the client has TCP frames;
///         MBM_ILLEGAL_DATA_ADDRESS if it goes beyond address
///         65535 or into an excluded range; MBM_ILLEGAL_DATA_VALUE if it is longer than a read may
///         be; MBM_BUFFER_TOO_SMALL for the first without storage for its read or its data. After
///         such a status the plan has ended, and `positions` and `reads` may be changed.
///         MBM_INVALID_ARGUMENT also for a unit above 255 of limits or of an excluded range
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_begin(
    plan: *mut mbm_plan,
    client: *mut mbm_client,
    setup: *const mbm_planSetup,
    field: Out<u16>,
) -> u8 {
    let group = |setup: &mbm_planSetup, unit_0, positions: &mut [Position], reads: &mut [Read]| {
        group::group(
            setup.fields(),
            unit_0,
            setup,
            positions,
            reads,
            setup.dataWords,
        )
    };
    let has_limits = setup.as_ref().is_some_and(mbm_planSetup::has_limits);
    begin(plan, client, setup, field, has_limits, group)
}

/// As mbm_plan_begin, for fields that were grouped before: `mbm header` writes such a table. A
/// program that calls only this function does not contain the code that groups fields, a quarter of
/// a plan.
///
/// The fields of a read stand side by side in `setup->fields`, the one with the lowest address
/// first, and have the same unit, table and interval. `setup->readCount` is the number of reads.
/// The limits, gaps and excluded ranges of `setup` have no meaning.
///
/// @param client  as for mbm_plan_begin
/// @param setup   table and storage; it stays valid and as it is until the plan ends
/// @param counts  how many fields each read has: `setup->readCount` numbers, each at least 1,
///                `setup->fieldCount` in total; used during the call
/// @param field   gets the index of the field that is wrong, 0xFFFF if it is none; may be NULL
/// @return as mbm_plan_begin; MBM_INVALID_ARGUMENT also for a field that does not fit into its
///         read: it differs from the first one in unit, table or interval, has a lower address, or
///         makes the read longer than 125 registers or 2000 bits; for counts of 0 or with another
///         total; and for more fields than MBM_PLAN_MAX_FIELDS
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_beginGrouped(
    plan: *mut mbm_plan,
    client: *mut mbm_client,
    setup: *const mbm_planSetup,
    counts: *const u16,
    field: Out<u16>,
) -> u8 {
    let group = |setup: &mbm_planSetup, unit_0, positions: &mut [Position], reads: &mut [Read]| {
        let counts = from_raw_parts(counts, reads.len());
        group::take_groups(
            setup.fields(),
            unit_0,
            counts,
            positions,
            reads,
            setup.dataWords,
        )
    };
    begin(plan, client, setup, field, !counts.is_null(), group)
}

/// Begins a plan with the reads that `group` makes. It is refused if `is_usable` is false.
unsafe fn begin(
    plan: *mut mbm_plan,
    client: *mut mbm_client,
    setup: *const mbm_planSetup,
    field: Out<u16>,
    is_usable: bool,
    group: impl FnOnce(&mbm_planSetup, u8, &mut [Position], &mut [Read]) -> Result<usize, Refusal>,
) -> u8 {
    let mut wrong = u16::MAX;
    // `field` is NULL or what the header says.
    let status = attempt(plan, client, setup, is_usable, group, &mut wrong);
    field.put(wrong);
    status.code()
}

/// As [`begin`]; writes the index of the field that is wrong, if it is one.
#[inline(always)]
unsafe fn attempt(
    plan: *mut mbm_plan,
    client: *mut mbm_client,
    setup: *const mbm_planSetup,
    is_usable: bool,
    group: impl FnOnce(&mbm_planSetup, u8, &mut [Position], &mut [Read]) -> Result<usize, Refusal>,
    wrong: &mut u16,
) -> Status {
    // Nothing uses the storage of a plan that is not begun.
    if plan.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    let usable = pointers::check(client);
    if usable != Status::OK {
        return usable;
    }
    let Some(given) = setup
        .as_ref()
        .filter(|setup| is_usable && setup.is_complete())
    else {
        return Status::INVALID_ARGUMENT;
    };
    if mbm_plan_end(plan) == Status::BUSY.code() {
        return Status::BUSY;
    }
    let count = usize::from(given.fieldCount);
    let positions = from_raw_parts_mut(given.positions.cast(), count);
    let reads = from_raw_parts_mut(given.reads.cast(), given.readCount.into());
    // In TCP frames unit 0 is a unit.
    let has_unit_0 = u8::from(queue(pointers::object(client)).has_transaction_ids);
    let count = match group(given, has_unit_0, positions, reads) {
        Ok(count) => count as u16,
        Err(refusal) => {
            *wrong = refusal.field as u16;
            return refusal.status;
        }
    };
    for slot in 0..given.requestCount {
        (*given.requests.add(slot.into())).context = null_mut();
    }
    let object = pointers::object(plan);
    (*object).read_count = count;
    (*object).setup = setup;
    (*object).client = client;
    (*object).begins = (*object).begins.wrapping_add(1);
    (*object).millis = 0;
    (*object).micros = client::clock(client);
    (*object).mark = pointers::BEGUN;
    (*object).schedule.start((*object).reads(), 0);
    Status::OK
}

/// Ends a plan: gives its requests up and lets go of its storage.
#[no_mangle]
pub unsafe extern "C" fn mbm_plan_end(plan: *mut mbm_plan) -> u8 {
    pointers::with(plan, |object| {
        let client = (*object).client;
        if pointers::check(client) == Status::BUSY {
            return Status::BUSY;
        }
        let setup = (*object).setup();
        for slot in 0..setup.requestCount {
            mbm_client_cancel(client, setup.requests.add(slot.into()));
        }
        (*object).mark = 0;
        Status::OK
    })
}
