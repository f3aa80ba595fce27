/**
 * @file ModbusMasterConstants.h
 * @brief The constants of ModbusMaster.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_CONSTANTS_H
#define MODBUSMASTER_CONSTANTS_H

#include <stdint.h>

#include "mbm/base.h"

/**
 * The constants of ModbusMaster; use them as ModbusMaster::ku8MBSuccess. It is
 * a template, because in C++11 only a template's static members can be defined in a header.
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
    static const uint8_t ku8MBSlaveDeviceFailure = MBM_SERVER_DEVICE_FAILURE;
    /** The call succeeded. */
    static const uint8_t ku8MBSuccess = MBM_OK;
    /** Only other units replied. */
    static const uint8_t ku8MBInvalidSlaveID = MBM_INVALID_SLAVE_ID;
    /** The unit replied with another function code. */
    static const uint8_t ku8MBInvalidFunction = MBM_INVALID_FUNCTION;
    /** No complete reply within the response timeout. */
    static const uint8_t ku8MBResponseTimedOut = MBM_RESPONSE_TIMED_OUT;
    /** The reply arrived damaged. */
    static const uint8_t ku8MBInvalidCRC = MBM_INVALID_CRC;
    /** The reply does not answer the request. */
    static const uint8_t ku8MBMalformedReply = MBM_MALFORMED_REPLY;
    /** A request of this object is pending, or a callback called; nothing was changed. */
    static const uint8_t ku8MBBusy = MBM_BUSY;
    /** A function that reads cannot be broadcast; nothing was sent. */
    static const uint8_t ku8MBBroadcastNotAllowed = MBM_BROADCAST_NOT_ALLOWED;
    /** The buffers cannot hold the request or its reply. */
    static const uint8_t ku8MBBufferTooSmall = MBM_BUFFER_TOO_SMALL;
    /** begin has not been called. */
    static const uint8_t ku8MBNotInitialised = MBM_NOT_INITIALISED;
    /** The request is pending: call poll again. */
    static const uint8_t ku8MBPending = MBM_PENDING;
    /** The line never fell silent, or the port took no bytes. */
    static const uint8_t ku8MBLineBusy = MBM_LINE_BUSY;
    /** cancel or begin ended the request. */
    static const uint8_t ku8MBCancelled = MBM_CANCELLED;
};

/** @cond the definitions of the constants */
#define MODBUSMASTER_DEFINE(name) \
    template <typename Unused> const uint8_t ModbusMasterStatics<Unused>::name
MODBUSMASTER_DEFINE(ku8MBIllegalFunction);
MODBUSMASTER_DEFINE(ku8MBIllegalDataAddress);
MODBUSMASTER_DEFINE(ku8MBIllegalDataValue);
MODBUSMASTER_DEFINE(ku8MBSlaveDeviceFailure);
MODBUSMASTER_DEFINE(ku8MBSuccess);
MODBUSMASTER_DEFINE(ku8MBInvalidSlaveID);
MODBUSMASTER_DEFINE(ku8MBInvalidFunction);
MODBUSMASTER_DEFINE(ku8MBResponseTimedOut);
MODBUSMASTER_DEFINE(ku8MBInvalidCRC);
MODBUSMASTER_DEFINE(ku8MBMalformedReply);
MODBUSMASTER_DEFINE(ku8MBBusy);
MODBUSMASTER_DEFINE(ku8MBBroadcastNotAllowed);
MODBUSMASTER_DEFINE(ku8MBBufferTooSmall);
MODBUSMASTER_DEFINE(ku8MBNotInitialised);
MODBUSMASTER_DEFINE(ku8MBPending);
MODBUSMASTER_DEFINE(ku8MBLineBusy);
MODBUSMASTER_DEFINE(ku8MBCancelled);
#undef MODBUSMASTER_DEFINE
/** @endcond */

#endif
