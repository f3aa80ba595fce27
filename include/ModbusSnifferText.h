/**
 * @file ModbusSnifferText.h
 * @brief Prints an event of a ModbusSniffer as a line of text. The words stay in flash.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusSniffer.h.
 */

#ifndef MODBUSSNIFFERTEXT_H
#define MODBUSSNIFFERTEXT_H

#include <Arduino.h>
#include <stdint.h>

#include "mbm/sniffer.h"

/** The name of a function of the standard; an empty text for others. */
inline const __FlashStringHelper *modbusFunctionText(uint8_t function)
{
    switch (function) {
    // `make header` writes these cases.
    case MBM_FC_READ_COILS: return F(" read coils");
    case MBM_FC_READ_DISCRETE_INPUTS: return F(" read discrete inputs");
    case MBM_FC_READ_HOLDING_REGISTERS: return F(" read holding registers");
    case MBM_FC_READ_INPUT_REGISTERS: return F(" read input registers");
    case MBM_FC_WRITE_SINGLE_COIL: return F(" write single coil");
    case MBM_FC_WRITE_SINGLE_REGISTER: return F(" write single register");
    case MBM_FC_READ_EXCEPTION_STATUS: return F(" read exception status");
    case MBM_FC_DIAGNOSTICS: return F(" diagnostics");
    case MBM_FC_GET_COMM_EVENT_COUNTER: return F(" get comm event counter");
    case MBM_FC_GET_COMM_EVENT_LOG: return F(" get comm event log");
    case MBM_FC_WRITE_MULTIPLE_COILS: return F(" write multiple coils");
    case MBM_FC_WRITE_MULTIPLE_REGISTERS: return F(" write multiple registers");
    case MBM_FC_REPORT_SERVER_ID: return F(" report server id");
    case MBM_FC_READ_FILE_RECORD: return F(" read file record");
    case MBM_FC_WRITE_FILE_RECORD: return F(" write file record");
    case MBM_FC_MASK_WRITE_REGISTER: return F(" mask write register");
    case MBM_FC_READ_WRITE_MULTIPLE_REGISTERS: return F(" read/write multiple registers");
    case MBM_FC_READ_FIFO_QUEUE: return F(" read FIFO queue");
    case MBM_FC_ENCAPSULATED_INTERFACE_TRANSPORT: return F(" encapsulated interface transport");
    default: return F("");
    }
}

/** @cond parts of modbusPrintEvent */
inline void modbusPrintHex(Print &out, uint8_t byte)
{
    out.print(byte >> 4, HEX);
    out.print(byte & 15, HEX);
}

inline void modbusPrintBytes(Print &out, const uint8_t *bytes, uint16_t length)
{
    for (uint16_t i = 0; i < length; i++) {
        out.print(' ');
        modbusPrintHex(out, bytes[i]);
    }
}

inline void modbusPrintRegisters(Print &out, const uint8_t *bytes, uint16_t length)
{
    for (const uint8_t *end = bytes + length; end - bytes >= 2; bytes += 2) {
        out.print(' ');
        out.print(bytes[0] * 256u + bytes[1]);
    }
}

inline void modbusPrintBits(Print &out, const mbm_event &event)
{
    for (uint16_t i = 0; i < event.quantity && i / 8u < event.packet.dataLength; i++) {
        out.print(' ');
        out.print(event.packet.data[i / 8u] >> i % 8u & 1);
    }
}

// The values in a request or in a reply.
inline void modbusPrintValues(Print &out, const mbm_event &event)
{
    const mbm_packet &packet = event.packet;
    const bool request = packet.kind == MBM_PACKET_REQUEST;
    switch (event.function) {
    case MBM_FC_WRITE_SINGLE_COIL:
    case MBM_FC_WRITE_SINGLE_REGISTER:
        out.print(F(": "));
        out.print(packet.value);
        return;
    case MBM_FC_READ_EXCEPTION_STATUS:
        if (!request) {
            out.print(F(": "));
            modbusPrintHex(out, packet.exceptionStatus);
        }
        return;
    case MBM_FC_MASK_WRITE_REGISTER:
        out.print(F(": and "));
        out.print(packet.andMask, HEX);
        out.print(F(" or "));
        out.print(packet.orMask, HEX);
        return;
    }
    if (packet.dataLength == 0)
        return;
    out.print(':');
    switch (event.function) {
    case MBM_FC_READ_COILS:
    case MBM_FC_READ_DISCRETE_INPUTS:
    case MBM_FC_WRITE_MULTIPLE_COILS: modbusPrintBits(out, event); break;
    case MBM_FC_READ_HOLDING_REGISTERS:
    case MBM_FC_READ_INPUT_REGISTERS:
    case MBM_FC_WRITE_MULTIPLE_REGISTERS:
    case MBM_FC_READ_WRITE_MULTIPLE_REGISTERS:
    case MBM_FC_READ_FIFO_QUEUE:
        modbusPrintRegisters(out, packet.data, packet.dataLength);
        break;
    default: modbusPrintBytes(out, packet.data, packet.dataLength); break;
    }
}

// The function code, its name, and the addresses of the request.
inline void modbusPrintFunction(Print &out, const mbm_event &event)
{
    modbusPrintHex(out, event.function);
    out.print(modbusFunctionText(event.function));
    if (event.quantity == 0)
        return;
    out.print(' ');
    out.print(event.address);
    if (event.quantity > 1) {
        out.print(F(".."));
        out.print(uint32_t{event.address} + event.quantity - 1u);
    }
}
/** @endcond */

/**
 * Prints an event as a line: the time in milliseconds, the unit, the kind of event, the
 * function and its addresses, registers in decimal, coils as 0 and 1, and the response time
 * in milliseconds. For damaged frames and noise it prints the bytes.
 */
inline void modbusPrintEvent(Print &out, const mbm_event &event)
{
    out.print(event.timeUs / 1000u);
    out.print(F(" ms "));
    if (event.kind == MBM_EVENT_BAD_CRC || event.kind == MBM_EVENT_NOISE) {
        out.print(event.kind == MBM_EVENT_NOISE ? F("noise, ") : F("damaged, "));
        out.print(event.length);
        out.print(F(" bytes:"));
        modbusPrintBytes(out, event.frame, event.frameLength);
        out.println();
        return;
    }
    out.print(F("unit "));
    out.print(event.unit);
    switch (event.kind) {
    case MBM_EVENT_REQUEST: out.print(F(" request ")); break;
    case MBM_EVENT_REPLY: out.print(F(" reply ")); break;
    case MBM_EVENT_EXCEPTION: out.print(F(" exception ")); break;
    case MBM_EVENT_TIMEOUT: out.print(F(" no reply ")); break;
    default: out.print(F(" unpaired reply ")); break;
    }
    modbusPrintFunction(out, event);
    if (event.packet.kind == MBM_PACKET_EXCEPTION) {
        out.print(F(": code "));
        modbusPrintHex(out, event.packet.exceptionCode);
    } else if (event.kind != MBM_EVENT_TIMEOUT) {
        modbusPrintValues(out, event);
    }
    if (event.status == MBM_MALFORMED_REPLY)
        out.print(F(" does not answer the request"));
    if (event.responseTimeUs != 0) {
        out.print(F(" ("));
        out.print((event.responseTimeUs + 500u) / 1000u);
        out.print(F(" ms)"));
    }
    out.println();
}

#endif
