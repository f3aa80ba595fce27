#include "examples.h"
#include "test.h"

#define REQUEST .kind = MBM_PACKET_REQUEST
#define RESPONSE .kind = MBM_PACKET_RESPONSE

/* Each request stands before its response. */
const example examples[] = {
    {"01 0013 0013", 0, {REQUEST, .function = 0x01, .address = 0x13, .quantity = 0x13}},
    {"01 03 CD6B05", 2, {RESPONSE, .function = 0x01, .dataLength = 3}},
    {"02 00C4 0016", 0, {REQUEST, .function = 0x02, .address = 0xC4, .quantity = 0x16}},
    {"02 03 ACDB35", 2, {RESPONSE, .function = 0x02, .dataLength = 3}},
    {"03 006B 0003", 0, {REQUEST, .function = 0x03, .address = 0x6B, .quantity = 3}},
    {"03 06 022B 0000 0064", 2, {RESPONSE, .function = 0x03, .dataLength = 6}},
    {"04 0008 0001", 0, {REQUEST, .function = 0x04, .address = 8, .quantity = 1}},
    {"04 02 000A", 2, {RESPONSE, .function = 0x04, .dataLength = 2}},
    {"05 00AC FF00", 0, {REQUEST, .function = 0x05, .address = 0xAC, .value = 1}},
    {"05 00AC FF00", 0, {RESPONSE, .function = 0x05, .address = 0xAC, .value = 1}},
    {"05 00AD 0000", 0, {REQUEST, .function = 0x05, .address = 0xAD}},
    {"05 00AD 0000", 0, {RESPONSE, .function = 0x05, .address = 0xAD}},
    {"06 0001 0003", 0, {REQUEST, .function = 0x06, .address = 1, .value = 3}},
    {"06 0001 0003", 0, {RESPONSE, .function = 0x06, .address = 1, .value = 3}},
    {"07", 0, {REQUEST, .function = 0x07}},
    {"07 6D", 0, {RESPONSE, .function = 0x07, .exceptionStatus = 0x6D}},
    {"08 0000 A537", 3, {REQUEST, .function = 0x08, .dataLength = 2}},
    {"08 0000 A537", 3, {RESPONSE, .function = 0x08, .dataLength = 2}},
    {"08 0001 FF00", 3, {REQUEST, .function = 0x08, .subFunction = 1, .dataLength = 2}},
    {"08 0001 FF00", 3, {RESPONSE, .function = 0x08, .subFunction = 1, .dataLength = 2}},
    {"08 0012 0000", 3, {REQUEST, .function = 0x08, .subFunction = 0x12, .dataLength = 2}},
    {"08 0012 0005", 3, {RESPONSE, .function = 0x08, .subFunction = 0x12, .dataLength = 2}},
    {"0B", 0, {REQUEST, .function = 0x0B}},
    {"0B FFFF 0108", 0, {RESPONSE, .function = 0x0B, .commStatus = 0xFFFF, .eventCount = 0x108}},
    {"0C", 0, {REQUEST, .function = 0x0C}},
    {"0C 08 0000 0108 0121 2000",
     8,
     {RESPONSE, .function = 0x0C, .eventCount = 0x108, .messageCount = 0x121, .dataLength = 2}},
    {"0F 0013 000A 02 CD01",
     6,
     {REQUEST, .function = 0x0F, .address = 0x13, .quantity = 10, .dataLength = 2}},
    {"0F 0013 000A", 0, {RESPONSE, .function = 0x0F, .address = 0x13, .quantity = 10}},
    {"10 0001 0002 04 000A 0102",
     6,
     {REQUEST, .function = 0x10, .address = 1, .quantity = 2, .dataLength = 4}},
    {"10 0001 0002", 0, {RESPONSE, .function = 0x10, .address = 1, .quantity = 2}},
    {"11", 0, {REQUEST, .function = 0x11}},
    {"11 02 0102 00 0102", 2, {RESPONSE, .function = 0x11, .byteCount = 2, .dataLength = 5}},
    {"14 0E 06 0004 0001 0002 06 0003 0009 0002", 2, {REQUEST, .function = 0x14, .dataLength = 14}},
    {"14 0C 05 06 0DFE 0020 05 06 33CD 0040", 2, {RESPONSE, .function = 0x14, .dataLength = 12}},
    {"15 0D 06 0004 0007 0003 06AF 04BE 100D", 2, {REQUEST, .function = 0x15, .dataLength = 13}},
    {"15 0D 06 0004 0007 0003 06AF 04BE 100D", 2, {RESPONSE, .function = 0x15, .dataLength = 13}},
    {"16 0004 00F2 0025",
     0,
     {REQUEST, .function = 0x16, .address = 4, .andMask = 0xF2, .orMask = 0x25}},
    {"16 0004 00F2 0025",
     0,
     {RESPONSE, .function = 0x16, .address = 4, .andMask = 0xF2, .orMask = 0x25}},
    {"17 0003 0006 000E 0003 06 00FF 00FF 00FF",
     10,
     {REQUEST, .function = 0x17, .address = 3, .quantity = 6, .writeAddress = 14,
      .writeQuantity = 3, .dataLength = 6}},
    {"17 0C 00FE 0ACD 0001 0003 000D 00FF", 2, {RESPONSE, .function = 0x17, .dataLength = 12}},
    {"18 04DE", 0, {REQUEST, .function = 0x18, .address = 0x4DE}},
    {"18 0006 0002 01B8 1284", 5, {RESPONSE, .function = 0x18, .dataLength = 4}},
    {"2B 0E 01 00",
     0,
     {REQUEST, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_BASIC}},
    {"2B 0E 01 81 FF 02 02 00 03 6D626D 01 02 3432",
     7,
     {RESPONSE, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_BASIC,
      .conformity = 0x81, .moreFollows = 1, .nextObjectId = 2, .objectCount = 2, .dataLength = 9}},
    {"2B 0E 02 03",
     0,
     {REQUEST, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_REGULAR,
      .objectId = 3}},
    {"2B 0E 02 82 00 00 01 03 02 7777",
     7,
     {RESPONSE, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_REGULAR,
      .conformity = 0x82, .objectCount = 1, .dataLength = 4}},
    {"2B 0E 03 80",
     0,
     {REQUEST, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_EXTENDED,
      .objectId = 0x80}},
    {"2B 0E 03 03 00 00 01 80 01 FF",
     7,
     {RESPONSE, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_EXTENDED,
      .conformity = 3, .objectCount = 1, .dataLength = 3}},
    {"2B 0E 04 01",
     0,
     {REQUEST, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_INDIVIDUAL,
      .objectId = 1}},
    {"2B 0E 04 83 00 00 01 01 00",
     7,
     {RESPONSE, .function = 0x2B, .meiType = 0x0E, .readDeviceIdCode = MBM_DEVICE_ID_INDIVIDUAL,
      .conformity = 0x83, .objectCount = 1, .dataLength = 2}},
    {"2B 0D 0102", 2, {REQUEST, .function = 0x2B, .meiType = 0x0D, .dataLength = 2}},
    {"2B 0D 0304", 2, {RESPONSE, .function = 0x2B, .meiType = 0x0D, .dataLength = 2}},
    {"41 0102", 1, {REQUEST, .function = 0x41, .dataLength = 2}},
    {"41 03", 1, {RESPONSE, .function = 0x41, .dataLength = 1}},
    {"81 02",
     0,
     {.kind = MBM_PACKET_EXCEPTION, .function = 0x01, .exceptionCode = MBM_ILLEGAL_DATA_ADDRESS}},
    {"AB 03",
     0,
     {.kind = MBM_PACKET_EXCEPTION, .function = 0x2B, .exceptionCode = MBM_ILLEGAL_DATA_VALUE}},
};
const size_t example_count = COUNT(examples);

static unsigned digit(char character)
{
    return (unsigned)(character <= '9' ? character - '0' : (character | 0x20) - 'a' + 10);
}

uint16_t hex_bytes(uint8_t *bytes, const char *hex)
{
    uint16_t count = 0;

    while (*hex) {
        if (*hex == ' ') {
            hex++;
            continue;
        }
        bytes[count++] = (uint8_t)(digit(hex[0]) << 4 | digit(hex[1]));
        hex += 2;
    }
    return count;
}

uint16_t example_load(const example *e, uint8_t *pdu, mbm_packet *packet)
{
    uint16_t length = hex_bytes(pdu, e->hex);

    *packet = e->packet;
    if (e->at)
        packet->data = pdu + e->at;
    return length;
}

uint8_t example_side(const example *e)
{
    return (uint8_t)(e->packet.kind == MBM_PACKET_REQUEST ? MBM_PACKET_REQUEST
                                                          : MBM_PACKET_RESPONSE);
}

#define SAME(field) assert_int_equal(found->field, wanted->field)

void assert_same_packet(const mbm_packet *found, const mbm_packet *wanted)
{
    SAME(kind);
    SAME(unit);
    SAME(function);
    SAME(transaction);
    SAME(address);
    SAME(quantity);
    SAME(writeAddress);
    SAME(writeQuantity);
    SAME(value);
    SAME(andMask);
    SAME(orMask);
    SAME(subFunction);
    SAME(commStatus);
    SAME(eventCount);
    SAME(messageCount);
    SAME(exceptionCode);
    SAME(exceptionStatus);
    SAME(byteCount);
    SAME(meiType);
    SAME(readDeviceIdCode);
    SAME(objectId);
    SAME(conformity);
    SAME(moreFollows);
    SAME(nextObjectId);
    SAME(objectCount);
    SAME(dataLength);
    if (wanted->dataLength)
        assert_memory_equal(found->data, wanted->data, wanted->dataLength);
}
