/* mbm write: writes values. */
#include "advice.h"
#include "device.h"
#include "line.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <stdio.h>
#include <string.h>

/* Stands for the minus of a value, which argp would take for an option. */
enum { MINUS = 1 };

typedef struct writing {
    line at;
    place where;
    const char *address_text;
    char *value_texts[MBM_MAX_WRITE_BITS + 1];
    unsigned value_count;
    uint8_t function;        /* DEVICE_BY_SIZE, DEVICE_SINGLE or DEVICE_MULTIPLE */
    uint16_t address, total; /* registers or coils */
    uint16_t words[MBM_MAX_WRITE_BITS + VALUE_WORDS];
    uint8_t bits[MBM_MAX_WRITE_BITS / 8];
} writing;

/* --- the command line --- */

enum { MULTIPLE = 1, WRITE_FUNCTION };

static void read_text(writing *w, const struct argp_state *state, const char *text)
{
    const int is_pair = value_registers(options.form.type, 2) == 1;
    const unsigned most = (is_pair ? 2u : 1u) * MBM_MAX_WRITE_REGISTERS;
    mbm_registers registers;
    const char *c, *wrong;

    for (c = text; *c; c++)
        if (!isascii((unsigned char)*c))
            options_wrong(state, "VALUE \"%s\" is not ASCII text", text);
    if (w->value_count != 1 || strlen(text) > most || !*text)
        options_wrong(state, "a write has one text, of 1 to %u characters", most);
    w->total = value_registers(options.form.type, (uint16_t)strlen(text));
    (void)mbm_registers_intoWords(&registers, w->words, w->total, 0);
    wrong = value_set_text(&options.form, &registers, 0,
                           (uint16_t)(is_pair ? 2 * w->total : w->total), text);
    if (wrong)
        options_wrong(state, "VALUE \"%s\" %s", text, wrong);
}

static void read_number(writing *w, const struct argp_state *state, const char *text)
{
    const char *wrong;
    const uint16_t added =
        conversion_read(&options.form, text, strlen(text), w->words + w->total, &wrong);

    if (added == 0 && options.form.type == MBM_TYPE_BIT)
        options_wrong(state, "VALUE \"%s\" is no value of a coil: 1 is on, and 0 is off", text);
    if (added == 0)
        options_wrong(state, "VALUE \"%s\" %s%s%s", text, wrong,
                      strstr(wrong, "range") ? " of the type " : "",
                      strstr(wrong, "range") ? value_type_name(options.form.type) : "");
    w->total = (uint16_t)(w->total + added);
}

static void check_arguments(writing *w, const struct argp_state *state)
{
    const int is_bits = options.table == MBM_TABLE_COILS;
    const uint16_t most = is_bits ? MBM_MAX_WRITE_BITS : MBM_MAX_WRITE_REGISTERS;
    unsigned i;

    if (w->value_count == 0)
        options_wrong(state, "%s is missing",
                      !w->where.text     ? "LINE"
                      : !w->address_text ? "ADDRESS"
                                         : "VALUE");
    if (!is_bits && options.table != MBM_TABLE_HOLDING_REGISTERS)
        options_wrong(state, "the table %s cannot be written: only coils and holding can",
                      value_table_names[options.table]);
    options_check_unit(state, &w->where, 1);
    w->address = options_address(state, w->address_text);
    if (value_is_text(options.form.type))
        read_text(w, state, w->value_texts[0]);
    else
        for (i = 0; i < w->value_count && w->total <= most; i++)
            read_number(w, state, w->value_texts[i]);
    if (w->total > most)
        options_wrong(state, "one request writes at most %u %s", most,
                      is_bits ? "coils" : "registers");
    if (w->function == DEVICE_SINGLE && w->total > 1)
        options_wrong(state, "--write-function single writes one %s, and these are %u",
                      is_bits ? "coil" : "register", w->total);
    if (w->address + w->total > 65536)
        options_wrong(state, "%u addresses from %u on end beyond the last address, 65535", w->total,
                      w->address);
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    writing *w = (writing *)state->input;

    switch (key) {
    case MULTIPLE: w->function = DEVICE_MULTIPLE; return 0;
    case WRITE_FUNCTION:
        w->function =
            (uint8_t)(1 + options_word(state, "--write-function", text, device_functions));
        return 0;
    case ARGP_KEY_ARG:
        if (*text == MINUS)
            *text = '-';
        if (state->arg_num == 0)
            options_place(state, &w->where, text, 0);
        else if (state->arg_num == 1)
            w->address_text = text;
        else if (w->value_count < sizeof w->value_texts / sizeof w->value_texts[0])
            w->value_texts[w->value_count++] = text;
        return 0;
    case ARGP_KEY_SUCCESS: check_arguments(w, state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"write-function", WRITE_FUNCTION, "WORD", 0,
     "single: only functions 05 and 06; multiple: only 0F and 10 (as many values as there are)", 1},
    {"multiple", MULTIPLE, NULL, 0, "The same as --write-function multiple", 1},
    {0}};

static const struct argp_child children[] = {
    {.argp = &options_unit}, {.argp = &options_values}, {.argp = &options_client}, {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE ADDRESS VALUE...",
    .doc =
        "Writes values to coils or holding registers from ADDRESS on, 0 to 65535, in one request. A "
        "coil's value is 0 or 1.\v"
        "Examples: a register of unit 17; two coils; a float\n\n"
        "  mbm write rtu:/dev/ttyUSB0 --unit 17 100 1234\n"
        "  mbm write tcp://192.168.0.7 --table coils 3 1 0\n"
        "  mbm write tcp://192.168.0.7 --type float --order CDAB 200 -21.5\n\n" PLACE_HELP,
    .children = children};

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

static uint8_t queue(writing *w, mbm_clientRequest *request, unsigned *function)
{
    const int is_one = w->total == 1 && w->function != DEVICE_MULTIPLE;
    uint16_t i;

    if (options.table == MBM_TABLE_COILS) {
        for (i = 0; i < w->total; i++)
            (void)mbm_bits_set(w->bits, 0, w->total, i, (uint8_t)w->words[i]);
        request->data = w->bits;
        *function = is_one ? MBM_FC_WRITE_SINGLE_COIL : MBM_FC_WRITE_MULTIPLE_COILS;
        return is_one ? mbm_client_writeSingleCoil(&w->at.client, request, w->address,
                                                   w->words[0] != 0)
                      : mbm_client_writeMultipleCoils(&w->at.client, request, w->address, w->total);
    }
    request->data = w->words;
    *function = is_one ? MBM_FC_WRITE_SINGLE_REGISTER : MBM_FC_WRITE_MULTIPLE_REGISTERS;
    return is_one ? mbm_client_writeSingleRegister(&w->at.client, request, w->address, w->words[0])
                  : mbm_client_writeMultipleRegisters(&w->at.client, request, w->address, w->total);
}

static void show(writing *w, const mbm_clientRequest *request, unsigned function)
{
    const char *what = options.table == MBM_TABLE_COILS
                           ? (w->total == 1 ? "coil" : "coils")
                           : (w->total == 1 ? "holding register" : "holding registers");
    char status[256];
    cJSON *all;

    if (!options.is_json) {
        if (request->status == MBM_OK && !options.is_quiet)
            printf("unit %u: wrote %u %s from address %u on, function %02X\n", options.unit,
                   w->total, what, (unsigned)w->address + options.is_one_based, function);
        return;
    }
    all = cJSON_CreateObject();
    cJSON_AddNumberToObject(all, "unit", options.unit);
    cJSON_AddStringToObject(all, "table", value_table_names[options.table]);
    cJSON_AddNumberToObject(all, "address", w->address + options.is_one_based);
    cJSON_AddNumberToObject(all, "count", w->total);
    cJSON_AddNumberToObject(all, "function", function);
    report_json(all, request->status, request->exception, line_status(&w->at, request, status));
}

int write_command(int argc, char **argv)
{
    static writing data;
    writing *w = &data;
    mbm_clientRequest request = MBM_INIT;
    unsigned function;

    hide_minus(argc, argv);
    argp_parse(&arguments, argc, argv, 0, NULL, w);
    advice_keep(argc, argv, w->address_text);
    request.unit = options.unit;
    if (line_open(&w->at, &w->where) == CODE_DONE && line_connect(&w->at) == CODE_DONE) {
        request.status = line_call(&w->at, &request, queue(w, &request, &function));
        if (request.status != MBM_OK)
            (void)line_failure(&w->at, &request, ADVICE_WRITE);
        show(w, &request, function);
    }
    line_close(&w->at);
    return report_code;
}
