//! Numbers, texts and dates of other forms in views, `mbm_registers_*`, and `mbm_date_*`.

use super::check::{refused_changes_nothing, span};
use super::registers::{get, memory_of};
use super::world::World;
use mbm_c::*;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

/// Layouts of dates, right and wrong.
const LAYOUTS: [&CStr; 8] = [
    c"Y M D h m s",
    c"yM Dh ms",
    c"MD nh ms f",
    c"Cy MD -h",
    c"hm",
    c"",
    c"Y  M",
    c"Y M D h m s q",
];

fn any_date(w: &World) -> mbm_date {
    let moment = w.long();
    mbm_date {
        year: w.word() % 10_001,
        millisecond: w.word() % 1001,
        month: (moment % 14) as u8,
        day: (moment >> 4) as u8 % 33,
        hour: (moment >> 9) as u8 % 25,
        minute: (moment >> 14) as u8 % 61,
        second: (moment >> 20) as u8 % 61,
        flags: w.byte() % 4,
    }
}

fn any_layout(w: &World) -> *const core::ffi::c_char {
    match LAYOUTS.get(usize::from(w.byte() % 9)) {
        Some(layout) => layout.as_ptr(),
        None => null(),
    }
}

fn read(w: &World, view: *const mbm_registers) {
    let (at, order, count) = (w.word(), w.byte() % 10, w.word() % 6);
    let (first, bits, form) = (w.byte(), w.byte() % 70, w.byte() % 9);
    let layout = any_layout(w);
    macro_rules! get {
        ($name:ident, $($with:expr),*) => {
            get(w, stringify!($name), |value| {
                call!(w, $name(view, at, $($with,)* value))
            })
        };
    }
    match w.byte() % 13 {
        0 => get!(mbm_registers_getBcd, count, order),
        1 => get!(mbm_registers_getM10k, count, order),
        2 => get!(mbm_registers_getSignedM10k, count, order),
        3 => get!(mbm_registers_getUint24, order),
        4 => get!(mbm_registers_getInt24, order),
        5 => get!(mbm_registers_getUint48, order),
        6 => get!(mbm_registers_getInt48, order),
        7 => get!(mbm_registers_getSignMagnitude, count, order),
        8 => get!(mbm_registers_getHalf, order),
        9 => get!(mbm_registers_getBits, count, order, first % 66, bits),
        10 => get!(mbm_registers_getDate, order, layout, first & 1),
        11 => get!(mbm_registers_getIecDate, count, order),
        _ => {
            let (length, capacity) = (w.word(), w.word());
            let place = w.unset_bytes(capacity.into());
            let text = w.null_or(32, || place.cast());
            let spans = [(place.cast_const(), capacity.into())];
            refused!(
                w,
                &spans,
                mbm_registers_getText(view, at, length, order, form, text, capacity)
            );
        }
    }
}

fn write(w: &World, view: *const mbm_registers) {
    let (at, order, count, long) = (w.word(), w.byte() % 10, w.word() % 6, w.long());
    let (first, bits, form) = (w.byte(), w.byte() % 70, w.byte() % 9);
    let is_null = w.rarely(32);
    macro_rules! value {
        ($value:expr) => {
            if is_null { null_mut() } else { w.put($value) }.cast_const()
        };
    }
    let wide = u64::from(long) << (first % 33);
    let (signed, short) = (wide.cast_signed(), long.cast_signed());
    let (layout, date, length) = (any_layout(w), any_date(w), w.word() % 12);
    let choice = w.byte() % 13;
    refused_changes_nothing(w, &[memory_of(view)], "a setter", || match choice {
        0 => call!(w, mbm_registers_setBcd(view, at, count, order, long)),
        1 => call!(
            w,
            mbm_registers_setM10k(view, at, count, order, value!(wide))
        ),
        2 => call!(
            w,
            mbm_registers_setSignedM10k(view, at, count, order, value!(signed))
        ),
        3 => call!(w, mbm_registers_setUint24(view, at, order, long >> 7)),
        4 => call!(w, mbm_registers_setInt24(view, at, order, short >> 7)),
        5 => call!(w, mbm_registers_setUint48(view, at, order, value!(wide))),
        6 => call!(w, mbm_registers_setInt48(view, at, order, value!(signed))),
        7 => call!(
            w,
            mbm_registers_setSignMagnitude(view, at, count, order, short)
        ),
        8 => call!(
            w,
            mbm_registers_setHalf(view, at, order, value!(f32::from_bits(long)))
        ),
        9 => call!(
            w,
            mbm_registers_setBits(view, at, count, order, first % 66, bits, value!(wide >> 24))
        ),
        10 => call!(
            w,
            mbm_registers_setDate(view, at, order, layout, form & 1, value!(date))
        ),
        11 => call!(
            w,
            mbm_registers_setIecDate(view, at, count, order, value!(date))
        ),
        _ => {
            let text = if is_null { null() } else { c"a text ".as_ptr() };
            call!(
                w,
                mbm_registers_setText(view, at, length, order, form, text)
            )
        }
    });
}

fn seconds(w: &World) {
    let date = w.null_or(32, || w.put(any_date(w)));
    let number = i64::from(w.long().cast_signed()) << (w.byte() % 12);
    let seconds = w.null_or(32, || w.put(number));
    if w.byte().is_multiple_of(2) {
        refused_changes_nothing(w, &[span(seconds)], "mbm_date_getSeconds", || {
            call!(w, mbm_date_getSeconds(date, seconds))
        });
    } else {
        refused_changes_nothing(w, &[span(date)], "mbm_date_setSeconds", || {
            call!(w, mbm_date_setSeconds(date, seconds))
        });
    }
}

/// Makes one call.
pub fn step(w: &World) {
    let view = w.views.pick(w);
    match w.byte() % 8 {
        0 => seconds(w),
        1..=4 => read(w, view),
        _ => write(w, view),
    }
}
