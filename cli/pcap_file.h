/* Writes frames to a pcapng file, which Wireshark and tshark show as Modbus.
 *
 * Each link is an interface of the file. Frames of Modbus TCP get IP and TCP headers with the
 * server's port 502. RTU frames are written as packets for Wireshark's dissector of Modbus RTU,
 * between two TCP ports; that of the server is PCAP_RTU_PORT. An ASCII frame is written as the RTU
 * frame with the same content, because Wireshark does not know Modbus ASCII. Bytes that are no
 * frame are packets of raw data. A packet that is not a whole frame has a comment that says so. */
#pragma once

#include "mbm.h"

#include <stdio.h>

/* The TCP port of servers in packets that carry RTU frames. By this port Wireshark tells a request
 * from a response that looks the same, with -o mbrtu.tcp.port:503. */
enum { PCAP_RTU_PORT = 503 };

/* A link whose frames are written. */
typedef struct pcap_link {
    uint32_t interface;
    uint8_t framing;
    uint16_t client_port;
    uint32_t sequences[2]; /* of the client and of the server */
} pcap_link;

/* What is wrong with a record whose status is not MBM_OK, in words. */
const char *pcap_fault(uint8_t status);

/* Writes the start of a file. Returns 0, or -1 with errno set. */
int pcap_start(FILE *file);

/* Adds a link with a framing, one of MBM_FRAMING_. `index` counts the links of the file from 0.
 * Returns 0, or -1 with errno set. */
int pcap_add(FILE *file, pcap_link *link, uint32_t index, uint8_t framing, const char *name);

/* Begins another connection of the link. */
void pcap_reconnect(pcap_link *link);

/* Writes one record. `time` is in microseconds since 1970. If `decoded` is not 0, the bytes are
 * an ASCII frame as a sniffer reports it: decoded. Returns 0, or -1 with errno set. */
int pcap_write(FILE *file, pcap_link *link, const mbm_traceRecord *record, uint64_t time,
               int decoded);
