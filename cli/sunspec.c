/* Walks the chain of SunSpec models in the holding registers of a device.
 *
 * Licence: MIT OR Apache-2.0. */
#include "sunspec.h"

#include "advice.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

/* Registers of the parts of a chain. */
enum { HEAD = 2, TEXT = 16, COMMON = 1, END = 0xFFFF, MOST_MODELS = 500 };

/* "SunS", with which a chain begins. */
enum { FIRST_MARK = 0x5375, SECOND_MARK = 0x6E53 };

static const uint16_t BASES[] = {40000, 0, 50000};

typedef struct walk {
    line *at;
    uint8_t unit;
    uint16_t base;
    mbm_clientRequest request; /* the last one */
} walk;

/* The names of models in the words of the specification; vendors have the numbers from 64001 on. */
static const char *name_of(uint16_t id)
{
    static const struct {
        uint16_t id;
        const char *name;
    } NAMES[] = {{1, "common"},
                 {2, "basic aggregator"},
                 {11, "Ethernet link layer"},
                 {12, "IPv4"},
                 {13, "IPv6"},
                 {16, "simple IP network"},
                 {17, "serial interface"},
                 {101, "inverter, single phase"},
                 {102, "inverter, split phase"},
                 {103, "inverter, three phase"},
                 {111, "inverter, single phase, float"},
                 {112, "inverter, split phase, float"},
                 {113, "inverter, three phase, float"},
                 {120, "nameplate"},
                 {121, "basic settings"},
                 {122, "measurements and status"},
                 {123, "immediate controls"},
                 {124, "storage"},
                 {125, "pricing"},
                 {126, "static volt-VAR"},
                 {127, "frequency-watt parameters"},
                 {128, "dynamic reactive current"},
                 {131, "watt-power factor"},
                 {132, "volt-watt"},
                 {134, "frequency-watt curve"},
                 {145, "extended settings"},
                 {160, "multiple MPPT"},
                 {201, "meter, single phase"},
                 {202, "meter, split phase"},
                 {203, "meter, wye-connected three phase"},
                 {204, "meter, delta-connected three phase"},
                 {211, "meter, single phase, float"},
                 {212, "meter, split phase, float"},
                 {213, "meter, wye-connected three phase, float"},
                 {214, "meter, delta-connected three phase, float"},
                 {302, "irradiance"},
                 {303, "back of module temperature"},
                 {304, "inclinometer"},
                 {305, "location"},
                 {306, "reference point"},
                 {307, "base meteorology"},
                 {308, "mini meteorology"},
                 {401, "string combiner"},
                 {403, "string combiner"},
                 {501, "solar module, float"},
                 {502, "solar module"},
                 {601, "tracker controller"},
                 {701, "DER AC measurement"},
                 {702, "DER capacity"},
                 {703, "DER enter service"},
                 {704, "DER AC controls"},
                 {705, "DER volt-VAR"},
                 {706, "DER volt-watt"},
                 {707, "DER trip, low voltage"},
                 {708, "DER trip, high voltage"},
                 {709, "DER trip, low frequency"},
                 {710, "DER trip, high frequency"},
                 {711, "DER frequency droop"},
                 {712, "DER watt-VAR"},
                 {713, "DER storage capacity"},
                 {714, "DER DC measurement"},
                 {802, "battery base"},
                 {803, "lithium-ion battery bank"},
                 {804, "lithium-ion battery string"},
                 {805, "lithium-ion battery module"},
                 {806, "flow battery"}};
    size_t i;

    for (i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++)
        if (NAMES[i].id == id)
            return NAMES[i].name;
    return id >= 64001 && id < END ? "vendor's" : NULL;
}

/* Reads registers; what the device refuses is read in halves. Returns the status. */
static uint8_t read_registers(walk *w, uint32_t address, uint16_t count, uint16_t *words)
{
    uint8_t status;

    memset(&w->request, 0, sizeof w->request);
    w->request.unit = w->unit;
    w->request.reply = words;
    w->request.replyBytes = (uint16_t)(count * sizeof *words);
    status = line_call(
        w->at, &w->request,
        line_read(w->at, &w->request, MBM_TABLE_HOLDING_REGISTERS, (uint16_t)address, count));
    w->request.status = status;
    if (w->request.exception == 0 || count == 1)
        return status;
    status = read_registers(w, address, count / 2, words);
    return status != MBM_OK ? status
                            : read_registers(w, address + count / 2, (uint16_t)(count - count / 2),
                                             words + count / 2);
}

/* Reads a text of the common model, without what pads it; the text is empty if there is none. */
static void read_text(walk *w, uint32_t address, char text[2 * TEXT + 1])
{
    uint16_t words[TEXT] = {0};
    size_t i, length = 0;

    text[0] = '\0';
    if (read_registers(w, address, TEXT, words) != MBM_OK)
        return;
    for (i = 0; i < 2 * TEXT; i++) {
        const char one = (char)(words[i / 2] >> (i % 2 ? 0 : 8));

        if (one == '\0')
            break;
        text[i] = one > ' ' && one < 0x7F ? one : ' ';
        length = text[i] == ' ' ? length : i + 1;
    }
    text[length] = '\0';
}

/* Finds where the chain begins. Returns an exit code. */
static int find_base(walk *w)
{
    uint16_t words[HEAD] = {0};
    size_t i;

    for (i = 0; i < sizeof BASES / sizeof BASES[0]; i++) {
        const uint8_t status = read_registers(w, BASES[i], HEAD, words);

        if (status == MBM_OK && words[0] == FIRST_MARK && words[1] == SECOND_MARK) {
            w->base = BASES[i];
            return CODE_DONE;
        }
        if (status != MBM_OK && w->request.exception == 0)
            return line_failure(w->at, &w->request, ADVICE_DEVICE);
    }
    return report(
        CODE_EXCEPTION,
        "unit %u has no SunSpec models: none of the holding registers 40000, 0 and 50000 "
        "begins with \"SunS\". Check the unit's number; some devices have SunSpec switched "
        "off",
        w->unit);
}

static void print_base(walk *w, const char *maker, const char *type)
{
    if (!options.is_json)
        printf("unit %u: SunSpec at holding register %u%s%s%s%s\n", w->unit, w->base,
               *maker ? ": " : "", maker, *type ? " " : "", type);
}

static void print_model(walk *w, uint32_t address, uint16_t id, uint16_t length, const char *maker,
                        const char *type)
{
    const char *name = name_of(id);
    cJSON *all;

    if (!options.is_json) {
        printf("%5u  model %5u  %3u registers  %s\n", (unsigned)address, id, length,
               name ? name : "");
        report_flush();
        return;
    }
    all = cJSON_CreateObject();
    cJSON_AddNumberToObject(all, "unit", w->unit);
    cJSON_AddNumberToObject(all, "base", w->base);
    cJSON_AddNumberToObject(all, "address", address);
    cJSON_AddNumberToObject(all, "model", id);
    if (name)
        cJSON_AddStringToObject(all, "name", name);
    cJSON_AddNumberToObject(all, "length", length);
    if (id == COMMON) {
        cJSON_AddStringToObject(all, "manufacturer", maker);
        cJSON_AddStringToObject(all, "device", type);
    }
    report_json(all, MBM_OK, 0, report_words(MBM_OK, 0));
}

int sunspec_scan(line *l, uint8_t unit)
{
    walk data = {.at = l, .unit = unit}, *w = &data;
    char maker[2 * TEXT + 1] = "", type[2 * TEXT + 1] = "";
    uint16_t head[HEAD] = {0};
    uint32_t address;
    unsigned models;
    int code = find_base(w);

    if (code != CODE_DONE)
        return code;
    address = w->base + HEAD;
    for (models = 0; !report_stopped; models++) {
        if (address + HEAD > 65536)
            return report(CODE_DAMAGED,
                          "unit %u: the chain of SunSpec models leads to address %u, beyond the "
                          "last one, 65535: the length of a model before is wrong",
                          unit, (unsigned)address);
        if (read_registers(w, address, HEAD, head) != MBM_OK) {
            char status[256];

            if (w->request.exception == 0)
                return line_failure(l, &w->request, ADVICE_DEVICE);
            return report(CODE_DAMAGED,
                          "unit %u: the chain of SunSpec models leads to address %u, which the "
                          "device refuses: %s. The length of a model before is wrong, or the "
                          "chain has no end",
                          unit, (unsigned)address, line_status(l, &w->request, status));
        }
        if (models == 0 && head[0] == COMMON) {
            read_text(w, address + HEAD, maker);
            read_text(w, address + HEAD + TEXT, type);
        }
        if (models == 0)
            print_base(w, maker, type);
        if (head[0] == END)
            return CODE_DONE;
        if (head[0] == 0 || models == MOST_MODELS)
            return report(CODE_DAMAGED,
                          "unit %u: the chain of SunSpec models has no end: at address %u stands "
                          "model %u. The length of a model before is wrong",
                          unit, (unsigned)address, head[0]);
        print_model(w, address, head[0], head[1], maker, type);
        address += HEAD + (uint32_t)head[1];
    }
    return report_note(CODE_NO_REPLY);
}
