/**
 * @file ModbusStatusText.h
 * @brief The text of each status. The texts stay in flash.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h and ModbusServer.h.
 */

#ifndef MODBUS_STATUS_TEXT_H
#define MODBUS_STATUS_TEXT_H

#include <Arduino.h>
#include <stdint.h>

#include "mbm/base.h"

/**
 * The texts of mbm_status_text, for Serial.println. mbm_status_text takes a kilobyte of RAM
 * on an AVR board, this function none. A sketch that does not call it is not larger.
 *
 * @param status  any number
 * @return a constant text
 */
inline const __FlashStringHelper *modbusStatusText(uint8_t status)
{
    switch (status) {
    case MBM_OK:
        return F("success");
    case MBM_ILLEGAL_FUNCTION:
        return F("exception 01: illegal function");
    case MBM_ILLEGAL_DATA_ADDRESS:
        return F("exception 02: illegal data address");
    case MBM_ILLEGAL_DATA_VALUE:
        return F("exception 03: illegal data value");
    case MBM_SERVER_DEVICE_FAILURE:
        return F("exception 04: server device failure");
    case MBM_ACKNOWLEDGE:
        return F("exception 05: acknowledge, the request takes long");
    case MBM_SERVER_DEVICE_BUSY:
        return F("exception 06: server device busy");
    case MBM_MEMORY_PARITY_ERROR:
        return F("exception 08: memory parity error");
    case MBM_GATEWAY_PATH_UNAVAILABLE:
        return F("exception 0A: gateway path unavailable");
    case MBM_GATEWAY_TARGET_FAILED_TO_RESPOND:
        return F("exception 0B: gateway target device failed to respond");
    case MBM_INVALID_SLAVE_ID:
        return F("only other units answered");
    case MBM_INVALID_FUNCTION:
        return F("the unit answered another function");
    case MBM_RESPONSE_TIMED_OUT:
        return F("no complete reply in time");
    case MBM_INVALID_CRC:
        return F("the reply arrived damaged (CRC)");
    case MBM_INVALID_ARGUMENT:
        return F("invalid argument: NULL, out of range, or of another kind");
    case MBM_MALFORMED_REPLY:
        return F("the reply does not answer the request");
    case MBM_LINK_LOST:
        return F("the port reported a lost link");
    case MBM_BUSY:
        return F("in use: a request is pending, or a hook of the object called");
    case MBM_BROADCAST_NOT_ALLOWED:
        return F("a read cannot be broadcast");
    case MBM_BUFFER_TOO_SMALL:
        return F("a buffer is too small for request or reply");
    case MBM_NOT_INITIALISED:
        return F("the object was never begun or has no buffers");
    case MBM_PENDING:
        return F("pending, poll again");
    case MBM_LINE_BUSY:
        return F("the line never fell silent or the port took no bytes");
    case MBM_CANCELLED:
        return F("cancelled");
    case MBM_INCOMPLETE_FRAME:
        return F("the frame is not whole yet");
    case MBM_MALFORMED_FRAME:
        return F("no frame of this framing begins like that");
    case MBM_QUEUE_FULL:
        return F("the queue is full");
    case MBM_DUPLICATE_TRANSACTION:
        return F("another pending request has this transaction id");
    case MBM_NOT_PENDING:
        return F("the request is not pending");
    case MBM_NO_PROGRESS:
        return F("the device repeats itself without an end");
    case MBM_OUT_OF_RANGE:
        return F("the value is out of the range of its type");
    case MBM_CONNECT_TIMED_OUT:
        return F("the connection was not made in time");
    case MBM_NOT_AVAILABLE:
        return F("not available");
    case MBM_MALFORMED_VALUE:
        return F("the registers hold no value of this type");
    default:
        break;
    }
    if (status < 0x80)
        return F("the device sent an exception code that the standard does not name");
    return F("not a status");
}

/**
 * The texts of mbm_status_textOf: as modbusStatusText, but for a request that was refused
 * before it was sent, the text says so.
 *
 * @param status         the status of the request
 * @param exceptionCode  the exception code of the reply, 0 if there was none
 * @return a constant text
 */
inline const __FlashStringHelper *modbusStatusText(uint8_t status, uint8_t exceptionCode)
{
    if (exceptionCode == 0) {
        if (status == MBM_ILLEGAL_FUNCTION)
            return F("refused, nothing was sent: no such function code");
        if (status == MBM_ILLEGAL_DATA_ADDRESS)
            return F("refused, nothing was sent: the addresses pass 65535");
        if (status == MBM_ILLEGAL_DATA_VALUE)
            return F("refused, nothing was sent: the standard or a buffer does not allow the "
                     "quantity or value");
    }
    return modbusStatusText(status);
}

#endif
