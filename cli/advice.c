/* Chooses the advice after a failure: by the kind of line, the status, the exception, and the words
 * of the command line. */
#include "advice.h"

#include "numbers.h"
#include "options.h"
#include "report.h"

#include <stdio.h>
#include <string.h>

enum { LONGEST_COMMAND = 700 };

/* --- lines --- */

const char *advice_silent(const place *where)
{
    if (place_is_serial(where))
        return "Check the units' numbers, baud rate, parity and wiring";
    return where->kind == PLACE_RTU_OVER_TCP
               ? "Check the units' numbers, and baud rate, parity and wiring behind the device server"
               : "Check the units' numbers; of devices behind a gateway also its line";
}

const char *advice_damaged(const place *where)
{
    if (place_is_serial(where))
        return "Check baud rate, parity, wiring and termination, and that no two devices have the "
               "same unit id";
    return where->kind == PLACE_RTU_OVER_TCP
               ? "Check baud rate, parity and wiring behind the device server, and that no two "
                 "devices have the same unit id"
               : "--trace shows what came";
}

static const char *on_silence(const place *where)
{
    if (place_is_serial(where))
        return "Check the unit's number, baud rate, parity and wiring. A slow device needs a longer "
               "--timeout";
    return where->kind == PLACE_RTU_OVER_TCP
               ? "Check the unit's number, and baud rate, parity and wiring behind the device "
                 "server. A slow device needs a longer --timeout"
               : "Check the unit's number; of a device behind a gateway also its line. A slow "
                 "device needs a longer --timeout";
}

/* --- numbers of manuals --- */

static struct {
    int count;
    char **words;
    const char *address;
} kept;

void advice_keep(int argc, char **argv, const char *address_text)
{
    kept.count = argc;
    kept.words = argv;
    kept.address = address_text;
}

uint8_t advice_manual(uint8_t table, uint32_t number, uint16_t *address)
{
    static const struct {
        uint32_t first, last;
        uint8_t table;
        uint8_t is_bits;
    } ranges[] = {{40001, 49999, MBM_TABLE_HOLDING_REGISTERS, 0},
                  {30001, 39999, MBM_TABLE_INPUT_REGISTERS, 0},
                  {10001, 19999, MBM_TABLE_DISCRETE_INPUTS, 1},
                  {400001, 465536, MBM_TABLE_HOLDING_REGISTERS, 0},
                  {300001, 365536, MBM_TABLE_INPUT_REGISTERS, 0},
                  {100001, 165536, MBM_TABLE_DISCRETE_INPUTS, 1}};
    const uint8_t is_bits = table == MBM_TABLE_COILS || table == MBM_TABLE_DISCRETE_INPUTS;
    size_t i;

    for (i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (number >= ranges[i].first && number <= ranges[i].last && ranges[i].is_bits == is_bits) {
            *address = (uint16_t)(number - ranges[i].first);
            return ranges[i].table;
        }
    return 0;
}

/* Appends a word as a shell reads it. */
static void add_word(char *to, const char *word)
{
    const size_t length = strlen(to);
    const char *quote = !*word || strpbrk(word, " \t\n*?[]{}()<>|&;!#~$`\\\"") ? "'" : "";

    if (length < LONGEST_COMMAND)
        snprintf(to + length, LONGEST_COMMAND + 1 - length, " %s%s%s", quote, word, quote);
}

/* Whether a word gives the table; `is_pair` is set if the next word does. */
static int gives_table(const char *word, int *is_pair)
{
    *is_pair = strcmp(word, "-t") == 0 || strcmp(word, "--table") == 0;
    return *is_pair || strncmp(word, "--table=", 8) == 0 ||
           (strncmp(word, "-t", 2) == 0 && word[1] != '-');
}

/* The command line with another table and address. Returns 0 if it is too long. */
static int rewrite(uint8_t table, uint16_t address, char to[LONGEST_COMMAND + 1])
{
    char number[8];
    int i, is_pair;

    snprintf(to, LONGEST_COMMAND + 1, "%s", report_name);
    snprintf(number, sizeof number, "%u", address + (unsigned)options.is_one_based);
    if (table != options.table && table != MBM_TABLE_HOLDING_REGISTERS) {
        add_word(to, "--table");
        add_word(to, value_table_names[table]);
    }
    for (i = 1; i < kept.count; i++) {
        if (strchr(kept.words[i], '\''))
            return 0;
        if (table != options.table && gives_table(kept.words[i], &is_pair))
            i += is_pair;
        else
            add_word(to, kept.words[i] == kept.address ? number : kept.words[i]);
    }
    return strlen(to) < LONGEST_COMMAND;
}

const char *advice_on_number(uint32_t number)
{
    static const char *const names[] = {
        [MBM_TABLE_DISCRETE_INPUTS] = "discrete input",
        [MBM_TABLE_INPUT_REGISTERS] = "input register",
        [MBM_TABLE_HOLDING_REGISTERS] = "holding register",
    };
    char command[LONGEST_COMMAND + 1];
    uint16_t address;
    const uint8_t table = advice_manual(options.table, number, &address);
    const int is_write = strcmp(report_name, "mbm write") == 0;

    if (table == 0 || !kept.words)
        return "";
    if (is_write && table != MBM_TABLE_HOLDING_REGISTERS)
        return say("In a manual, %u is the %s with address %u, which cannot be written",
                   (unsigned)number, names[table], address);
    if (!rewrite(table, address, command))
        return say("In a manual, %u is the %s with address %u", (unsigned)number, names[table],
                   address);
    return say("In a manual, %u is the %s with address %u:\n  %s", (unsigned)number, names[table],
               address, command);
}

/* --- what a device refuses --- */

static const char *on_address(int about)
{
    const char *advice = "";
    int64_t number;

    switch (about) {
    case ADVICE_READ:
    case ADVICE_WRITE:
        if (kept.address && !number_read(kept.address, 0, 65536, &number))
            advice = advice_on_number((uint32_t)number);
        if (*advice)
            return advice;
        return options.is_one_based
                   ? "Check address and count against the device's manual; if that counts from 0, "
                     "leave out --one-based"
                   : "Check address and count against the device's manual; if that counts from 1, "
                     "use --one-based";
    case ADVICE_FILE:
        return "Check table, address and type in the file against the device's manual; if that "
               "counts from 1, subtract 1, or write \"one_based: yes\" at the head of the file";
    case ADVICE_CALL:
        return "Check address and count in HEX against the device's manual; addresses in a request "
               "count from 0";
    default: return "The device does not have it";
    }
}

static const char *on_exception(int about, uint8_t exception)
{
    const int is_values = about == ADVICE_READ || about == ADVICE_WRITE || about == ADVICE_FILE;

    switch (exception) {
    case MBM_ILLEGAL_FUNCTION:
        return is_values ? "The device does not have this function; values may be in another table"
                         : "The device does not have this function";
    case MBM_ILLEGAL_DATA_ADDRESS: return on_address(about);
    case MBM_ILLEGAL_DATA_VALUE:
        return about == ADVICE_READ   ? "Check the count against the device's manual"
               : about == ADVICE_FILE ? "Check address and type in the file against the device's "
                                        "manual"
               : about == ADVICE_CALL
                   ? "Check HEX against the device's manual"
                   : "Check the count and the values against the device's manual";
    case MBM_SERVER_DEVICE_FAILURE:
        return "The device failed at it: its own display or log may say why";
    case MBM_SERVER_DEVICE_BUSY: return "Try again later";
    case MBM_GATEWAY_PATH_UNAVAILABLE: return "Check the gateway's settings for this unit";
    case MBM_GATEWAY_TARGET_FAILED_TO_RESPOND:
        return "Check the unit's number, and the line behind the gateway";
    default: return "";
    }
}

const char *advice_on(const place *where, int about, uint8_t status, uint8_t exception,
                      const char *why)
{
    if (exception != 0)
        return on_exception(about, exception);
    switch (status) {
    case MBM_RESPONSE_TIMED_OUT:
        if (!why)
            return on_silence(where);
        return place_is_serial(where)
                   ? "Check the unit's number, baud rate, parity and wiring; --trace shows what came"
                   : "--trace shows what came";
    case MBM_INVALID_SLAVE_ID: return "Check the unit's number";
    case MBM_INVALID_CRC: return advice_damaged(where);
    case MBM_LINE_BUSY: return "Is another master on the line?";
    case MBM_INVALID_FUNCTION:
    case MBM_NO_PROGRESS:
    case MBM_MALFORMED_REPLY:
        return why ? "If the receiver hears what is sent, add echo=yes to the name of the line"
                   : "--trace shows what the device sent";
    default: return "";
    }
}
