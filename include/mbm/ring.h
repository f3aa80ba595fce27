/**
 * @file mbm/ring.h
 * @brief The rings: bytes from an interrupt or a DMA to the main loop.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_RING_H
#define MBM_RING_H

#include "base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Ring: bytes from an interrupt to the main loop ================================ */

/**
 * A receive ring between an interrupt handler and the main loop.
 *
 * The writer, which is an interrupt handler, a DMA callback or a thread, puts bytes in
 * with mbm_ring_put or mbm_ring_write. The reader, which is the main loop in the `read`
 * hook of a port, takes them out with mbm_ring_read. Each may interrupt the other at any
 * point. A ring has only one writer and only one reader at a time. The functions never
 * disable interrupts.
 */
typedef struct mbm_ring {
    uint8_t *bytes; /**< Private. */
    uint16_t size; /**< Private. */
    uint16_t positions[3]; /**< Private. */
} mbm_ring;

/**
 * Begins an empty ring over your storage. Neither writer nor reader may use the ring
 * meanwhile.
 *
 * @param bytes  your storage; it must stay valid for as long as the ring is used
 * @param size   bytes of storage, 2 to 65535, on an AVR 2 to 256. The ring holds one byte less
 */
uint8_t mbm_ring_begin(mbm_ring *ring, uint8_t *bytes, uint16_t size);

/**
 * Puts one byte in. The writer calls it, also from an interrupt.
 *
 * @param byte  the received byte
 * @return 1; 0 if the ring was full: mbm_ring_lost counts the byte
 */
uint8_t mbm_ring_put(mbm_ring *ring, uint8_t byte);

/**
 * Puts bytes in, in order. The writer calls it, also from an interrupt.
 *
 * @param bytes   the received bytes; NULL only if `length` is 0
 * @param length  the number of bytes
 * @return the number of bytes that the ring took; mbm_ring_lost counts the others
 */
uint16_t mbm_ring_write(mbm_ring *ring, const uint8_t *bytes, uint16_t length);

/**
 * Takes bytes out, in order, without waiting. The reader calls it.
 *
 * @param bytes     receives the bytes; NULL only if `capacity` is 0
 * @param capacity  the number of bytes that `bytes` can hold
 * @return the number of bytes taken out; 0 if the ring was empty
 */
uint16_t mbm_ring_read(mbm_ring *ring, uint8_t *bytes, uint16_t capacity);

/**
 * Returns how many bytes mbm_ring_read can take out now. The reader calls it.
 *
 * @return the number of bytes; 0 also if the ring was never begun
 */
uint16_t mbm_ring_available(const mbm_ring *ring);

/**
 * Returns how many bytes were lost because the ring was full, since mbm_ring_begin.
 * Writer and reader may call it.
 *
 * @return the number of bytes; it wraps at 65536, on an AVR at 256
 */
uint16_t mbm_ring_lost(const mbm_ring *ring);

/* ==== DMA ring: bytes from a DMA to the main loop =================================== */

/**
 * A receive ring that a DMA fills: it writes round and round into your storage, without end.
 *
 * The main loop takes the bytes out with mbm_dmaRing_read, in the `read` hook of a port. The
 * ring reads the position of the DMA from its counter. Call mbm_dmaRing_note in the interrupts
 * of the DMA when half of the storage is full and when all of it is. Then a main loop that came
 * too late loses bytes, but the ring counts them. Interrupt and main loop may interrupt each
 * other at any point. The functions never disable interrupts.
 */
typedef struct mbm_dmaRing {
    uint8_t *bytes; /**< Private. */
    uint16_t (*remaining)(void *context); /**< Private. */
    void *context; /**< Private. */
    uint32_t positions[5]; /**< Private. */
    uint16_t size; /**< Private. */
} mbm_dmaRing;

/**
 * Begins an empty ring over your storage. The DMA begins at its front: call this before you
 * start the DMA, or while it is stopped. Nothing may use the ring meanwhile.
 *
 * @param bytes      your storage, of which the DMA writes all, circularly; it must stay valid
 *                   for as long as the ring is used
 * @param size       bytes of storage, 2 to 65535, on an AVR 2 to 64. The ring holds one byte less
 * @param remaining  returns the counter of the DMA: how many bytes it writes until it begins
 *                   again at the front, 1 to `size`, or 0. It must not use the ring. Interrupt and
 *                   main loop call it
 * @param context    passed to `remaining`; may be NULL
 */
uint8_t mbm_dmaRing_begin(mbm_dmaRing *ring, uint8_t *bytes, uint16_t size,
                          uint16_t (*remaining)(void *context), void *context);

/**
 * Looks where the DMA is. Call it in the interrupts of the DMA for half of the storage and for
 * all of it, and in others if you like, such as that of an idle line.
 */
void mbm_dmaRing_note(mbm_dmaRing *ring);

/**
 * Takes bytes out, in order, without waiting. The reader calls it. Bytes that the DMA has
 * overwritten are skipped, and mbm_dmaRing_lost counts them.
 *
 * @param bytes     receives the bytes; NULL only if `capacity` is 0
 * @param capacity  the number of bytes that `bytes` can hold
 * @return the number of bytes taken out; 0 if the ring was empty
 */
uint16_t mbm_dmaRing_read(mbm_dmaRing *ring, uint8_t *bytes, uint16_t capacity);

/**
 * Returns how many bytes mbm_dmaRing_read can take out now. The reader calls it.
 *
 * @return the number of bytes; 0 also if the ring was never begun
 */
uint16_t mbm_dmaRing_available(const mbm_dmaRing *ring);

/**
 * Returns how many bytes the DMA has overwritten before they were taken out, since
 * mbm_dmaRing_begin. mbm_dmaRing_read notices them.
 *
 * @return the number of bytes; it wraps at 65536, on an AVR at 256
 */
uint16_t mbm_dmaRing_lost(const mbm_dmaRing *ring);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_RING_H */
