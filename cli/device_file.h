/* The device file: the fields of a device, as mbm poll, mbm serve, mbm bridge and mbm header read
 * them.
 *
 *     device: SDM120
 *     unit: 1
 *     fields:
 *       - name: voltage
 *         table: input
 *         address: 0
 *         type: float
 *
 * docs/device-file.md describes every key. */
#pragma once

#include "device.h"
#include "yaml_file.h"

/* Reads a file. Returns CODE_DONE; device_free frees the device. Otherwise returns CODE_SYSTEM or
 * CODE_WRONG, and sets `wrong` to a sentence without its full stop: "meter.yaml:12: ...". */
int device_file_read(device *into, const char *path, char wrong[YAML_FILE_WRONG_BYTES]);
