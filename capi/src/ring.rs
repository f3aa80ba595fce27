//! `mbm_ring_*`: the receive ring for C.

use core::slice::{from_raw_parts, from_raw_parts_mut};
use core::sync::atomic::AtomicU8;
use mbm::error::Status;
use mbm::ring::{Place, Positions, Ring, MAX_STORAGE};

/// A receive ring between an interrupt handler and the main loop.
///
/// The writer, which is an interrupt handler, a DMA callback or a thread, puts bytes in
/// with mbm_ring_put or mbm_ring_write. The reader, which is the main loop in the `read`
/// hook of a port, takes them out with mbm_ring_read. Each may interrupt the other at any
/// point. A ring has only one writer and only one reader at a time. The functions never
/// disable interrupts.
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

/// The ring at a pointer from C, if it was begun.
unsafe fn ring<'a>(ring: *const mbm_ring) -> Option<Ring<'a>> {
    if ring.is_null() {
        return None;
    }
    // SAFETY: only begin writes these two, which nothing else may overlap.
    let (bytes, size) = unsafe { ((*ring).bytes, (*ring).size) };
    if bytes.is_null() {
        return None;
    }
    // SAFETY: mbm_ring_begin demands that `size` bytes are valid for as long as the ring is
    // used. Writer and reader use the bytes and the positions as atomics only.
    unsafe {
        let bytes = from_raw_parts(bytes.cast::<AtomicU8>(), size.into());
        let positions = &*(&raw const (*ring).positions).cast::<Positions>();
        Some(Ring::new(bytes, positions))
    }
}

/// Begins an empty ring over your storage. Neither writer nor reader may use the ring
/// meanwhile.
///
/// @param bytes  your storage; it must stay valid for as long as the ring is used
/// @param size   bytes of storage, 2 to 65535, on an AVR 2 to 256. The ring holds one byte less
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_begin(ring: *mut mbm_ring, bytes: *mut u8, size: u16) -> u8 {
    if ring.is_null() || bytes.is_null() || size < 2 || usize::from(size) > MAX_STORAGE {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL, so storage of a ring, which nothing else uses meanwhile.
    unsafe {
        ring.write(mbm_ring {
            bytes,
            size,
            positions: [0; 3],
        });
    }
    Status::OK.code()
}

/// Puts one byte in. The writer calls it, also from an interrupt.
///
/// @param byte  the received byte
/// @return 1; 0 if the ring was full: mbm_ring_lost counts the byte
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_put(ring: *mut mbm_ring, byte: u8) -> u8 {
    match self::ring(ring) {
        Some(ring) => ring.put(byte).into(),
        None => 0,
    }
}

/// Puts bytes in, in order. The writer calls it, also from an interrupt.
///
/// @param bytes   the received bytes; NULL only if `length` is 0
/// @param length  the number of bytes
/// @return the number of bytes that the ring took; mbm_ring_lost counts the others
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_write(ring: *mut mbm_ring, bytes: *const u8, length: u16) -> u16 {
    if bytes.is_null() {
        return 0;
    }
    match self::ring(ring) {
        Some(ring) => ring.write(from_raw_parts(bytes, length.into())),
        None => 0,
    }
}

/// Takes bytes out, in order, without waiting. The reader calls it.
///
/// @param bytes     receives the bytes; NULL only if `capacity` is 0
/// @param capacity  the number of bytes that `bytes` can hold
/// @return the number of bytes taken out; 0 if the ring was empty
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_read(ring: *mut mbm_ring, bytes: *mut u8, capacity: u16) -> u16 {
    if bytes.is_null() {
        return 0;
    }
    match self::ring(ring) {
        Some(ring) => ring.read(from_raw_parts_mut(bytes, capacity.into())),
        None => 0,
    }
}

/// Returns how many bytes mbm_ring_read can take out now. The reader calls it.
///
/// @return the number of bytes; 0 also if the ring was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_available(ring: *const mbm_ring) -> u16 {
    self::ring(ring).map_or(0, |ring| ring.available())
}

/// Returns how many bytes were lost because the ring was full, since mbm_ring_begin.
/// Writer and reader may call it.
///
/// @return the number of bytes; it wraps at 65536, on an AVR at 256
#[no_mangle]
pub unsafe extern "C" fn mbm_ring_lost(ring: *const mbm_ring) -> u16 {
    self::ring(ring).map_or(0, |ring| ring.lost())
}
