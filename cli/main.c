/* mbm: one tool for Modbus devices. This file chooses the command. */
#include "options.h"
#include "mbm.h"
#include "report.h"

#include <argp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct command {
    const char *name, *what;
    int (*run)(int argc, char **argv);
} command;

static const command commands[] = {
    {"read", "read values once or again and again, as a table, CSV or JSON", read_command},
    {"write", "write values", write_command},
    {"call", "send any request, given as hexadecimal bytes", call_command},
    {"scan", "find the units that answer, and at which rate", scan_command},
    {"identify", "show what a device says about itself", identify_command},
    {"poll", "read the values of a device file", poll_command},
    {"header", "write a C header from a device file, for firmware", header_command},
    {"import", "make a device file of another program's configuration", import_command},
    {"serve", "be a device, with faults on request", serve_command},
    {"sniff", "decode what others send on a line", sniff_command},
    {"gateway", "pass requests from Modbus TCP to serial lines", gateway_command},
    {"bridge", "pass values between a line and an MQTT broker", bridge_command},
};

enum { COMMANDS = sizeof commands / sizeof commands[0] };

static void print_help(FILE *file)
{
    int i;

    fputs("Usage: mbm COMMAND [OPTION...] LINE ...\n"
          "Reads, writes, tests and serves Modbus devices.\n\n"
          "Commands:\n",
          file);
    for (i = 0; i < COMMANDS; i++)
        fprintf(file, "  %-10s %s\n", commands[i].name, commands[i].what);
    fputs("\nOptions:\n"
          "  --help     show this text; mbm COMMAND --help: the options of a command\n"
          "  --version  show the version\n\n"
          "Examples:\n"
          "  mbm read tcp://192.168.0.7 100 10\n"
          "  mbm write 'rtu:/dev/ttyUSB0?baud=9600&parity=none' --unit 17 100 1234\n"
          "  mbm scan 'rtu:/dev/ttyUSB0' --rates 9600,19200\n\n" REPORT_EXIT_CODES,
          file);
}

/* The number of letters to insert, delete or replace that turn one word into the other. */
static size_t distance(const char *a, const char *b)
{
    size_t row[64], i, j, length = strlen(b);

    if (length >= sizeof row / sizeof row[0])
        return length;
    for (j = 0; j <= length; j++)
        row[j] = j;
    for (i = 0; a[i]; i++) {
        size_t before = row[0];

        row[0] = i + 1;
        for (j = 0; j < length; j++) {
            size_t least = before + (a[i] != b[j]);

            before = row[j + 1];
            if (row[j] + 1 < least)
                least = row[j] + 1;
            if (before + 1 < least)
                least = before + 1;
            row[j + 1] = least;
        }
    }
    return row[length];
}

static const command *find(const char *name)
{
    const command *nearest = NULL;
    size_t least = 4;
    int i;

    for (i = 0; i < COMMANDS; i++) {
        if (strcmp(commands[i].name, name) == 0)
            return &commands[i];
        if (distance(commands[i].name, name) < least) {
            least = distance(commands[i].name, name);
            nearest = &commands[i];
        }
    }
    if (nearest)
        (void)report(CODE_WRONG, "there is no command \"%s\". Is \"mbm %s\" meant?", name,
                     nearest->name);
    else
        (void)report(CODE_WRONG, "there is no command \"%s\". \"mbm --help\" lists them", name);
    return NULL;
}

static int print_version(void)
{
    printf("mbm %s\n", mbm_version());
    return CODE_DONE;
}

/* Runs a command, which sees its name as that of the program. */
static int run(const command *chosen, int argc, char **argv)
{
    static char name[32];

    snprintf(name, sizeof name, "mbm %s", chosen->name);
    report_name = argv[0] = name;
    return chosen->run(argc, argv);
}

int main(int argc, char **argv)
{
    static char help[] = "--help";
    const char *word = argc > 1 ? argv[1] : "";
    char *of_help[] = {argc > 2 ? argv[2] : NULL, help, NULL}, **words = argv + 1;
    int count = argc - 1;
    const command *chosen;

    argp_err_exit_status = CODE_WRONG;
    report_begin();
    report_catch_signals();
    if (strcmp(word, "--version") == 0 || strcmp(word, "-V") == 0)
        return print_version();
    if (argc < 2 || strcmp(word, "--help") == 0 || strcmp(word, "-?") == 0 ||
        (strcmp(word, "help") == 0 && argc == 2)) {
        print_help(argc < 2 ? stderr : stdout);
        return argc < 2 ? CODE_WRONG : CODE_DONE;
    }
    if (argc > 2 && strcmp(word, "help") == 0) {
        words = of_help;
        count = 2;
    }
    chosen = find(words[0]);
    return chosen ? run(chosen, count, words) : CODE_WRONG;
}
