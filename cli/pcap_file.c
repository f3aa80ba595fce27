/* Writes the blocks of a pcapng file, with the headers that Wireshark needs. */
#include "pcap_file.h"

#include <string.h>

/* Numbers of the pcapng format. It is written in the byte order of this machine. */
enum {
    BYTE_ORDER_MAGIC = 0x1A2B3C4D,
    INTERFACE_BLOCK = 1,
    PACKET_BLOCK = 6,
    LINKTYPE_RAW = 101,       /* IP packets */
    LINKTYPE_UPPER_PDU = 252, /* packets for a dissector of Wireshark */
    OPTION_COMMENT = 1,
    OPTION_FLAGS = 2, /* of a packet */
    OPTION_NAME = 2,  /* of an interface */
    OPTION_APPLICATION = 4,
    INBOUND = 1,
    OUTBOUND = 2
};

/* Tags before a packet for a dissector of Wireshark. */
enum {
    TAG_DISSECTOR = 12,
    TAG_SOURCE = 20,
    TAG_DESTINATION,
    TAG_PORT_TYPE = 24,
    TAG_SOURCE_PORT,
    TAG_DESTINATION_PORT,
    PORT_TYPE_TCP = 2
};

enum { CLIENT, SERVER, FIRST_CLIENT_PORT = 49152, MODBUS_PORT = 502 };

/* A block of the file while it is made: its length is known at the end. */
typedef struct block {
    uint8_t bytes[2048];
    size_t length;
} block;

static void put_bytes(block *b, const void *bytes, size_t length)
{
    if (length > 0 && b->length + length <= sizeof b->bytes)
        memcpy(b->bytes + b->length, bytes, length);
    b->length += length;
}

static void put_padding(block *b)
{
    static const uint8_t zeros[3];

    put_bytes(b, zeros, (4 - b->length % 4) % 4);
}

static void put16(block *b, unsigned number)
{
    const uint16_t native = (uint16_t)number;

    put_bytes(b, &native, sizeof native);
}

static void put32(block *b, uint32_t number)
{
    put_bytes(b, &number, sizeof number);
}

/* Numbers of the protocols are in network order. */
static void put_net16(block *b, unsigned number)
{
    const uint8_t bytes[2] = {(uint8_t)(number >> 8), (uint8_t)number};

    put_bytes(b, bytes, sizeof bytes);
}

static void put_net32(block *b, uint32_t number)
{
    put_net16(b, number >> 16);
    put_net16(b, number & 0xFFFF);
}

static void put_option(block *b, unsigned code, const void *value, size_t length)
{
    put16(b, code);
    put16(b, (unsigned)length);
    put_bytes(b, value, length);
    put_padding(b);
}

static void begin_block(block *b, uint32_t type)
{
    b->length = 0;
    put32(b, type);
    put32(b, 0);
}

static int end_block(FILE *file, block *b)
{
    const uint32_t length = (uint32_t)b->length + 4;

    put32(b, length);
    memcpy(b->bytes + 4, &length, sizeof length);
    return fwrite(b->bytes, 1, b->length, file) == b->length && fflush(file) == 0 ? 0 : -1;
}

const char *pcap_fault(uint8_t status)
{
    switch (status) {
    case MBM_INVALID_CRC: return "bad CRC";
    case MBM_INCOMPLETE_FRAME: return "incomplete frame";
    case MBM_BUFFER_TOO_SMALL: return "part of a frame";
    default: return "no frame";
    }
}

int pcap_start(FILE *file)
{
    static const char application[] = "mbm " MBM_VERSION;
    block b;

    begin_block(&b, 0x0A0D0D0A);
    put32(&b, BYTE_ORDER_MAGIC);
    put16(&b, 1);
    put16(&b, 0);
    put32(&b, UINT32_MAX); /* the length of the section is not known */
    put32(&b, UINT32_MAX);
    put_option(&b, OPTION_APPLICATION, application, sizeof application - 1);
    put_option(&b, 0, NULL, 0);
    return end_block(file, &b);
}

int pcap_add(FILE *file, pcap_link *link, uint32_t index, uint8_t framing, const char *name)
{
    block b;

    memset(link, 0, sizeof *link);
    link->interface = index;
    link->framing = framing;
    link->client_port = FIRST_CLIENT_PORT;
    begin_block(&b, INTERFACE_BLOCK);
    put16(&b, framing == MBM_FRAMING_TCP ? LINKTYPE_RAW : LINKTYPE_UPPER_PDU);
    put16(&b, 0);
    put32(&b, 0); /* packets are never cut */
    put_option(&b, OPTION_NAME, name, strlen(name));
    put_option(&b, 0, NULL, 0);
    return end_block(file, &b);
}

void pcap_reconnect(pcap_link *link)
{
    link->client_port++;
    if (link->client_port < FIRST_CLIENT_PORT)
        link->client_port = FIRST_CLIENT_PORT;
    link->sequences[CLIENT] = link->sequences[SERVER] = 0;
}

/* The address of an end of a link: each link has its own two. */
static uint32_t address_of(const pcap_link *link, int end)
{
    return 0x0A000001u + (link->interface << 8) + (uint32_t)end;
}

static uint16_t port_of(const pcap_link *link, int end)
{
    if (end == CLIENT)
        return link->client_port;
    return link->framing == MBM_FRAMING_TCP ? MODBUS_PORT : PCAP_RTU_PORT;
}

/* The sum that IP and TCP headers carry, over 16-bit words. */
static uint16_t checksum(uint32_t sum, const uint8_t *bytes, size_t length)
{
    size_t i;

    for (i = 0; i < length; i++)
        sum += (uint32_t)bytes[i] << (i % 2 ? 0 : 8);
    while (sum >> 16)
        sum = (sum & 0xFFFF) + (sum >> 16);
    return (uint16_t)~sum;
}

static void set_net16(uint8_t *place, uint16_t number)
{
    place[0] = (uint8_t)(number >> 8);
    place[1] = (uint8_t)number;
}

/* A packet of Modbus TCP: an IP header, a TCP header, and the bytes. */
static void put_tcp_packet(block *b, pcap_link *link, int from, const uint8_t *bytes, size_t length)
{
    enum { IP_HEADER = 20, TCP_HEADER = 20, TCP = 6, TTL = 64, PUSH_ACK = 0x5018 };
    const uint32_t source = address_of(link, from), destination = address_of(link, !from);
    const size_t start = b->length;
    uint8_t *const header = b->bytes + start;
    uint32_t sum;

    put_net16(b, 0x4500);
    put_net16(b, (unsigned)(IP_HEADER + TCP_HEADER + length));
    put_net32(b, 0x00004000); /* not fragmented */
    put_net16(b, TTL << 8 | TCP);
    put_net16(b, 0);
    put_net32(b, source);
    put_net32(b, destination);
    put_net16(b, port_of(link, from));
    put_net16(b, port_of(link, !from));
    put_net32(b, 1 + link->sequences[from]);
    put_net32(b, 1 + link->sequences[!from]);
    put_net16(b, PUSH_ACK);
    put_net16(b, 0xFFFF);
    put_net32(b, 0);
    put_bytes(b, bytes, length);
    if (b->length > sizeof b->bytes)
        return;
    set_net16(header + 10, checksum(0, header, IP_HEADER));
    sum = (source >> 16) + (source & 0xFFFF) + (destination >> 16) + (destination & 0xFFFF) + TCP +
          TCP_HEADER + (uint32_t)length;
    set_net16(header + IP_HEADER + 16, checksum(sum, header + IP_HEADER, TCP_HEADER + length));
    link->sequences[from] += (uint32_t)length;
}

static void put_tag(block *b, unsigned tag, uint32_t value)
{
    put_net16(b, tag);
    put_net16(b, 4);
    put_net32(b, value);
}

/* A packet for a dissector of Wireshark. */
static void put_pdu_packet(block *b, const pcap_link *link, int from, int is_frame,
                           const uint8_t *bytes, size_t length)
{
    static const uint8_t modbus[8] = "mbrtu", data[4] = "data";

    put_net16(b, TAG_DISSECTOR);
    put_net16(b, is_frame ? sizeof modbus : sizeof data);
    put_bytes(b, is_frame ? modbus : data, is_frame ? sizeof modbus : sizeof data);
    put_tag(b, TAG_SOURCE, address_of(link, from));
    put_tag(b, TAG_DESTINATION, address_of(link, !from));
    put_tag(b, TAG_PORT_TYPE, PORT_TYPE_TCP);
    put_tag(b, TAG_SOURCE_PORT, port_of(link, from));
    put_tag(b, TAG_DESTINATION_PORT, port_of(link, !from));
    put_net32(b, 0);
    put_bytes(b, bytes, length);
}

static unsigned digit(uint8_t character)
{
    if (character >= 'a')
        return character - 'a' + 10u;
    return character >= 'A' ? character - 'A' + 10u : character - (unsigned)'0';
}

/* The RTU frame with the content of a valid ASCII frame. Returns its length. */
static size_t rtu_of_ascii(const mbm_traceRecord *record, int decoded, uint8_t *rtu)
{
    size_t count = decoded ? record->length - 1u : (record->length - 3u) / 2 - 1, i;
    uint16_t crc;

    for (i = 0; i < count; i++) {
        const uint8_t *const pair = record->bytes + 1 + 2 * i;

        rtu[i] = decoded ? record->bytes[i] : (uint8_t)(digit(pair[0]) << 4 | digit(pair[1]));
    }
    crc = mbm_frame_crc16(rtu, (uint16_t)count);
    rtu[count++] = (uint8_t)crc;
    rtu[count++] = (uint8_t)(crc >> 8);
    return count;
}

int pcap_write(FILE *file, pcap_link *link, const mbm_traceRecord *record, uint64_t time,
               int decoded)
{
    const int from = record->kind == MBM_PACKET_REQUEST ? CLIENT : SERVER;
    const int is_valid = record->status == MBM_OK;
    uint8_t rtu[MBM_MAX_FRAME];
    const uint8_t *bytes = record->bytes;
    size_t length = record->length, start;
    block b;
    uint32_t packet;

    if (link->framing == MBM_FRAMING_ASCII && is_valid) {
        length = rtu_of_ascii(record, decoded, rtu);
        bytes = rtu;
    }
    begin_block(&b, PACKET_BLOCK);
    put32(&b, link->interface);
    put32(&b, (uint32_t)(time >> 32));
    put32(&b, (uint32_t)time);
    put32(&b, 0);
    put32(&b, 0);
    start = b.length;
    if (link->framing == MBM_FRAMING_TCP)
        put_tcp_packet(&b, link, from, bytes, length);
    else
        put_pdu_packet(&b, link, from,
                       is_valid || (record->status == MBM_INVALID_CRC &&
                                    link->framing != MBM_FRAMING_ASCII && length >= 4),
                       bytes, length);
    packet = (uint32_t)(b.length - start);
    memcpy(b.bytes + start - 8, &packet, sizeof packet);
    memcpy(b.bytes + start - 4, &packet, sizeof packet);
    put_padding(&b);
    if (!is_valid) {
        const char *const comment = pcap_fault(record->status);

        put_option(&b, OPTION_COMMENT, comment, strlen(comment));
        /* The next record does not continue these bytes. */
        pcap_reconnect(link);
    }
    packet = record->direction == MBM_TRACE_SENT ? OUTBOUND : INBOUND;
    put_option(&b, OPTION_FLAGS, &packet, sizeof packet);
    put_option(&b, 0, NULL, 0);
    return end_block(file, &b);
}
