/**
 * @file ModbusMasterConstants.h
 * @brief The constants of ModbusMaster.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_CONSTANTS_H
#define MODBUSMASTER_CONSTANTS_H

#include <stdint.h>

#include "mbm.h"

/**
 * The constants of ModbusMaster; use them as ModbusMaster::ku8MBSuccess. A
 * template, since C++11 gives only a template's statics a home in a header.
 */
template <typename Unused> class ModbusMasterStatics {
public:
    /** Exception 01: the device does not know the function. */
    static const uint8_t ku8MBIllegalFunction = MBM_ILLEGAL_FUNCTION;
    /** Exception 02: the device has no such address. */
    static const uint8_t ku8MBIllegalDataAddress = MBM_ILLEGAL_DATA_ADDRESS;
    /** Exception 03: the device refuses the quantity or value. */
    static const uint8_t ku8MBIllegalDataValue = MBM_ILLEGAL_DATA_VALUE;
    /** Exception 04: the device failed. */
    static const uint8_t ku8MBSlaveDeviceFailure = MBM_SLAVE_DEVICE_FAILURE;
    /** The call succeeded. */
    static const uint8_t ku8MBSuccess = MBM_OK;
    /** Only other units answered. */
    static const uint8_t ku8MBInvalidSlaveID = MBM_INVALID_SLAVE_ID;
    /** The unit answered another function. */
    static const uint8_t ku8MBInvalidFunction = MBM_INVALID_FUNCTION;
    /** No complete reply within the response timeout. */
    static const uint8_t ku8MBResponseTimedOut = MBM_RESPONSE_TIMED_OUT;
    /** The reply arrived damaged. */
    static const uint8_t ku8MBInvalidCRC = MBM_INVALID_CRC;
    /** The reply does not answer the request. */
    static const uint8_t ku8MBMalformedReply = MBM_MALFORMED_REPLY;
    /** A request of this object is under way; nothing was changed. */
    static const uint8_t ku8MBBusy = MBM_BUSY;
    /** A function that reads cannot be broadcast; nothing was sent. */
    static const uint8_t ku8MBBroadcastNotAllowed = MBM_BROADCAST_NOT_ALLOWED;
    /** The buffers cannot hold the request or its reply. */
    static const uint8_t ku8MBBufferTooSmall = MBM_BUFFER_TOO_SMALL;
    /** begin was not called yet. */
    static const uint8_t ku8MBNotInitialised = MBM_NOT_INITIALISED;
    /** The request is under way: call poll again. */
    static const uint8_t ku8MBPending = MBM_PENDING;
    /** The line never fell silent, or the port took no bytes. */
    static const uint8_t ku8MBLineBusy = MBM_LINE_BUSY;
    /** The request was given up by cancel or begin. */
    static const uint8_t ku8MBCancelled = MBM_CANCELLED;
};

/** @cond the homes of what is declared above */
#define MODBUSMASTER_HOME(name) \
    template <typename Unused> const uint8_t ModbusMasterStatics<Unused>::name
MODBUSMASTER_HOME(ku8MBIllegalFunction);
MODBUSMASTER_HOME(ku8MBIllegalDataAddress);
MODBUSMASTER_HOME(ku8MBIllegalDataValue);
MODBUSMASTER_HOME(ku8MBSlaveDeviceFailure);
MODBUSMASTER_HOME(ku8MBSuccess);
MODBUSMASTER_HOME(ku8MBInvalidSlaveID);
MODBUSMASTER_HOME(ku8MBInvalidFunction);
MODBUSMASTER_HOME(ku8MBResponseTimedOut);
MODBUSMASTER_HOME(ku8MBInvalidCRC);
MODBUSMASTER_HOME(ku8MBMalformedReply);
MODBUSMASTER_HOME(ku8MBBusy);
MODBUSMASTER_HOME(ku8MBBroadcastNotAllowed);
MODBUSMASTER_HOME(ku8MBBufferTooSmall);
MODBUSMASTER_HOME(ku8MBNotInitialised);
MODBUSMASTER_HOME(ku8MBPending);
MODBUSMASTER_HOME(ku8MBLineBusy);
MODBUSMASTER_HOME(ku8MBCancelled);
#undef MODBUSMASTER_HOME
/** @endcond */

#endif
