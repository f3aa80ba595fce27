/* Decides what a device with the faults of --fault makes of a request.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef FAULT_DEVICE_H
#define FAULT_DEVICE_H

#include "fault_port.h"

/* Counts a request, and chooses the faults of its answer for the port that it came from. Returns
 * the exception that answers it, with which it is not carried out, or 0. */
uint8_t fault_device_take(fault_device *device, const mbm_request *request);

#endif
