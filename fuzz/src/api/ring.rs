//! Rings, `mbm_ring_*` and `mbm_dmaRing_*`. One thread uses both sides; `tests/ring_orders.rs` tries two threads.

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

/// The counter of a DMA that jumps about, as one of a DMA that is stopped and started may.
unsafe extern "C" fn remaining(_: *mut std::ffi::c_void) -> u16 {
    World::current().word()
}

/// Makes one call with a ring that a DMA fills.
pub fn step_of_dma(w: &World) {
    let ring = w.dma_rings.pick(w);
    let count = w.word();
    match w.byte() % 4 {
        0 => {
            let bytes = w.buffer(count.into());
            let remaining = (w.byte() != 0).then_some(remaining as _);
            let context = std::ptr::null_mut();
            refused!(w, mbm_dmaRing_begin(ring, bytes, count, remaining, context));
        }
        1 => call!(w, mbm_dmaRing_note(ring)),
        2 => {
            let bytes = w.null_or(64, || w.noise(count.into()));
            assert!(call!(w, mbm_dmaRing_read(ring, bytes, count)) <= count);
        }
        _ => {
            call!(w, mbm_dmaRing_available(ring));
            call!(w, mbm_dmaRing_lost(ring));
        }
    }
}
