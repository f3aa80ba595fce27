/* Each text of statuses, frames and events is held to its comment in mbm.h. */
#include "mbm.h"
#include "crc.h"
#include "hooked_port.h"
#include "test.h"

enum { TEXT_SUFFICES = 2295 };

static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};

/* --- mbm_status_text, mbm_status_textOf --- */

TEST(every_number_has_a_text)
{
    unsigned status;

    for (status = 0; status < 256; status++) {
        const char *text = mbm_status_text((uint8_t)status);

        assert_non_null(text);
        assert_in_range(strlen(text), 1, 80);
    }
    assert_string_equal(mbm_status_text(MBM_OK), "success");
    assert_string_not_equal(mbm_status_text(MBM_INVALID_CRC), "success");
    assert_string_equal(mbm_status_text(200), "not a status");
}

TEST(a_request_that_was_refused_here_is_no_exception_of_the_device)
{
    static mbm_client client;
    static mbm_clientRequest request;
    static mbm_line line;
    static mbm_node node;
    static uint8_t buffer[MBM_MAX_FRAME];
    static uint16_t words[1];
    static hooked_port wire;
    const mbm_port port = hooked_port_of(&wire);

    for (unsigned status = 0; status < 256; status++) {
        for (unsigned code = 0; code < 256; code++) {
            const char *text = mbm_status_textOf((uint8_t)status, (uint8_t)code);
            int is_refused = code == 0 && status >= 1 && status <= 3;

            assert_int_equal(strstr(text, "nothing was sent") != NULL, is_refused);
            assert_true(is_refused || text == mbm_status_text((uint8_t)status));
            assert_true(!is_refused || strstr(text, "exception") == NULL);
        }
    }
    /* As a master and a client fill both in. */
    wire.step = 500;
    OK(mbm_line_beginRtu(&line, &port, buffer, sizeof buffer));
    OK(mbm_node_begin(&node, &line, 17, words, 1, NULL, 0));
    uint8_t refused = mbm_node_readHoldingRegisters(&node, 0, 126);
    IS(MBM_ILLEGAL_DATA_VALUE, refused);
    assert_string_equal(
        mbm_status_textOf(refused, mbm_node_getExceptionCode(&node)),
        "refused, nothing was sent: the standard or a buffer does not allow the quantity or value");
    OK(mbm_client_beginRtu(&client, &port, buffer, sizeof buffer));
    request.unit = 17;
    request.exception = MBM_ILLEGAL_DATA_ADDRESS;
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_client_readHoldingRegisters(&client, &request, 65535, 2));
    assert_string_equal(mbm_status_textOf(request.status, request.exception),
                        "refused, nothing was sent: the addresses pass 65535");
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 65535, 1));
    while (wire.length == 0)
        IS(MBM_PENDING, mbm_client_poll(&client));
    hooked_port_arrive_rtu(&wire, 17, "\x83\2", 2);
    while (mbm_client_poll(&client) == MBM_PENDING)
        wire.now += 500;
    IS(MBM_ILLEGAL_DATA_ADDRESS, request.status);
    assert_string_equal(mbm_status_textOf(request.status, request.exception),
                        "exception 02: illegal data address");
}

TEST(the_text_of_invalid_argument_mentions_ranges)
{
    assert_non_null(strstr(mbm_status_text(MBM_INVALID_ARGUMENT), "out of range"));
    assert_non_null(strstr(mbm_status_text(MBM_INVALID_ARGUMENT), "NULL"));
    assert_non_null(strstr(mbm_status_text(MBM_BUSY), "hook"));
}

/* --- mbm_frame_text --- */

/* Writes a PDU of `size` bytes, of a shape, that is valid for some function. */
enum { SHAPES = 14 };

static void shape_pdu(uint8_t *pdu, uint16_t size, unsigned shape)
{
    static const uint8_t query[] = {0, 0}, group[] = {6, 0xFF, 0xFF, 0x27, 0x0F, 0xFF, 0xFF},
                         one[] = {6, 0xFF, 0xFF, 0x27, 0x0F, 0, 1, 0xFF, 0xFF},
                         objects[] = {0x0E, 3, 0x83, 0xFF, 0xFF};
    unsigned i, step = shape == 5 ? sizeof group : sizeof one;
    uint8_t count = (uint8_t)(size - 2);

    memset(pdu + 1, 0xFF, size - 1u);
    switch (shape) {
    case 1: pdu[1] = count; break;
    case 2: memcpy(pdu + 1, query, 2); break;
    case 3: pdu[1] = count, pdu[size - 1] = 0; break;
    case 4: /* groups of the reply of function 14 */
        for (pdu[1] = count, i = 2; i + 4 <= size; i += 4)
            pdu[i] = 3, pdu[i + 1] = 6;
        break;
    case 5:
    case 6: /* groups of requests of functions 14 and 15 */
        for (pdu[1] = count, i = 2; i + step <= size; i += step)
            memcpy(pdu + i, shape == 5 ? group : one, step);
        break;
    case 7:
    case 8: /* objects without and with one byte */
        memcpy(pdu + 1, objects, 5);
        pdu[6] = (uint8_t)((size - 7) / (shape - 5));
        for (i = 7; i + shape - 5 <= size; i += shape - 5)
            pdu[i] = 0xFF, pdu[i + 1] = (uint8_t)(shape - 7);
        break;
    case 9:
    case 10: /* 0F and 10 */
        pdu[3] = 0;
        pdu[1] = pdu[2] = 0;
        pdu[4] = (uint8_t)((size - 6) / 2);
        if (shape == 10) {
            pdu[3] = (uint8_t)((8 * (size - 6)) >> 8);
            pdu[4] = (uint8_t)(8 * (size - 6));
        }
        pdu[5] = (uint8_t)(size - 6);
        break;
    case 11: /* 17 */
        memset(pdu + 1, 0, 8);
        pdu[1] = pdu[5] = 0xFF;
        pdu[4] = 125;
        pdu[8] = (uint8_t)((size - 10) / 2);
        pdu[9] = (uint8_t)(size - 10);
        break;
    case 12: /* the reply of 18 */
        pdu[1] = pdu[3] = 0;
        pdu[2] = count - 1;
        pdu[4] = (uint8_t)((size - 5) / 2);
        break;
    case 13: pdu[1] = 0x0D; break; /* another MEI type */
    default: break;
    }
}

TEST(no_text_of_a_frame_is_longer_than_its_comment_says)
{
    static char text[8192];
    uint8_t frame[MBM_MAX_FRAME];
    size_t most = 0;
    uint16_t length, size;

    for (unsigned function = 0; function < 129; function++) {
        for (unsigned shape = 0; shape < SHAPES; shape++) {
            for (length = MBM_MAX_PDU - 16; length <= MBM_MAX_PDU; length++) {
                frame[0] = 255;
                frame[1] = (uint8_t)function;
                shape_pdu(frame + 1, length, shape);
                size = (uint16_t)seal(frame, length + 1u);
                for (uint8_t side = MBM_PACKET_REQUEST; side <= MBM_PACKET_RESPONSE; side++) {
                    OK(mbm_frame_text(&rtu, side, frame, size, text, sizeof text));
                    if (strlen(text) > most)
                        most = strlen(text);
                }
            }
        }
    }
    /* 2000 discrete inputs. */
    assert_int_equal(most + 1, TEXT_SUFFICES);
    frame[0] = 255;
    frame[1] = MBM_FC_READ_DISCRETE_INPUTS;
    shape_pdu(frame + 1, 252, 1);
    size = (uint16_t)seal(frame, 253);
    OK(mbm_frame_text(&rtu, MBM_PACKET_RESPONSE, frame, size, text, TEXT_SUFFICES));
    IS(MBM_BUFFER_TOO_SMALL,
       mbm_frame_text(&rtu, MBM_PACKET_RESPONSE, frame, size, text, TEXT_SUFFICES - 1));
    assert_int_equal(strlen(text), TEXT_SUFFICES - 2);
}

TEST(the_longest_text_of_an_event_fits_too)
{
    static char text[2400];
    static mbm_sniffer sniffer;
    static uint8_t buffer[2 * MBM_MAX_FRAME];
    uint8_t frame[MBM_MAX_FRAME] = {255, 2, 0xF8, 0x30, 0x07, 0xD0};
    mbm_event event;

    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, buffer, sizeof buffer));
    mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, frame, (uint16_t)seal(frame, 6), 0);
    assert_int_equal(mbm_sniffer_next(&sniffer, 10000, &event), 1);
    shape_pdu(frame + 1, 252, 1);
    mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, frame, (uint16_t)seal(frame, 253), 20000);
    assert_int_equal(mbm_sniffer_next(&sniffer, 90000, &event), 1);
    OK(mbm_event_text(&event, text, sizeof text));
    assert_in_range(strlen(text), TEXT_SUFFICES, sizeof text - 1);
    IS(MBM_BUFFER_TOO_SMALL, mbm_event_text(&event, text, 9));
    assert_string_equal(text, "unit 255");
    IS(MBM_INVALID_ARGUMENT, mbm_event_text(&event, NULL, 9));
    IS(MBM_BUFFER_TOO_SMALL, mbm_event_text(&event, text, 0));
}

/* --- mbm_version: one number, in Cargo.toml --- */

/* The version of a Cargo.toml. */
static void read_version(const char *path, char *version)
{
    FILE *file = fopen(path, "r");
    char line[200];

    assert_non_null(file);
    while (fgets(line, sizeof line, file))
        if (sscanf(line, "version = \"%19[0-9.]\"", version) == 1)
            break;
    (void)fclose(file);
}

TEST(the_version_is_that_of_the_packages_in_header_and_archive)
{
    char numbers[20], package[20];

    snprintf(numbers, sizeof numbers, "%d.%d.%d", MBM_VERSION_MAJOR, MBM_VERSION_MINOR,
             MBM_VERSION_PATCH);
    assert_string_equal(MBM_VERSION, numbers);
    assert_string_equal(mbm_version(), numbers);
    read_version("Cargo.toml", package);
    assert_string_equal(package, numbers);
}
