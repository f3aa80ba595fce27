//! Views of registers, `mbm_registers_*`, and packed and unpacked bits, `mbm_bits_*`.

use super::check::{refused_changes_nothing, span};
use super::world::World;
use mbm_c::*;
use std::ptr::{null, null_mut};

/// Fills in a view of a block that has exactly the size of its registers.
fn fill(w: &World, view: *mut mbm_registers) {
    let (count, first) = (w.word(), w.word());
    let odd = w.rarely(16);
    let length = (count % 0x4000) * 2 + u16::from(odd);
    let words: *mut u16 = w.null_or(64, || w.noise(2 * usize::from(count)).cast());
    let bytes = w.noise(length.into());
    match w.byte() % 5 {
        0 => drop(call!(w, mbm_registers_ofWords(view, words, count, first))),
        1 => drop(call!(w, mbm_registers_ofBytes(view, bytes, length, first))),
        2 => drop(call!(w, mbm_registers_intoWords(view, words, count, first))),
        3 => drop(call!(
            w,
            mbm_registers_intoBytes(view, bytes, length, first)
        )),
        _ if view.is_null() => {}
        _ => {
            // Written by hand. The block has `count` registers in any case.
            let (kind, order) = (w.byte() % 6, w.byte() % 10);
            let data = words.cast_const().cast();
            // SAFETY: the pointer is not NULL.
            unsafe {
                view.write(mbm_registers {
                    data,
                    first,
                    count,
                    kind,
                    order,
                })
            };
        }
    }
}

/// Reads a value. Checks that a refused call leaves it unchanged.
pub fn get<T>(w: &World, name: &str, call: impl FnOnce(*mut T) -> u8) {
    let value = w.null_or(32, || w.unset::<T>());
    refused_changes_nothing(w, &[span(value)], name, || call(value));
}

fn read(w: &World, view: *const mbm_registers) {
    let (at, order, byte) = (w.word(), w.byte() % 10, w.byte());
    macro_rules! get {
        ($name:ident, $with:expr) => {
            get(w, stringify!($name), |value| {
                call!(w, $name(view, at, $with, value))
            })
        };
    }
    let length = w.word();
    match w.byte() % 14 {
        0 => get!(mbm_registers_getBit, byte % 20),
        1 => get!(mbm_registers_getUint8, byte),
        2 => get!(mbm_registers_getInt8, byte),
        4 => {
            let with = w.null_or(32, || w.noise(length.into()));
            get(w, "mbm_registers_isEqualBytes", |equal| {
                call!(w, mbm_registers_isEqualBytes(view, at, with, length, equal))
            });
        }
        3 => get!(mbm_registers_getUint16, order),
        5 => get!(mbm_registers_getUint32, order),
        7 => get!(mbm_registers_getUint64, order),
        9 => get!(mbm_registers_getFloat, order),
        10 => get!(mbm_registers_getDouble, order),
        11 => {
            let capacity = w.word();
            let place = w.unset_bytes(capacity.into());
            let text = w.null_or(32, || place.cast());
            let spans = [(place.cast_const(), capacity.into())];
            refused!(
                w,
                &spans,
                mbm_registers_getString(view, at, length, order, text, capacity)
            );
        }
        choice => {
            let place = w.unset_bytes(length.into());
            let bytes = w.null_or(32, || place);
            let spans = [(place.cast_const(), length.into())];
            refused_changes_nothing(w, &spans, "mbm_registers_getBytes", || match choice {
                12 => call!(
                    w,
                    mbm_registers_getBytes(view, at, MBM_ORDER_ABCD, bytes, length)
                ),
                _ => call!(w, mbm_registers_getBytes(view, at, order, bytes, length)),
            });
        }
    }
}

/// The memory of a view.
pub fn memory_of(view: *const mbm_registers) -> (*const u8, usize) {
    if view.is_null() {
        return (null(), 0);
    }
    // SAFETY: the view is zeroed or filled in.
    let view = unsafe { *view };
    (view.data.cast(), 2 * usize::from(view.count))
}

fn write(w: &World, view: *const mbm_registers) {
    let (at, order, byte, word, long) = (w.word(), w.byte() % 10, w.byte(), w.word(), w.long());
    let length = w.word();
    let null = w.rarely(32);
    macro_rules! value {
        ($value:expr) => {
            if null { null_mut() } else { w.put($value) }.cast_const()
        };
    }
    let wide = u64::from(long) << 20;
    let text = |length: u16| {
        let length = usize::from(length);
        let text = w.noise(length + 1);
        for at in 0..length {
            // SAFETY: the index is before the NUL.
            unsafe { *text.add(at) |= 1 };
        }
        // SAFETY: the index is that of the last byte.
        unsafe { *text.add(length) = 0 };
        if null {
            null_mut()
        } else {
            text
        }
    };
    let choice = w.byte() % 14;
    refused_changes_nothing(w, &[memory_of(view)], "a setter", || match choice {
        0 => call!(w, mbm_registers_setBit(view, at, byte % 20, byte & 1)),
        1 => call!(w, mbm_registers_setUint8(view, at, byte & 1, byte)),
        2 => call!(
            w,
            mbm_registers_setInt8(view, at, byte & 1, byte.cast_signed())
        ),
        3 => call!(w, mbm_registers_setUint16(view, at, order, word)),
        4 => call!(w, mbm_registers_setUint16(view, at, order, word)),
        5 => call!(w, mbm_registers_setUint32(view, at, order, long)),
        6 => call!(w, mbm_registers_setUint32(view, at, order, long)),
        7 => call!(w, mbm_registers_setUint64(view, at, order, value!(wide))),
        8 => call!(w, mbm_registers_setUint64(view, at, order, value!(wide))),
        9 => call!(
            w,
            mbm_registers_setFloat(view, at, order, value!(long as f32))
        ),
        10 => call!(
            w,
            mbm_registers_setDouble(view, at, order, value!(wide as f64))
        ),
        11 => {
            let text = text(w.word()).cast_const().cast();
            call!(w, mbm_registers_setString(view, at, length, order, text))
        }
        choice => {
            let bytes = if null {
                null_mut()
            } else {
                w.noise(length.into())
            }
            .cast_const();
            if choice == 12 {
                call!(
                    w,
                    mbm_registers_setBytes(view, at, MBM_ORDER_ABCD, bytes, length)
                )
            } else {
                call!(w, mbm_registers_setBytes(view, at, order, bytes, length))
            }
        }
    });
}

/// Makes one call with a view.
pub fn step(w: &World) {
    let view = w.views.pick(w);
    match w.byte() % 8 {
        0 | 1 => fill(w, view),
        2 => {
            let order = w.byte() % 10;
            refused!(w, &[span(view)], mbm_registers_setByteOrder(view, order));
        }
        3..=5 => read(w, view),
        _ => write(w, view),
    }
}

/// Makes one call with bits.
pub fn step_of_bits(w: &World) {
    let (quantity, length, first, at) = (w.word(), w.word(), w.word(), w.word());
    let coils = w.null_or(32, || w.unset_bytes(quantity.into()));
    let null = w.rarely(32);
    let bytes = if null {
        null_mut()
    } else {
        w.unset_bytes(length.into())
    };
    let held = usize::from(quantity).div_ceil(8);
    let bits = if null {
        null_mut()
    } else {
        w.unset_bytes(held)
    };
    let more: *mut u16 = if null {
        null_mut()
    } else {
        w.unset_bytes(2 * usize::from(quantity).div_ceil(16)).cast()
    };
    let on = w.null_or(32, || w.unset::<u8>());
    let choice = w.byte() % 6;
    let size = |null: bool, size: usize| if null { 0 } else { size };
    let spans = [
        (coils.cast_const(), size(coils.is_null(), quantity.into())),
        (bytes.cast_const(), size(null, length.into())),
        (bits.cast_const(), size(null, held)),
        span(on),
    ];
    refused_changes_nothing(w, &spans, "bits", || match choice {
        0 => call!(w, mbm_bits_pack(coils, quantity, bytes, length)),
        1 => call!(w, mbm_bits_unpack(bytes, length, coils, quantity)),
        2 => call!(w, mbm_bits_isSet(bits, first, quantity, at, on)),
        3 => call!(w, mbm_bits_set(bits, first, quantity, at, 1)),
        4 => call!(w, mbm_bits_isSetInWords(more, first, quantity, at, on)),
        _ => call!(w, mbm_bits_setInWords(more, first, quantity, at, 0)),
    });
}
