//! Rings, `mbm_ring_*`. One thread uses both sides; `tests/ring_orders.rs` tries two threads.

use super::world::World;

/// Makes one call with a ring, or a few that belong together.
pub fn step(w: &World) {
    let ring = w.rings.pick(w);
    let count = w.word();
    let bytes = w.null_or(64, || w.noise(count.into()));
    match w.byte() % 8 {
        0 => {
            let bytes = w.buffer(count.into());
            refused!(w, mbm_ring_begin(ring, bytes, count));
        }
        1 => {
            let byte = w.byte();
            assert!(call!(w, mbm_ring_put(ring, byte)) <= 1);
        }
        2 | 3 => assert!(call!(w, mbm_ring_write(ring, bytes, count)) <= count),
        4 | 5 => assert!(call!(w, mbm_ring_read(ring, bytes, count)) <= count),
        _ => {
            let available = call!(w, mbm_ring_available(ring));
            let all = w.unset_bytes(available.into());
            assert_eq!(call!(w, mbm_ring_read(ring, all, available)), available);
            assert_eq!(call!(w, mbm_ring_available(ring)), 0);
            call!(w, mbm_ring_lost(ring));
        }
    }
}
