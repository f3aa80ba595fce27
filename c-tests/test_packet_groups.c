/* The records of functions 14 and 15 and the objects of a device identification: adding
 * them to a packet, and reading them one by one. */
#include "examples.h"
#include "test.h"

#include <string.h>

TEST(a_request_of_14_is_made_of_records)
{
    const mbm_record records[] = {{NULL, 4, 1, 2}, {NULL, 3, 9, 2}};
    uint8_t storage[14], pdu[16], wanted[16];
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = MBM_FC_READ_FILE_RECORD};
    mbm_record record;
    uint16_t length, cursor = 0, i = 0;

    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[0]));
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[1]));
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    assert_int_equal(length, hex_bytes(wanted, "14 0E 06 0004 0001 0002 06 0003 0009 0002"));
    assert_memory_equal(pdu, wanted, length);

    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, length, &packet));
    for (; mbm_packet_nextRecord(&packet, &cursor, &record); i++) {
        assert_int_equal(record.file, records[i].file);
        assert_int_equal(record.record, records[i].record);
        assert_int_equal(record.length, records[i].length);
        assert_null(record.data);
    }
    assert_int_equal(i, 2);
}

/* Adds two records of two registers each, and reads them back. */
static void carries_data(uint8_t kind, uint8_t function, const char *hex, int is_named)
{
    const uint8_t first[] = {0x0D, 0xFE, 0x00, 0x20}, second[] = {0x33, 0xCD, 0x00, 0x40};
    const mbm_record records[] = {{first, 4, 1, 2}, {second, 3, 9, 2}};
    uint8_t storage[251], pdu[MBM_MAX_PDU], wanted[64];
    mbm_packet packet = {0};
    mbm_record record;
    uint16_t length, cursor = 0, i = 0;

    packet.kind = kind;
    packet.function = function;
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[0]));
    OK(mbm_packet_addRecord(&packet, storage, sizeof storage, &records[1]));
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    assert_int_equal(length, hex_bytes(wanted, hex));
    assert_memory_equal(pdu, wanted, length);
    OK(mbm_frame_parse(PDU(NULL, 0), kind, pdu, length, &packet));
    for (; mbm_packet_nextRecord(&packet, &cursor, &record); i++) {
        assert_int_equal(record.file, is_named ? records[i].file : 0);
        assert_int_equal(record.record, is_named ? records[i].record : 0);
        assert_int_equal(record.length, 2);
        assert_memory_equal(record.data, records[i].data, 4);
    }
    assert_int_equal(i, 2);
    assert_int_equal(cursor, packet.dataLength);
}

TEST(responses_of_14_and_both_packets_of_15_have_records_with_data)
{
    const char *written = "15 16 06 0004 0001 0002 0DFE0020 06 0003 0009 0002 33CD0040";

    carries_data(MBM_PACKET_RESPONSE, 0x14, "14 0C 05 06 0DFE 0020 05 06 33CD 0040", 0);
    carries_data(MBM_PACKET_REQUEST, 0x15, written, 1);
    carries_data(MBM_PACKET_RESPONSE, 0x15, written, 1);
}

TEST(an_impossible_record_is_not_added)
{
    static uint8_t data[500];
    static const struct {
        uint8_t status, kind, function;
        mbm_record record;
    } refused[] = {
        {MBM_ILLEGAL_DATA_ADDRESS, MBM_PACKET_REQUEST, 0x14, {NULL, 0, 1, 1}},
        {MBM_ILLEGAL_DATA_ADDRESS, MBM_PACKET_REQUEST, 0x14, {NULL, 1, 9999, 2}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x14, {NULL, 1, 1, 0}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x14, {NULL, 1, 1, 125}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x15, {data, 1, 1, 0}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x15, {data, 1, 1, 250}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_REQUEST, 0x15, {data, 1, 1, 0x8000}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_RESPONSE, 0x14, {data, 0, 0, 0}},
        {MBM_ILLEGAL_DATA_VALUE, MBM_PACKET_RESPONSE, 0x14, {data, 0, 0, 127}},
        {MBM_ILLEGAL_FUNCTION, MBM_PACKET_REQUEST, 0x18, {data, 1, 1, 1}},
        {MBM_INVALID_ARGUMENT, MBM_PACKET_REQUEST, 0x15, {NULL, 1, 1, 1}},
        {MBM_INVALID_ARGUMENT, MBM_PACKET_EXCEPTION, 0x15, {data, 1, 1, 1}},
    };
    uint8_t storage[600];

    for (size_t i = 0; i < COUNT(refused); i++) {
        mbm_packet packet = {0};

        packet.kind = refused[i].kind;
        packet.function = refused[i].function;
        IS(refused[i].status,
           mbm_packet_addRecord(&packet, storage, sizeof storage, &refused[i].record));
        assert_int_equal(packet.dataLength, 0);
        assert_null(packet.data);
    }
}

TEST(groups_that_fill_the_storage_leave_the_packet_as_it_was)
{
    uint8_t storage[9], elsewhere[9];
    mbm_packet packet = {.kind = MBM_PACKET_REQUEST, .function = MBM_FC_READ_FILE_RECORD};
    mbm_record record = {NULL, 4, 1, 2};

    IS(MBM_BUFFER_TOO_SMALL, mbm_packet_addRecord(&packet, storage, 6, &record));
    OK(mbm_packet_addRecord(&packet, storage, 7, &record));
    IS(MBM_BUFFER_TOO_SMALL, mbm_packet_addRecord(&packet, storage, 9, &record));
    assert_int_equal(packet.dataLength, 7);
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, elsewhere, 9, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, storage, 6, &record));
    packet.function = MBM_FC_WRITE_FILE_RECORD;
    packet.dataLength = 0;
    record.data = storage;
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, storage, 9, &record));
}

TEST(a_device_identification_is_made_of_objects)
{
    const mbm_object objects[] = {
        {(const uint8_t *)"mbm", 3, 0}, {NULL, 0, 1}, {(const uint8_t *)"V2.11", 5, 2}};
    uint8_t storage[14], pdu[21], wanted[21];
    mbm_packet packet = {.kind = MBM_PACKET_RESPONSE,
                         .function = MBM_FC_ENCAPSULATED_INTERFACE_TRANSPORT,
                         .meiType = MBM_MEI_READ_DEVICE_IDENTIFICATION,
                         .readDeviceIdCode = MBM_DEVICE_ID_BASIC,
                         .conformity = 1};
    mbm_object object;
    uint16_t length, cursor = 0, i;

    for (i = 0; i < 3; i++)
        OK(mbm_packet_addObject(&packet, storage, sizeof storage, &objects[i]));
    IS(MBM_BUFFER_TOO_SMALL, mbm_packet_addObject(&packet, storage, sizeof storage, &objects[1]));
    assert_int_equal(packet.objectCount, 3);
    OK(mbm_frame_build(PDU(NULL, 0), &packet, pdu, sizeof pdu, &length));
    assert_int_equal(length,
                     hex_bytes(wanted, "2B 0E 01 01 00 00 03 00 03 6D626D 01 00 02 05 56322E3131"));
    assert_memory_equal(pdu, wanted, length);

    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_RESPONSE, pdu, length, &packet));
    for (i = 0; mbm_packet_nextObject(&packet, &cursor, &object); i++) {
        assert_int_equal(object.id, i);
        assert_int_equal(object.length, objects[i].length);
        if (object.length)
            assert_memory_equal(object.data, objects[i].data, object.length);
    }
    assert_int_equal(i, 3);
    packet.objectCount = 2;
    IS(MBM_MALFORMED_REPLY, mbm_frame_build(PDU(NULL, 0), &packet, wanted, sizeof wanted, &length));
    packet.meiType = MBM_MEI_CANOPEN;
    IS(MBM_ILLEGAL_FUNCTION, mbm_packet_addObject(&packet, pdu + 7, 14, &objects[0]));
}

TEST(other_packets_have_neither_records_nor_objects)
{
    uint8_t pdu[MBM_MAX_PDU];
    mbm_packet packet;
    mbm_record record;
    mbm_object object;

    for (size_t i = 0; i < example_count; i++) {
        uint16_t cursor = 0, other = 0;

        example_load(&examples[i], pdu, &packet);
        if (packet.function != 0x14 && packet.function != 0x15)
            assert_false(mbm_packet_nextRecord(&packet, &cursor, &record));
        if (!packet.objectCount)
            assert_false(mbm_packet_nextObject(&packet, &other, &object));
    }
}

TEST(null_returns_nothing_and_adds_nothing)
{
    uint8_t pdu[MBM_MAX_PDU], storage[16];
    mbm_packet packet;
    mbm_record record = {NULL, 1, 1, 1};
    mbm_object object = {NULL, 0, 0};
    uint16_t cursor = 0, length;

    length = hex_bytes(pdu, "14 07 06 0004 0001 0002");
    OK(mbm_frame_parse(PDU(NULL, 0), MBM_PACKET_REQUEST, pdu, length, &packet));
    assert_false(mbm_packet_nextRecord(NULL, &cursor, &record));
    assert_false(mbm_packet_nextRecord(&packet, NULL, &record));
    assert_false(mbm_packet_nextRecord(&packet, &cursor, NULL));
    assert_false(mbm_packet_nextObject(NULL, &cursor, &object));
    cursor = 0xFFFF;
    assert_false(mbm_packet_nextRecord(&packet, &cursor, &record));
    packet.dataLength = 0;
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(NULL, storage, 16, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, NULL, 16, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addRecord(&packet, storage, 16, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addObject(NULL, storage, 16, &object));
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addObject(&packet, storage, 16, NULL));
    object.length = 1;
    IS(MBM_INVALID_ARGUMENT, mbm_packet_addObject(&packet, storage, 16, &object));
}
