/* mbm write: writes values. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "advice.h"
#include "commands.h"
#include "line.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <stdio.h>
#include <string.h>

/* Stands for the minus of a value, which argp would take for an option. */
enum { MINUS = 1 };

static line at;
static place where;
static const char *address_text;
static char *value_texts[MBM_MAX_WRITE_BITS + 1];
static unsigned value_count;
static int is_multiple;

static uint16_t address, total; /* registers or coils */
static uint16_t words[MBM_MAX_WRITE_BITS + VALUE_WORDS];
static uint8_t bits[MBM_MAX_WRITE_BITS / 8];

/* --- the command line --- */

enum { MULTIPLE = 1 };

static void read_text(const struct argp_state *state, const char *text)
{
    mbm_registers registers;
    const char *c;

    for (c = text; *c; c++)
        if (!isascii((unsigned char)*c))
            options_wrong(state, "VALUE \"%s\" is not ASCII text", text);
    if (value_count != 1 || strlen(text) > 2 * MBM_MAX_WRITE_REGISTERS || !*text)
        options_wrong(state, "a write has one text, of 1 to %d characters",
                      2 * MBM_MAX_WRITE_REGISTERS);
    total = value_registers(MBM_TYPE_TEXT, (uint16_t)strlen(text));
    (void)mbm_registers_intoWords(&registers, words, total, 0);
    (void)mbm_registers_setString(&registers, 0, (uint16_t)(2 * total), options.form.order, text);
}

static void read_number(const struct argp_state *state, const char *text)
{
    const char *wrong;
    const uint16_t added = value_read(&options.form, text, strlen(text), words + total, &wrong);

    if (added == 0 && options.form.type == MBM_TYPE_BIT)
        options_wrong(state, "VALUE \"%s\" is no value of a coil: 1 is on, and 0 is off", text);
    if (added == 0)
        options_wrong(state, "VALUE \"%s\" %s%s%s", text, wrong,
                      strstr(wrong, "range") ? " of the type " : "",
                      strstr(wrong, "range") ? value_type_names[options.form.type] : "");
    total = (uint16_t)(total + added);
}

static void check_arguments(const struct argp_state *state)
{
    const int is_bits = options.table == MBM_TABLE_COILS;
    const uint16_t most = is_bits ? MBM_MAX_WRITE_BITS : MBM_MAX_WRITE_REGISTERS;
    unsigned i;

    if (value_count == 0)
        options_wrong(state, "%s is missing",
                      !where.text     ? "LINE"
                      : !address_text ? "ADDRESS"
                                      : "VALUE");
    if (!is_bits && options.table != MBM_TABLE_HOLDING_REGISTERS)
        options_wrong(state, "the table %s cannot be written: only coils and holding can",
                      value_table_names[options.table]);
    options_check_unit(state, &where, 1);
    address = options_address(state, address_text);
    if (options.form.type == MBM_TYPE_TEXT)
        read_text(state, value_texts[0]);
    else
        for (i = 0; i < value_count && total <= most; i++)
            read_number(state, value_texts[i]);
    if (total > most)
        options_wrong(state, "one request writes at most %u %s", most,
                      is_bits ? "coils" : "registers");
    if (address + total > 65536)
        options_wrong(state, "%u addresses from %u on end beyond the last address, 65535", total,
                      address);
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case MULTIPLE: is_multiple = 1; return 0;
    case ARGP_KEY_ARG:
        if (*text == MINUS)
            *text = '-';
        if (state->arg_num == 0)
            options_place(state, &where, text, 0);
        else if (state->arg_num == 1)
            address_text = text;
        else if (value_count < sizeof value_texts / sizeof value_texts[0])
            value_texts[value_count++] = text;
        return 0;
    case ARGP_KEY_SUCCESS: check_arguments(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"multiple", MULTIPLE, NULL, 0,
     "Write one coil or register with function 0F or 10 too, not 05 or 06", 1},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {{&options_unit, 0, NULL, 0},
                                             {&options_values, 0, NULL, 0},
                                             {&options_client, 0, NULL, 0},
                                             {NULL, 0, NULL, 0}};

static const struct argp arguments = {
    texts,
    parse,
    "LINE ADDRESS VALUE...",
    "Writes values to coils or holding registers from ADDRESS on, 0 to 65535, in one request. A "
    "coil's value is 0 or 1.\v"
    "Examples: a register of unit 17; two coils; a float\n\n"
    "  mbm write rtu:/dev/ttyUSB0 --unit 17 100 1234\n"
    "  mbm write tcp://192.168.0.7 --table coils 3 1 0\n"
    "  mbm write tcp://192.168.0.7 --type float --order CDAB 200 -21.5\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

/* Whether the word after an option is its argument. */
static int takes_next(const struct argp *of, const char *word)
{
    const size_t length = strlen(word);
    const struct argp_option *option = of->options;
    const struct argp_child *child = of->children;

    for (; option && option->name; option++)
        if (option->arg &&
            (strncmp(word, "--", 2) == 0 ? strncmp(option->name, word + 2, length - 2) == 0
                                         : length == 2 && word[0] == '-' && word[1] == option->key))
            return 1;
    for (; child && child->argp; child++)
        if (takes_next(child->argp, word))
            return 1;
    return 0;
}

/* Hides the minus of negative values, but not that of an option's argument. */
static void hide_minus(int argc, char **argv)
{
    int i;

    for (i = 2; i < argc && strcmp(argv[i - 1], "--") != 0; i++)
        if (argv[i][0] == '-' && (isdigit((unsigned char)argv[i][1]) || argv[i][1] == '.') &&
            !takes_next(&arguments, argv[i - 1]))
            argv[i][0] = MINUS;
}

/* --- writing --- */

static uint8_t queue(mbm_clientRequest *request, unsigned *function)
{
    const int is_one = total == 1 && !is_multiple;
    uint16_t i;

    if (options.table == MBM_TABLE_COILS) {
        for (i = 0; i < total; i++)
            (void)mbm_bits_set(bits, 0, total, i, (uint8_t)words[i]);
        request->data = bits;
        *function = is_one ? MBM_FC_WRITE_SINGLE_COIL : MBM_FC_WRITE_MULTIPLE_COILS;
        return is_one ? mbm_client_writeSingleCoil(&at.client, request, address, words[0] != 0)
                      : mbm_client_writeMultipleCoils(&at.client, request, address, total);
    }
    request->data = words;
    *function = is_one ? MBM_FC_WRITE_SINGLE_REGISTER : MBM_FC_WRITE_MULTIPLE_REGISTERS;
    return is_one ? mbm_client_writeSingleRegister(&at.client, request, address, words[0])
                  : mbm_client_writeMultipleRegisters(&at.client, request, address, total);
}

static void show(const mbm_clientRequest *request, unsigned function)
{
    const char *what = options.table == MBM_TABLE_COILS
                           ? (total == 1 ? "coil" : "coils")
                           : (total == 1 ? "holding register" : "holding registers");
    char status[256];
    cJSON *all;

    if (!options.is_json) {
        if (request->status == MBM_OK && !options.is_quiet)
            printf("unit %u: wrote %u %s from address %u on, function %02X\n", options.unit, total,
                   what, (unsigned)address + options.is_one_based, function);
        return;
    }
    all = cJSON_CreateObject();
    cJSON_AddNumberToObject(all, "unit", options.unit);
    cJSON_AddStringToObject(all, "table", value_table_names[options.table]);
    cJSON_AddNumberToObject(all, "address", address + options.is_one_based);
    cJSON_AddNumberToObject(all, "count", total);
    cJSON_AddNumberToObject(all, "function", function);
    report_json(all, request->status, request->exception, line_status(&at, request, status));
}

int write_command(int argc, char **argv)
{
    mbm_clientRequest request = MBM_INIT;
    unsigned function;

    hide_minus(argc, argv);
    argp_parse(&arguments, argc, argv, 0, NULL, NULL);
    advice_keep(argc, argv, address_text);
    request.unit = options.unit;
    if (line_open(&at, &where) == CODE_DONE && line_connect(&at) == CODE_DONE) {
        request.status = line_call(&at, &request, queue(&request, &function));
        if (request.status != MBM_OK)
            (void)line_failure(&at, &request, ADVICE_WRITE);
        show(&request, function);
    }
    line_close(&at);
    return report_code;
}
