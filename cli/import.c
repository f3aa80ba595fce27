/* mbm import: makes a device file of another program's configuration. */
#include "import.h"

#include "options.h"
#include "report.h"

#include <string.h>

static const char *const FORMS[] = {"homeassistant", "telegraf", "sunspec", NULL};
static int (*const READERS[])(import *j) = {import_homeassistant, import_telegraf, import_sunspec};

typedef struct job {
import made;
    int form;
} job;

enum { HUB = 0x2000, ADDRESS, COUNT };

static error_t parse(int key, char *text, struct argp_state *state)
{
    job *j = (job *)state->input;

    switch (key) {
    case 'o': j->made.output = text; return 0;
    case HUB: j->made.hub = text; return 0;
    case ADDRESS:
        j->made.address = (uint32_t)options_number(state, "--address", text, 0, 65535);
        j->made.has_address = 1;
        return 0;
    case COUNT:
        j->made.count = (uint32_t)options_number(state, "--count", text, 1, 1000);
        j->made.has_count = 1;
        return 0;
    case 'u':
        j->made.unit = (uint32_t)options_number(state, "--unit", text, 0, 255);
        j->made.has_unit = 1;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0)
            j->form = options_word(state, "WHOSE", text, FORMS);
        else if (state->arg_num == 1)
            j->made.path = text;
        else
            options_too_many(state, text);
        return 0;
    case ARGP_KEY_END:
        if (!j->made.path)
            options_wrong(state, "%s is missing", state->arg_num == 0 ? "WHOSE" : "FILE");
        if (j->made.has_address && strcmp(FORMS[j->form], "sunspec") != 0)
            options_wrong(state, "--address is for sunspec");
        if (j->made.has_count && strcmp(FORMS[j->form], "sunspec") != 0)
            options_wrong(state, "--count is for sunspec");
        if (j->made.hub && strcmp(FORMS[j->form], "sunspec") == 0)
            options_wrong(state, "--hub is for homeassistant and telegraf");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"output", 'o', "FILE", 0, "Write to this file, not to standard output", 1},
    {"unit", 'u', "ID", 0, "The unit id of fields without one (1)", 1},
    {"hub", HUB, "NAME", 0,
     "Which device, if the file has several: the name or host of a hub of homeassistant, the name or "
     "controller of a plugin of telegraf",
     1},
    {"address", ADDRESS, "N", 0, "Where the model of sunspec begins: the address of its ID", 1},
    {"count", COUNT, "N", 0, "How often the groups of sunspec repeat whose number the device says",
     1},
    {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "WHOSE FILE",
    .doc =
        "Makes a device file of another program's configuration.\v"
        "WHOSE is one of\n"
        "  homeassistant  the YAML of the integration modbus\n"
        "  telegraf       the TOML of inputs.modbus\n"
        "  sunspec        the description of a model in JSON, as SunSpec publishes it\n\n"
        "What cannot be taken over is named on stderr, line by line; the exit code is 2 then, and "
        "the device file has the rest. docs/tool.md says more.\n\n"
        "  mbm import homeassistant configuration.yaml -o meter.yaml\n"
        "  mbm import sunspec model_103.json --address 40069 -o inverter.yaml\n"};

int import_command(int argc, char **argv)
{
    static job data;
    job *j = &data;
    int code;

    argp_parse(&arguments, argc, argv, 0, NULL, j);
    code = READERS[j->form](&j->made);
    if (code == CODE_DONE)
        code = import_write(&j->made);
    import_free(&j->made);
    return code;
}
