//! `mbm_ring_*`: the receive ring for C.

use core::slice::{from_raw_parts, from_raw_parts_mut};
use core::sync::atomic::AtomicU8;
use mbm::error::Status;
use mbm::ring::{Place, Positions, Ring, MAX_STORAGE};

/// A receive ring between an interrupt handler and the main loop.
///
/// One side puts bytes in with mbm_ring_put or mbm_ring_write: an interrupt
/// handler, a DMA callback or a thread. One side takes them out with
/// mbm_ring_read: the main loop, as the `read` hook of a port. Each may
/// interrupt the other at any point; neither may be two at once. No interrupt
/// is ever disabled.
#[repr(C)]
pub struct mbm_ring {
    /// Private.
    bytes: *mut u8,
    /// Private.
    size: u16,
    /// Private.
    positions: [u16; 3],
}

const _: () = {
    assert!(size_of::<Positions>() == 3 * size_of::<Place>());
    assert!(align_of::<Positions>() <= align_of::<mbm_ring>());
    assert!(size_of::<Positions>() <= size_of::<[u16; 3]>());
    assert!(size_of::<AtomicU8>() == 1);
};

/// The ring behind a pointer, if it was begun.
///
/// # Safety
/// `ring` is NULL or points to an `mbm_ring`, zeroed or begun.
unsafe fn ring<'a>(ring: *const mbm_ring) -> Option<Ring<'a>> {
    if ring.is_null() {
        return None;
    }
    // SAFETY: only begin writes these two, which nothing else may overlap.
    let (bytes, size) = unsafe { ((*ring).bytes, (*ring).size) };
    if bytes.is_null() {
        return None;
    }
    // SAFETY: begin demands that so many bytes are valid as long as the ring is
    // used; both sides reach them, and the positions, as atomics only.
    unsafe {
        let bytes = from_raw_parts(bytes.cast::<AtomicU8>(), size.into());
        let positions = &*(&raw const (*ring).positions).cast::<Positions>();
        Some(Ring::new(bytes, positions))
    }
}

/// Makes a ring of your bytes, empty. Neither side may use it meanwhile.
///
/// @param ring   the object
/// @param bytes  storage, yours, valid for as long as the ring is used
/// @param size   2 to 65535, on an AVR 2 to 256; the ring holds one byte less
/// @return MBM_OK or MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_begin(ring: *mut mbm_ring, bytes: *mut u8, size: u16) -> u8 {
    if ring.is_null() || bytes.is_null() || size < 2 || usize::from(size) > MAX_STORAGE {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL, so storage of a ring, which nobody uses meanwhile.
    unsafe {
        ring.write(mbm_ring {
            bytes,
            size,
            positions: [0; 3],
        });
    }
    Status::OK.code()
}

/// Puts a byte in. An interrupt may call it.
///
/// @param ring  the object
/// @param byte  the byte received
/// @return 1, or 0 if there was no room: the byte counts as lost
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_put(ring: *mut mbm_ring, byte: u8) -> u8 {
    // SAFETY: as the header demands.
    match unsafe { self::ring(ring) } {
        Some(ring) => ring.put(byte).into(),
        None => 0,
    }
}

/// Puts bytes in, in order. An interrupt may call it.
///
/// @param ring    the object
/// @param bytes   the bytes received; NULL only with length 0
/// @param length  how many
/// @return how many found room; the others count as lost
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_write(ring: *mut mbm_ring, bytes: *const u8, length: u16) -> u16 {
    if bytes.is_null() {
        return 0;
    }
    // SAFETY: as the header demands; so many bytes are valid.
    match unsafe { self::ring(ring) } {
        Some(ring) => ring.write(unsafe { from_raw_parts(bytes, length.into()) }),
        None => 0,
    }
}

/// Takes bytes out, in order, without waiting.
///
/// @param ring      the object
/// @param bytes     where they go; NULL only with capacity 0
/// @param capacity  at most so many
/// @return how many there were
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_read(ring: *mut mbm_ring, bytes: *mut u8, capacity: u16) -> u16 {
    if bytes.is_null() {
        return 0;
    }
    // SAFETY: as the header demands; so many bytes are valid.
    match unsafe { self::ring(ring) } {
        Some(ring) => ring.read(unsafe { from_raw_parts_mut(bytes, capacity.into()) }),
        None => 0,
    }
}

/// How many bytes there are to take out, for the side that takes.
///
/// @param ring  the object
/// @return bytes; 0 also if the ring was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_available(ring: *const mbm_ring) -> u16 {
    // SAFETY: as the header demands.
    unsafe { self::ring(ring) }.map_or(0, |ring| ring.available())
}

/// Forgets what there is to take out, for the side that takes.
///
/// @param ring  the object
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_clear(ring: *mut mbm_ring) {
    // SAFETY: as the header demands.
    if let Some(ring) = unsafe { self::ring(ring) } {
        ring.clear();
    }
}

/// How many bytes found no room since begin; either side may ask.
///
/// @param ring  the object
/// @return bytes; wraps at 65536, on an AVR at 256
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_lost(ring: *const mbm_ring) -> u16 {
    // SAFETY: as the header demands.
    unsafe { self::ring(ring) }.map_or(0, |ring| ring.lost())
}
