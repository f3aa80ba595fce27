//! Packed and unpacked bits.

use super::check::{refused_changes_nothing, span};
use super::world::World;
use std::ptr::null_mut;

/// Makes one call with bits.
pub fn step(w: &World) {
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
