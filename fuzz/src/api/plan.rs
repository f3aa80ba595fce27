//! The plan.

use super::check::{checked_call, is_status, refused_changes_nothing, span, OK, PENDING};
use super::world::{Grant, World};
use mbm_c::*;
use std::ffi::c_void;
use std::ptr::null_mut;

unsafe extern "C" fn update(_: *mut c_void, plan: *mut mbm_plan, field: u16) {
    let w = World::current();
    // SAFETY: the plan passes itself.
    let status = unsafe { mbm_plan_getStatus(plan, field, Out::new(null_mut())) };
    is_status("mbm_plan_getStatus", status);
    w.hook(Grant::All, 6);
}

fn field(w: &World) -> mbm_planField {
    let byte = w.byte();
    let bits = byte & 1 != 0;
    let good = !w.rarely(12);
    mbm_planField {
        unit: w.unit_id().into(),
        table: if good {
            1 + (byte >> 1 & 1) + if bits { 0 } else { 2 }
        } else {
            byte % 6
        },
        r#type: match (good, bits) {
            (true, true) => MBM_TYPE_BIT,
            (true, false) => 1 + (byte >> 2) % 10,
            _ => w.byte() % 12,
        },
        order: if good { byte % 5 } else { byte % 8 },
        bit: if w.rarely(3) { w.byte() % 17 } else { 0 },
        address: w.word(),
        count: w.word() % 40,
        intervalMs: if good {
            1 + u32::from(w.word())
        } else {
            w.long()
        },
        multiplier: if byte & 4 == 0 { 0 } else { w.long() as i32 },
        divisor: if byte & 8 == 0 {
            0
        } else {
            w.long() as i32 & if good { i32::MAX } else { -1 }
        },
    }
}

/// Begins a plan over a client, with storage of exactly what its setup says.
pub fn begin(w: &World, plan: *mut mbm_plan, client: *mut mbm_client) {
    let fields: Vec<_> = (0..w.byte() % 10).map(|_| field(w)).collect();
    let count = fields.len();
    let (reads, words, requests) = (w.byte() % 12, w.word() % 300, w.byte() % 6);
    let units: Vec<_> = (0..w.byte() % 3)
        .map(|_| mbm_planUnitLimits {
            bitsPerRead: w.word(),
            registersPerRead: w.byte().into(),
            unit: w.unit_id().into(),
        })
        .collect();
    let excluded: Vec<_> = (0..w.byte() % 3)
        .map(|_| mbm_planExcludedRange {
            first: w.word(),
            last: w.word(),
            unit: (w.byte() % 4).into(),
            table: w.byte() % 5,
        })
        .collect();
    let null_one = w.byte();
    let unless = |index: u8, pointer: *mut u8| {
        if null_one == 0xF0 + index {
            null_mut()
        } else {
            pointer
        }
    };
    let block = |size: usize, count: usize| w.block(size * count, 8);
    let setup = w.put(mbm_planSetup {
        fields: unless(0, w.array(&fields).cast()).cast(),
        positions: unless(1, block(size_of::<mbm_planPosition>(), count)).cast(),
        reads: unless(2, block(size_of::<mbm_planRead>(), reads.into())).cast(),
        data: unless(3, block(2, words.into())).cast(),
        requests: unless(4, block(size_of::<mbm_clientRequest>(), requests.into())).cast(),
        units: unless(5, w.array(&units).cast()).cast(),
        excluded: unless(6, w.array(&excluded).cast()).cast(),
        update: (!w.rarely(4)).then_some(update),
        context: null_mut(),
        backoffMs: w.long(),
        longestBackoffMs: w.long(),
        fieldCount: count as u16,
        readCount: reads.into(),
        dataWords: words,
        bitsPerRead: w.word(),
        bitGap: w.word(),
        registersPerRead: w.byte().into(),
        registerGap: w.byte().into(),
        requestCount: requests,
        unitCount: units.len() as u8,
        excludedCount: excluded.len() as u8,
    });
    let setup = w.null_or(64, || setup);
    let wrong = w.null_or(8, || w.unset::<u16>());
    // How many fields each read has: one, and the last the rest.
    let mut counts = vec![1; reads.into()];
    if let Some(last) = counts.last_mut() {
        *last = match w.byte() {
            0 => w.word(),
            _ => (count as u16).wrapping_sub(u16::from(reads) - 1),
        };
    }
    let counts = w.array(&counts);
    let is_grouped = w.byte() & 1 == 0;
    let begin = || {
        if is_grouped {
            call!(w, mbm_plan_beginGrouped(plan, client, setup, counts, wrong))
        } else {
            call!(w, mbm_plan_begin(plan, client, setup, wrong))
        }
    };
    // A plan that runs ends before its new table is checked.
    let runs = super::check::bytes(span(plan))
        .first()
        .is_some_and(|mark| *mark != 0);
    let status = if runs {
        checked_call(w, span(plan), "mbm_plan_begin", begin)
    } else {
        refused_changes_nothing(w, &[span(plan)], "mbm_plan_begin", begin)
    };
    if !wrong.is_null() {
        // SAFETY: not NULL.
        let index = usize::from(unsafe { *wrong });
        assert!(index == 0xFFFF || (index < count && status != OK));
    }
}

/// A value gets the result of a call, and stays as it is if the call is refused.
fn get<T>(w: &World, name: &str, call: impl FnOnce(*mut T) -> u8) {
    let value = w.null_or(32, || w.unset::<T>());
    let before = super::check::bytes(span(value));
    if is_status(name, call(value)) != OK {
        assert!(super::check::bytes(span(value)) == before, "{name} changed");
    }
}

/// A conversion, or NULL.
fn conversion(w: &World) -> *const mbm_planConversion {
    let numbers: Vec<u16> = (0..w.byte() % 6).map(|_| w.word()).collect();
    let conversion = w.put(mbm_planConversion {
        notAvailable: w.array(&numbers),
        offset: w.long() as i32 >> (w.byte() % 32),
        powerField: (w.byte() % 4).into(),
        notAvailableCount: numbers.len() as u16,
        offsetDecimals: w.byte() % 11,
        flags: w.byte(),
    });
    w.null_or(8, || conversion)
}

/// Converts values of a plan, or of registers.
fn convert(w: &World, plan: *mut mbm_plan) {
    let (index, decimals) = (u16::from(w.byte() % 4), w.byte() % 11);
    let fields: Vec<_> = (0..4).map(|_| field(w)).collect();
    let fields = w.null_or(16, || w.array(&fields));
    let (at, view, with) = (w.byte() % 4, w.views.pick(w), conversion(w));
    let at = u16::from(at);
    macro_rules! get {
        ($name:ident($($argument:expr),*)) => {
            get(w, stringify!($name), |value| call!(w, $name($($argument,)* value)))
        };
    }
    match w.byte() % 6 {
        0 => get!(mbm_plan_getConverted(plan, at, index, with)),
        1 => get!(mbm_plan_getDecimal(plan, at, index, with, decimals)),
        2 => {
            let status = call!(w, mbm_plan_checkAvailable(plan, at, index, with));
            is_status("mbm_plan_checkAvailable", status);
        }
        3 => get!(mbm_registers_getConverted(view, fields, at, index, with)),
        4 => get!(mbm_registers_getDecimal(
            view, fields, at, index, with, decimals
        )),
        _ => {
            let status = call!(
                w,
                mbm_registers_checkAvailable(view, fields, at, index, with)
            );
            is_status("mbm_registers_checkAvailable", status);
        }
    }
}

fn look(w: &World, plan: *mut mbm_plan) {
    let (field, index) = (u16::from(w.byte() % 12), u16::from(w.byte() % 8));
    macro_rules! get {
        ($name:ident($($argument:expr),*)) => {
            get(w, stringify!($name), |value| {
                call!(w, $name(plan, $($argument,)* value))
            })
        };
    }
    match w.byte() % 8 {
        0 => {
            let age = w.null_or(4, || w.unset());
            let status = call!(w, mbm_plan_getStatus(plan, field, age));
            is_status("mbm_plan_getStatus", status);
        }
        1 => get!(mbm_plan_getInteger(field, index)),
        2 => get!(mbm_plan_getInt32(field, index)),
        3 => get!(mbm_plan_getNumber(field, index)),
        4 => get!(mbm_plan_getFloat(field, index)),
        5 => get!(mbm_plan_getRegisters(field)),
        6 => get!(mbm_plan_getRead(index)),
        _ => {
            let capacity = w.word();
            let place = w.unset_bytes(capacity.into());
            let text = w.null_or(32, || place.cast());
            is_status(
                "mbm_plan_getText",
                call!(w, mbm_plan_getText(plan, field, text, capacity)),
            );
        }
    }
}

/// Polls a plan and its client in turns, while time passes.
fn run(w: &World, plan: *mut mbm_plan, client: *mut mbm_client) {
    let turns = w.byte();
    // A plan has at most nine fields.
    let splitting = w.put(mbm_planSplitting {
        blocks: w.block(9 * size_of::<u16>(), 2).cast(),
        retryMs: turns.into(),
        triedAt: 0,
        readCount: 0,
        begins: 0,
        state: 0,
    });
    for _ in 0..1 + turns % 16 {
        if turns & 0x80 != 0 {
            checked!(w, mbm_plan_pollSplitting(plan, splitting));
        } else {
            checked!(w, mbm_plan_poll(plan));
        }
        let status = call!(w, mbm_client_poll(client));
        if status != OK && status != PENDING {
            break;
        }
        call!(w, mbm_plan_pollDelay(plan));
        if w.byte() < 0x80 {
            w.clock
                .set(w.clock.get().wrapping_add(1 << (w.byte() % 24)));
        }
    }
}

/// Does something with a plan.
pub fn step(w: &World) {
    let plan = w.plans.pick(w);
    let client = w.clients.pick(w);
    match w.byte() % 16 {
        0 | 1 => begin(w, plan, client),
        2..=7 => run(w, plan, client),
        8..=10 => look(w, plan),
        11 | 12 => convert(w, plan),
        13 => {
            let field = u16::from(w.byte() % 12);
            checked!(w, mbm_plan_refresh(plan, field));
        }
        14 => {
            refused!(w, mbm_plan_end(plan));
        }
        _ => {
            // The user may zero a plan outside of every call.
            if !plan.is_null() && !w.is_inside() {
                w.note(|| format!("memset({plan:?}, 0, plan)"));
                // SAFETY: nothing uses it now.
                unsafe { plan.cast::<u8>().write_bytes(0, size_of::<mbm_plan>()) };
            }
        }
    }
}
