//! Rings, `mbm_ring_*`. One thread uses both sides; `tests/ring_orders.rs` tries two threads.

use super::check::{call, refused_changes_nothing, span};
use super::world::World;
use std::ptr::null_mut;

/// Makes one call with a ring, or a few that belong together.
pub fn step(w: &World) {
    let ring = w.rings.pick(w);
    let count = w.word();
    let bytes = if w.rarely(64) {
        null_mut()
    } else {
        w.noise(count.into())
    };
    match w.byte() % 8 {
        0 => {
            let bytes = w.buffer(count.into());
            refused_changes_nothing(w, &[span(ring)], "mbm_ring_begin", || {
                call!(w, ring, mbm_ring_begin(ring, bytes, count))
            });
        }
        1 => {
            let byte = w.byte();
            assert!(call!(w, ring, mbm_ring_put(ring, byte)) <= 1);
        }
        2 | 3 => assert!(call!(w, ring, mbm_ring_write(ring, bytes, count)) <= count),
        4 | 5 => assert!(call!(w, ring, mbm_ring_read(ring, bytes, count)) <= count),
        _ => {
            let available = call!(w, ring, mbm_ring_available(ring));
            let all = w.unset_bytes(available.into());
            assert_eq!(
                call!(w, ring, mbm_ring_read(ring, all, available)),
                available
            );
            assert_eq!(call!(w, ring, mbm_ring_available(ring)), 0);
            call!(w, ring, mbm_ring_lost(ring));
        }
    }
}
