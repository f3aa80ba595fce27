/**
 * @file mbm.h
 * @brief A Modbus stack for firmware.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit.
 *
 * Rules of every function:
 * - A function that succeeds returns MBM_OK, unless its comment says otherwise. Every function
 *   returns MBM_INVALID_ARGUMENT for NULL, a number out of the range in its comment, an
 *   incomplete port, a buffer that is too short and an object of another framing;
 *   MBM_NOT_INITIALISED for an object that was never begun; MBM_BUSY if a hook calls it on the
 *   object that calls the hook (see mbm_port). A comment names only the statuses besides these.
 * - A parameter that its comment leaves out is the object of its type, or is explained at the
 *   function to which the comment refers. A result that it leaves out is a status.
 * - A call that is refused changes nothing, unless the comment says otherwise.
 * - A pointer is NULL or valid. For NULL a function never crashes. Data that a function only
 *   reads may be NULL if their length is 0.
 * - Objects are your storage. Initialise each object and each struct with MBM_INIT where you
 *   declare it. The library uses no heap and no global variables.
 * - No function is re-entrant on one object. Call no function from an interrupt unless its
 *   comment allows it. You may use any number of objects side by side, each from one thread.
 * - You may call a begin function again at any time, but not from a hook of the object. The
 *   object then gives up what was pending; requests get the status MBM_CANCELLED. Only a line
 *   and a node refuse it with MBM_BUSY while a request is pending.
 *
 * A unit id and a time that you pass have a wider type than they need, so that a number that is
 * too large is refused and not narrowed. Other numbers, such as retries, the length of an array,
 * addresses and quantities, have the type that they need, which costs less flash: C reduces a
 * larger one modulo 256 or 65536 before the library sees it. So it does with `unit` of the
 * mbm_node functions. -Wconversion shows where.
 *
 * "V1.1b3" is the Modbus application protocol specification, "serial line guide V1.02" the
 * guide for RTU and ASCII.
 *
 * Contents. A program may include the parts that it needs instead:
 *   mbm/base.h       What every other part needs: version, statuses, your port, limits.
 *   mbm/functions.h  Function codes, their lengths, and framings.
 *   mbm/master.h     The master: RTU, one request at a time.
 *   mbm/client.h     The client: many requests, every framing, never waits.
 *   mbm/plan.h       A plan: the values that a client reads again and again.
 *   mbm/link.h       A link: keeps the connection of a client open.
 *   mbm/server.h     The server, and the data of the units that it serves.
 *   mbm/gateway.h    The gateway: from Modbus TCP to the lines of clients.
 *   mbm/values.h     Values: registers and bits as numbers and texts.
 *   mbm/packets.h    Packets: requests and responses, built and parsed by hand.
 *   mbm/sniffer.h    The sniffer: decodes the traffic between other devices.
 *   mbm/trace.h      The trace: calls your hook for each frame sent and received.
 *   mbm/ring.h       The rings: bytes from an interrupt or a DMA to the main loop.
 */

#ifndef MBM_H
#define MBM_H

#include "mbm/base.h"
#include "mbm/functions.h"
#include "mbm/master.h"
#include "mbm/client.h"
#include "mbm/plan.h"
#include "mbm/link.h"
#include "mbm/server.h"
#include "mbm/gateway.h"
#include "mbm/values.h"
#include "mbm/packets.h"
#include "mbm/sniffer.h"
#include "mbm/trace.h"
#include "mbm/ring.h"

#endif  /* MBM_H */
