//! `mbm_dmaRing_*`: the receive ring that a DMA fills, for C.

use core::ffi::c_void;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use core::sync::atomic::AtomicU8;
use mbm::dma_ring::{DmaRing, Positions, MAX_STORAGE};
use mbm::error::Status;

/// A receive ring that a DMA fills: it writes round and round into your storage, without end.
///
/// The main loop takes the bytes out with mbm_dmaRing_read, in the `read` hook of a port. The
/// ring reads the position of the DMA from its counter. Call mbm_dmaRing_note in the interrupts
/// of the DMA when half of the storage is full and when all of it is. Then a main loop that came
/// too late loses bytes, but the ring counts them. Interrupt and main loop may interrupt each
/// other at any point. The functions never disable interrupts.
#[repr(C)]
pub struct mbm_dmaRing {
    /// Private.
    bytes: *mut u8,
    /// Private.
    remaining: Option<unsafe extern "C" fn(context: *mut c_void) -> u16>,
    /// Private.
    context: *mut c_void,
    /// Private.
    positions: [u32; 5],
    /// Private.
    size: u16,
}

const _: () = {
    assert!(size_of::<Positions>() <= size_of::<[u32; 5]>());
    assert!(align_of::<Positions>() <= align_of::<mbm_dmaRing>());
    assert!(size_of::<AtomicU8>() == 1);
};

/// The ring at a pointer from C, if it was begun.
unsafe fn ring<'a>(ring: *const mbm_dmaRing) -> Option<DmaRing<'a, impl Fn() -> u16>> {
    if ring.is_null() {
        return None;
    }
    // SAFETY: only begin writes these, which nothing else may overlap.
    let (bytes, size, context) = unsafe { ((*ring).bytes, (*ring).size, (*ring).context) };
    // SAFETY: as above.
    let remaining = unsafe { (*ring).remaining }?;
    // SAFETY: mbm_dmaRing_begin demands that `size` bytes are valid for as long as the ring is
    // used. DMA, interrupt and reader use the bytes and the positions as atomics only.
    unsafe {
        let bytes = from_raw_parts(bytes.cast::<AtomicU8>(), size.into());
        let positions = &*(&raw const (*ring).positions).cast::<Positions>();
        // `remaining` is the C program's function for this context.
        let remaining = move || remaining(context);
        Some(DmaRing::new(bytes, positions, remaining))
    }
}

/// Begins an empty ring over your storage. The DMA begins at its front: call this before you
/// start the DMA, or while it is stopped. Nothing may use the ring meanwhile.
///
/// @param bytes      your storage, of which the DMA writes all, circularly; it must stay valid
///                   for as long as the ring is used
/// @param size       bytes of storage, 2 to 65535, on an AVR 2 to 64. The ring holds one byte less
/// @param remaining  returns the counter of the DMA: how many bytes it writes until it begins
///                   again at the front, 1 to `size`, or 0. It must not use the ring. Interrupt and
///                   main loop call it
/// @param context    passed to `remaining`; may be NULL
#[no_mangle]
pub unsafe extern "C" fn mbm_dmaRing_begin(
    ring: *mut mbm_dmaRing,
    bytes: *mut u8,
    size: u16,
    remaining: Option<unsafe extern "C" fn(context: *mut c_void) -> u16>,
    context: *mut c_void,
) -> u8 {
    if ring.is_null()
        || bytes.is_null()
        || remaining.is_none()
        || size < 2
        || usize::from(size) > MAX_STORAGE
    {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL, so storage of a ring, which nothing else uses meanwhile.
    unsafe {
        ring.write(mbm_dmaRing {
            bytes,
            remaining,
            context,
            positions: [0; 5],
            size,
        });
    }
    Status::OK.code()
}

/// Looks where the DMA is. Call it in the interrupts of the DMA for half of the storage and for
/// all of it, and in others if you like, such as that of an idle line.
#[no_mangle]
pub unsafe extern "C" fn mbm_dmaRing_note(ring: *mut mbm_dmaRing) {
    if let Some(ring) = self::ring(ring) {
        ring.note();
    }
}

/// Takes bytes out, in order, without waiting. The reader calls it. Bytes that the DMA has
/// overwritten are skipped, and mbm_dmaRing_lost counts them.
///
/// @param bytes     receives the bytes; NULL only if `capacity` is 0
/// @param capacity  the number of bytes that `bytes` can hold
/// @return the number of bytes taken out; 0 if the ring was empty
#[no_mangle]
pub unsafe extern "C" fn mbm_dmaRing_read(
    ring: *mut mbm_dmaRing,
    bytes: *mut u8,
    capacity: u16,
) -> u16 {
    if bytes.is_null() {
        return 0;
    }
    match self::ring(ring) {
        Some(ring) => ring.read(from_raw_parts_mut(bytes, capacity.into())),
        None => 0,
    }
}

/// Returns how many bytes mbm_dmaRing_read can take out now. The reader calls it.
///
/// @return the number of bytes; 0 also if the ring was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_dmaRing_available(ring: *const mbm_dmaRing) -> u16 {
    self::ring(ring).map_or(0, |ring| ring.available())
}

/// Returns how many bytes the DMA has overwritten before they were taken out, since
/// mbm_dmaRing_begin. mbm_dmaRing_read notices them.
///
/// @return the number of bytes; it wraps at 65536, on an AVR at 256
#[no_mangle]
pub unsafe extern "C" fn mbm_dmaRing_lost(ring: *const mbm_dmaRing) -> u16 {
    self::ring(ring).map_or(0, |ring| ring.lost())
}
