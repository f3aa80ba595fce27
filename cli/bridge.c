/* Publishes the values of device files to an MQTT broker, and writes what the broker sends: `mbm
 * bridge`. docs/mqtt.md has the topics and the options.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "bridge_file.h"
#include "commands.h"
#include "discovery.h"
#include "options.h"
#include "report.h"
#include "service.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { UNREACHED_MS = 5000 /* after so long without the broker it is reported */ };

/* What the command line says, and what is in force. */
static bridge_setup given, setup;
static broker_options to;
static const char *path; /* of the file; NULL: the command line has the lines */
static bridge_line *lines[BRIDGE_LINES];
static unsigned line_count;
static unsigned long reloads, refused_reloads;
static uint32_t alone_since; /* since when there is no broker */
static int is_alone;         /* and that was reported */
static int is_check;
static int has_events = 1; /* of the broker, as far as is known */

/* --- the files again --- */

/* A line as it will be: one that is there or a new one, with a table to read, or NULL to go on. */
typedef struct next_line {
    bridge_line *line;
    bridge_table *table;
    int is_new;
} next_line;

static bridge_line *find_line(const char *text, const char *topic)
{
    unsigned i;

    for (i = 0; i < line_count; i++)
        if (strcmp(lines[i]->text, text) == 0 && strcmp(lines[i]->topic, topic) == 0)
            return lines[i];
    return NULL;
}

/* Prepares a line of a setup. Returns an exit code, with the reason in `wrong`. */
static int prepare(const bridge_setup *from, unsigned index, next_line *next,
                   char wrong[YAML_FILE_WRONG_BYTES])
{
    const char *file = from->lines[index].path;
    int code;

    next->table = bridge_table_read(file, bridge_setup_gap(from), &code, wrong);
    if (!next->table)
        return code;
    next->line = find_line(from->lines[index].text, from->lines[index].topic);
    next->is_new = !next->line;
    if (next->is_new)
        next->line = bridge_line_make(from->lines[index].text, file, from->lines[index].topic,
                                      &from->lines[index].place);
    if (!next->line) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "not enough memory");
        return CODE_SYSTEM;
    }
    if (!next->is_new && strcmp(next->line->path, file) == 0 &&
        next->line->table->digest == next->table->digest) {
        bridge_table_free(next->table);
        next->table = NULL;
    }
    return CODE_DONE;
}

static void forget(next_line *next, unsigned count)
{
    unsigned i;

    for (i = 0; i < count; i++) {
        bridge_table_free(next[i].table);
        if (next[i].is_new && next[i].line)
            bridge_line_end(next[i].line);
    }
}

/* Prepares all lines of a setup. Returns an exit code, with the reason in `wrong`; nothing is left
 * then. */
static int prepare_all(const bridge_setup *from, next_line next[BRIDGE_LINES],
                       char wrong[YAML_FILE_WRONG_BYTES])
{
    unsigned i;
    int code = CODE_DONE;

    memset(next, 0, BRIDGE_LINES * sizeof *next);
    for (i = 0; i < from->line_count && code == CODE_DONE; i++)
        code = prepare(from, i, &next[i], wrong);
    if (code != CODE_DONE)
        forget(next, from->line_count);
    return code;
}

static void remove_lines(const next_line *next, unsigned count, unsigned *removed)
{
    unsigned i, j;

    for (i = 0; i < line_count; i++) {
        for (j = 0; j < count && next[j].line != lines[i]; j++)
            ;
        if (j < count)
            continue;
        bridge_line_clear(lines[i]);
        bridge_line_end(lines[i]);
        (*removed)++;
    }
}

/* Puts a setup in force that was prepared. Lines that both have go on as they are. */
static void apply(next_line next[BRIDGE_LINES], unsigned count)
{
    unsigned i, kept = 0, changed = 0, added = 0, removed = 0;

    remove_lines(next, count, &removed);
    line_count = 0;
    for (i = 0; i < count; i++) {
        bridge_line *one = next[i].line;

        if (next[i].is_new && bridge_line_begin(one, next[i].table, 1) != CODE_DONE) {
            bridge_table_free(next[i].table);
            bridge_line_end(one);
            continue;
        }
        if (next[i].is_new) {
            bridge_line_connected(one);
            added++;
        } else if (next[i].table) {
            char *file = strdup(setup.lines[i].path);

            bridge_line_replace(one, next[i].table);
            free(one->path);
            one->path = file;
            changed++;
        } else {
            kept++;
        }
        lines[line_count++] = one;
    }
    report_log(REPORT_INFO,
               "the files are in force. Lines kept: %u, with a new device file: %u, removed: %u, "
               "added: %u",
               kept, changed, removed, added);
}

/* The first setting that differs, or NULL. */
static const char *changed_setting(const bridge_setup *next)
{
    int i;

    for (i = 0; i < BRIDGE_SETTINGS; i++) {
        const char *before = setup.values[i] ? setup.values[i] : "";
        const char *after = next->values[i] ? next->values[i] : "";

        if (strcmp(before, after) != 0)
            return bridge_names[i];
    }
    return NULL;
}

/* Reads the file of the bridge, or takes the lines of the command line. Returns an exit code, with
 * the reason in its `wrong`. */
static int read_setup(bridge_setup *into)
{
    if (bridge_setup_copy(into, &given))
        return path ? bridge_file_read(into, path) : CODE_DONE;
    snprintf(into->wrong, sizeof into->wrong, "not enough memory");
    return CODE_SYSTEM;
}

static void reload(void)
{
    static next_line next_lines[BRIDGE_LINES];
    static bridge_setup next;
    char wrong[YAML_FILE_WRONG_BYTES] = "";
    const char *differs;

    service_is_reloading();
    if (read_setup(&next) != CODE_DONE) {
        snprintf(wrong, sizeof wrong, "%s", next.wrong);
    } else if ((differs = changed_setting(&next)) != NULL) {
        snprintf(wrong, sizeof wrong, "%s: %s has changed, which needs a restart", path, differs);
    } else if (prepare_all(&next, next_lines, wrong) == CODE_DONE) {
        bridge_setup_free(&setup);
        setup = next;
        memset(&next, 0, sizeof next);
        apply(next_lines, setup.line_count);
        reloads++;
    }
    if (*wrong) {
        report_log(REPORT_ERROR, "%s. The files before stay in force", wrong);
        refused_reloads++;
        bridge_setup_free(&next);
    }
    service_is_ready();
}

/* --- the broker --- */

/* The line whose topic begins this name, or NULL. */
static bridge_line *line_of(const char *name)
{
    unsigned i;

    for (i = 0; i < line_count; i++)
        if (strncmp(name, lines[i]->below, strlen(lines[i]->below)) == 0)
            return lines[i];
    return NULL;
}

static void take_events(void)
{
    static broker_event event;
    unsigned i;

    while (broker_next(&bridge.mqtt, &event)) {
        bridge_line *owner;

        if (event.kind == BROKER_CONNECTED) {
            for (i = 0; i < line_count; i++)
                bridge_line_connected(lines[i]);
            broker_publish(&bridge.mqtt, "status", NULL, "online", 1);
            continue;
        }
        owner = line_of(event.bytes);
        if (owner)
            bridge_line_write(owner, event.bytes + strlen(owner->below), &event);
        else
            broker_publish(&bridge.mqtt, event.bytes, "result", "there is no such field", 0);
    }
}

/* Reports once that there is no broker for some time. Returns how long to sleep at most. */
static uint32_t watch_broker(void)
{
    if (atomic_load(&bridge.mqtt.is_connected)) {
        alone_since = line_milliseconds();
        is_alone = 0;
        return UINT32_MAX;
    }
    if (!is_alone && line_milliseconds() - alone_since >= UNREACHED_MS) {
        report_log(REPORT_WARNING,
                   "the broker %s cannot be reached. The bridge reads on, and tries it again",
                   bridge.mqtt.address);
        is_alone = 1;
    }
    return is_alone ? UINT32_MAX : 1000000;
}

/* --- work --- */

/* Sleeps until there is something to do, and notes what it is. */
static void rest(uint32_t micros)
{
    static struct pollfd polls[1 + BRIDGE_LINES + SERVICE_WAITS];
    line *polled[1 + BRIDGE_LINES] = {0};
    nfds_t count = 1, n;
    unsigned i;

    polls[0] = (struct pollfd){bridge.mqtt.events[0], POLLIN, 0};
    for (i = 0; i < line_count; i++) {
        const uint32_t delay = bridge_line_delay(lines[i]);

        if (delay < micros)
            micros = delay;
        polled[count] = &lines[i]->at;
        count += (nfds_t)line_polls(polled[count], &polls[count]);
    }
    has_events = 1;
    if (service_wait(polls, count, micros) < 0)
        return;
    has_events = polls[0].revents != 0;
    found_port_begin_round();
    for (n = 1; n < count; n++)
        line_polled(polled[n], &polls[n]);
}

static void work(void)
{
    unsigned i, polls;

    if (service_reload_is_wanted())
        reload();
    service_work();
    if (has_events)
        take_events();
    for (i = 0; i < line_count; i++) {
        polls = 0;
        /* A poll may leave work that waits for nothing: after a reply the next read is due. */
        do
            bridge_line_poll(lines[i]);
        while (++polls < SERVICE_POLLS && bridge_line_delay(lines[i]) == 0);
    }
    found_port_end_round();
    if (!report_stopped)
        rest(watch_broker());
}

static const stats_kind KINDS[] = {
    {"mqtt_connected", "1 while the broker is connected.", 0},
    {"mqtt_connects", "How often the broker was connected.", 1},
    {"mqtt_publishes", "Messages that were published.", 1},
    {"writes", "Writes that a device has confirmed.", 1},
    {"failed_writes", "Writes that were refused or failed.", 1},
    {"lost_writes", "Writes that found no place.", 1},
    {"reloads", "How often files came in force.", 1},
    {"reload_failures", "How often files were refused.", 1},
};

static void fill_stats(stats *numbers)
{
    unsigned i;

    numbers->command = "bridge";
    numbers->kinds = KINDS;
    numbers->count = sizeof KINDS / sizeof KINDS[0];
    numbers->values[0] = (uint64_t)atomic_load(&bridge.mqtt.is_connected);
    numbers->values[1] = atomic_load(&bridge.mqtt.connects);
    numbers->values[2] = atomic_load(&bridge.mqtt.published);
    numbers->values[3] = bridge.written;
    numbers->values[4] = bridge.refused;
    numbers->values[5] = atomic_load(&bridge.mqtt.lost);
    numbers->values[6] = reloads;
    numbers->values[7] = refused_reloads;
    for (i = 0; i < line_count; i++) {
        const line *at = &lines[i]->at;
        const int has_link = at->place.kind != PLACE_UDP;

        numbers->lines[numbers->line_count++] =
            (stats_line){.name = *lines[i]->topic ? lines[i]->topic : lines[i]->text,
                         .counters = &at->counters,
                         .link = has_link ? &at->losses : NULL,
                         .is_up = !has_link || mbm_link_state(&at->kept) == MBM_LINK_IS_UP};
    }
}

/* --- the command line --- */

enum {
    ALL = 0x100,
    CA,
    CERT,
    CHECK,
    DISCOVERY,
    DISCOVERY_PREFIX,
    GAP,
    ID,
    KEEP_ALIVE,
    KEY,
    PLAIN,
    USER
};

static void take_value(const struct argp_state *state, int setting, const char *option,
                       const char *text)
{
    const char *wrong = bridge_setup_value(&given, setting, text);

    if (wrong)
        options_wrong(state, "%s %s", option, wrong);
}

static const char *last_line; /* whose FILE follows; NULL: it was there */

/* Reads a word that is no option: FILE of a bridge, or LINE and FILE by turns. */
static void read_word(const struct argp_state *state, char *text)
{
    const size_t length = strlen(text);
    const char *wrong = NULL;
    place where;

    if (state->arg_num == 0 && length > 5 && strcmp(text + length - 5, ".yaml") == 0) {
        path = text;
    } else if (path) {
        options_wrong(state, "\"%s\" is one word too many: the lines are in the file", text);
    } else if (state->arg_num % 2 == 0) {
        options_place(state, &where, text, 0);
        last_line = text;
    } else {
        wrong = bridge_setup_line(&given, last_line, text, NULL);
        last_line = NULL;
    }
    if (wrong)
        options_wrong(state, "%s", wrong);
}

static void check_options(const struct argp_state *state)
{
    const char *wrong = bridge_setup_check(&given, "--");

    if (!path && (given.line_count == 0 || last_line))
        options_wrong(state, "a bridge needs LINE and FILE, or a FILE of a bridge");
    if (wrong && !path)
        options_wrong(state, "%s", wrong);
    /* The topics of one line need no name that tells it from others. */
    if (given.line_count == 1)
        given.lines[0].topic[0] = '\0';
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 'b': take_value(state, BRIDGE_BROKER, "--broker", text); return 0;
    case 't': take_value(state, BRIDGE_TOPIC, "--topic", text); return 0;
    case ID: take_value(state, BRIDGE_ID, "--id", text); return 0;
    case USER: take_value(state, BRIDGE_USER, "--user", text); return 0;
    case CA: take_value(state, BRIDGE_CA, "--ca", text); return 0;
    case CERT: take_value(state, BRIDGE_CERT, "--cert", text); return 0;
    case KEY: take_value(state, BRIDGE_KEY, "--key", text); return 0;
    case KEEP_ALIVE: take_value(state, BRIDGE_KEEP_ALIVE, "--keep-alive", text); return 0;
    case DISCOVERY: take_value(state, BRIDGE_DISCOVERY, "--discovery", text); return 0;
    case DISCOVERY_PREFIX:
        take_value(state, BRIDGE_DISCOVERY_PREFIX, "--discovery-prefix", text);
        return 0;
    case PLAIN: take_value(state, BRIDGE_PLAIN, "--plain", "yes"); return 0;
    case ALL: take_value(state, BRIDGE_ALL, "--all", "yes"); return 0;
    case GAP: take_value(state, BRIDGE_GAP, "--gap", text); return 0;
    case 'q': options.is_quiet = 1; return 0;
    case CHECK: is_check = 1; return 0;
    case ARGP_KEY_ARG: read_word(state, text); return 0;
    case ARGP_KEY_END: check_options(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"broker", 'b', "HOST[:PORT]", 0, "The broker (localhost; port 1883, with --ca 8883)", 1},
    {"topic", 't', "TOPIC", 0, "The beginning of all topics (modbus)", 1},
    {"id", ID, "ID", 0, "The MQTT client identifier (random)", 1},
    {"user", USER, "USER", 0, "The user; the password is in the environment variable MQTT_PASSWORD",
     1},
    {"ca", CA, "FILE", 0, "Connect with TLS; the certificates that sign the broker's", 1},
    {"cert", CERT, "FILE", 0, "The bridge's certificate", 1},
    {"key", KEY, "FILE", 0, "The bridge's key", 1},
    {"keep-alive", KEEP_ALIVE, "TIME", 0,
     "After this time without a sign of the broker it is taken for lost, 5s to 1h (15s)", 1},
    {"plain", PLAIN, NULL, 0, "Publish plain text instead of JSON", 2},
    {"all", ALL, NULL, 0, "Publish every reading, not only changes", 2},
    {"discovery", DISCOVERY, "WHOSE", 0,
     "Publish for each field how homeassistant finds it, by MQTT discovery", 2},
    {"discovery-prefix", DISCOVERY_PREFIX, "PREFIX", 0,
     "The beginning of the topics of discovery (homeassistant)", 2},
    {"gap", GAP, "N", 0, "Registers between two fields that one request may read too, 0 to 123 (0)",
     3},
    {"check", CHECK, NULL, 0, "Only check the command line and the files", 4},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 4},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {{&options_request, 0, NULL, 3},
                                             {&options_service, 0, NULL, 0},
                                             {&options_trace, 0, NULL, 4},
                                             {NULL, 0, NULL, 0}};
static const struct argp parser = {
    texts,
    parse,
    "LINE FILE [LINE FILE]...\nBRIDGE.yaml",
    "Publishes the values of devices to an MQTT broker, and writes what the broker sends.\v"
    "FILE is a device file; its fields with access write or read-write can be written. Several "
    "lines have topics below the name of their file. BRIDGE.yaml has the keys lines and broker, and "
    "what the options say. docs/mqtt.md describes topics and files.\n\n"
    "SIGHUP reads the files again: broker, and lines that stay the same, stay connected.\n\n"
    "Examples:\n\n"
    "  mbm bridge --broker broker.local tcp://192.168.0.7 meter.yaml\n"
    "  mbm bridge rtu:/dev/ttyUSB0 meter.yaml tcp://192.168.0.7 pump.yaml\n"
    "  mbm bridge --discovery homeassistant tcp://192.168.0.7 pump.yaml\n"
    "  mbm bridge bridge.yaml --metrics 127.0.0.1:9100\n\n" SERVICE_HELP PLACE_HELP,
    children,
    NULL,
    NULL};

/* Opens all lines. Of the command line, each terminal must be there. Returns an exit code. */
static int begin_lines(void)
{
    static next_line next[BRIDGE_LINES];
    char wrong[YAML_FILE_WRONG_BYTES];
    unsigned i;
    int code = prepare_all(&setup, next, wrong);

    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    if (is_check)
        forget(next, setup.line_count);
    for (i = 0; !is_check && i < setup.line_count; i++) {
        code = bridge_line_begin(next[i].line, next[i].table, path != NULL);
        if (code != CODE_DONE) {
            forget(next + i, setup.line_count - i);
            return code;
        }
        lines[line_count++] = next[i].line;
    }
    return CODE_DONE;
}

/* Begins all of it. Returns an exit code, after reporting the reason if it is not CODE_DONE. */
static int begin(void)
{
    int code = read_setup(&setup);

    if (code != CODE_DONE)
        return report(code, "%s", setup.wrong);
    if (!bridge_setup_options(&setup, &to))
        return report(CODE_SYSTEM, "not enough memory");
    bridge.is_plain = (uint8_t)bridge_setup_is(&setup, BRIDGE_PLAIN);
    bridge.is_every = (uint8_t)bridge_setup_is(&setup, BRIDGE_ALL);
    bridge.has_discovery = (uint8_t)bridge_setup_is(&setup, BRIDGE_DISCOVERY);
    if (setup.values[BRIDGE_DISCOVERY_PREFIX])
        discovery_prefix = strdup(setup.values[BRIDGE_DISCOVERY_PREFIX]);
    code = begin_lines();
    if (is_check)
        return code;
    if (code == CODE_DONE)
        code = service_begin(fill_stats);
    if (code == CODE_DONE)
        code = broker_begin(&bridge.mqtt, &to);
    alone_since = line_milliseconds();
    return code;
}

int bridge_command(int argc, char **argv)
{
    int code;

    argp_parse(&parser, argc, argv, 0, NULL, NULL);
    code = begin();
    if (code == CODE_DONE && !is_check) {
        service_is_ready();
        while (!report_stopped)
            work();
        service_end();
        broker_end(&bridge.mqtt);
        if (!options.is_quiet)
            fprintf(stderr, "%s: messages published: %lu, writes lost: %lu.\n", report_name,
                    atomic_load(&bridge.mqtt.published), atomic_load(&bridge.mqtt.lost));
    }
    while (line_count > 0)
        bridge_line_end(lines[--line_count]);
    bridge_setup_free(&setup);
    bridge_setup_free(&given);
    return code;
}
