/**
 * @file recorder.h
 * @brief A port that passes everything on to another port and records the bytes.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef RECORDER_H
#define RECORDER_H

#include "mbm.h"

#include <stddef.h>

/** Bytes of one direction. Bytes beyond the capacity are not kept. */
typedef struct recording {
    uint8_t bytes[MBM_MAX_FRAME];
    size_t length;
} recording;

/** The other port, and the bytes that have gone through it. */
typedef struct recorder {
    mbm_port line;
    recording sent;
    recording received;
} recorder;

/** Discards the recorded bytes. */
void recorder_clear(recorder *wire);

/** A port that records in `wire`, which must outlive it, and forwards every call to `line`. */
mbm_port recorder_port(recorder *wire, const mbm_port *line);

#endif
