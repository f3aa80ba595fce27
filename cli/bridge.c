/* Publishes the values of device files to an MQTT broker, and writes what the broker sends: `mbm
 * bridge`. docs/mqtt.md has the topics and the options. */
#include "bridge_file.h"
#include "device_plan.h"
#include "discovery.h"
#include "options.h"
#include "report.h"
#include "service.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { UNREACHED_MS = 5000 /* after so long without the broker it is reported */ };

typedef struct bridge {
    bridge_setup given, setup; /* what the command line says, and what is in force */
    broker_options to;
    const char *path;      /* of the file; NULL: the command line has the lines */
    const char *last_line; /* of the command line, whose FILE follows; NULL: it was there */
    service service;
    bridge_settings settings;
    bridge_line *lines[BRIDGE_LINES];
    unsigned line_count;
    unsigned long reloads, refused_reloads;
    uint32_t aloneSinceMs; /* since when there is no broker */
    int is_alone;          /* and that was reported */
    int is_check;
    found_round round;
    int has_events; /* of the broker, as far as is known */
} bridge;

/* --- the files again --- */

/* A line as it will be: one that is there or a new one, with a table to read, or NULL to go on. */
typedef struct next_line {
    bridge_line *line;
    bridge_table *table;
    place where;
    int is_new;
} next_line;

static bridge_line *find_line(bridge *b, const char *text, const char *topic)
{
    unsigned i;

    for (i = 0; i < b->line_count; i++)
        if (strcmp(b->lines[i]->text, text) == 0 && strcmp(b->lines[i]->topic, topic) == 0)
            return b->lines[i];
    return NULL;
}

/* Prepares a line of a setup. Returns an exit code, with the reason in `wrong`. */
static int prepare(bridge *b, const bridge_setup *from, unsigned index, next_line *next,
                   char wrong[YAML_FILE_WRONG_BYTES])
{
    const char *file = from->lines[index].path, *why, *lost;
    int code;

    next->table =
        bridge_table_read(file, bridge_setup_gap(from), bridge_setup_function(from), &code, wrong);
    if (!next->table)
        return code;
    next->where = from->lines[index].place;
    why = device_plan_check(&next->table->fields, file, next->where.framing);
    if (why) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s", why);
        return CODE_WRONG;
    }
    why = line_add_reach(&next->where, &next->table->fields.reach, options.in_flight, &lost);
    if (why) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: %s", file, why);
        return CODE_WRONG;
    }
    if (lost)
        report_log(REPORT_WARNING, "%s: %s: %s", from->lines[index].text, file, lost);
    next->line = find_line(b, from->lines[index].text, from->lines[index].topic);
    next->is_new = !next->line;
    if (next->is_new)
        next->line = bridge_line_make(&b->settings, from->lines[index].text, file,
                                      from->lines[index].topic, &next->where);
    if (!next->line) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, REPORT_NO_MEMORY);
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
static int prepare_all(bridge *b, const bridge_setup *from, next_line next[BRIDGE_LINES],
                       char wrong[YAML_FILE_WRONG_BYTES])
{
    unsigned i;
    int code = CODE_DONE;

    memset(next, 0, BRIDGE_LINES * sizeof *next);
    for (i = 0; i < from->line_count && code == CODE_DONE; i++)
        code = prepare(b, from, i, &next[i], wrong);
    if (code != CODE_DONE)
        forget(next, from->line_count);
    return code;
}

static void remove_lines(bridge *b, const next_line *next, unsigned count, unsigned *removed)
{
    unsigned i, j;

    for (i = 0; i < b->line_count; i++) {
        for (j = 0; j < count && next[j].line != b->lines[i]; j++)
            ;
        if (j < count)
            continue;
        bridge_line_clear(b->lines[i]);
        bridge_line_end(b->lines[i]);
        (*removed)++;
    }
}

/* Puts a setup in force that was prepared. Lines that both have go on as they are. */
static void apply(bridge *b, next_line next[BRIDGE_LINES], unsigned count)
{
    unsigned i, kept = 0, changed = 0, added = 0, removed = 0;

    remove_lines(b, next, count, &removed);
    b->line_count = 0;
    for (i = 0; i < count; i++) {
        bridge_line *one = next[i].line;

        if (next[i].is_new && bridge_line_begin(one, next[i].table, 1) != CODE_DONE) {
            bridge_table_free(next[i].table);
            bridge_line_end(one);
            continue;
        }
        if (!next[i].is_new)
            bridge_line_reach(one, &next[i].where.reach);
        if (next[i].is_new) {
            bridge_line_connected(one);
            added++;
        } else if (next[i].table) {
            char *file = strdup(b->setup.lines[i].path);

            bridge_line_replace(one, next[i].table);
            free(one->path);
            one->path = file;
            changed++;
        } else {
            kept++;
        }
        b->lines[b->line_count++] = one;
    }
    report_log(REPORT_INFO,
               "the files are in force. Lines kept: %u, with a new device file: %u, removed: %u, "
               "added: %u",
               kept, changed, removed, added);
}

/* The first setting that differs, or NULL. */
static const char *changed_setting(bridge *b, const bridge_setup *next)
{
    int i;

    for (i = 0; i < BRIDGE_SETTINGS; i++) {
        const char *before = b->setup.values[i] ? b->setup.values[i] : "";
        const char *after = next->values[i] ? next->values[i] : "";

        if (strcmp(before, after) != 0)
            return bridge_names[i];
    }
    return NULL;
}

/* Reads the file of the bridge, or takes the lines of the command line. Returns an exit code, with
 * the reason in its `wrong`. */
static int read_setup(bridge *b, bridge_setup *into)
{
    if (bridge_setup_copy(into, &b->given))
        return b->path ? bridge_file_read(into, b->path) : CODE_DONE;
    snprintf(into->wrong, sizeof into->wrong, REPORT_NO_MEMORY);
    return CODE_SYSTEM;
}

static void reload(bridge *b)
{
    static next_line next_lines[BRIDGE_LINES];
    static bridge_setup next;
    char wrong[YAML_FILE_WRONG_BYTES] = "";
    const char *differs;

    service_is_reloading();
    if (read_setup(b, &next) != CODE_DONE) {
        snprintf(wrong, sizeof wrong, "%s", next.wrong);
    } else if ((differs = changed_setting(b, &next)) != NULL) {
        snprintf(wrong, sizeof wrong, "%s: %s has changed, which needs a restart", b->path,
                 differs);
    } else if (prepare_all(b, &next, next_lines, wrong) == CODE_DONE) {
        bridge_setup_free(&b->setup);
        b->setup = next;
        memset(&next, 0, sizeof next);
        apply(b, next_lines, b->setup.line_count);
        b->reloads++;
    }
    if (*wrong) {
        report_log(REPORT_ERROR, "%s. The files before stay in force", wrong);
        b->refused_reloads++;
        bridge_setup_free(&next);
    }
    service_is_ready();
}

/* --- the broker --- */

/* The line whose topic begins this name, or NULL. */
static bridge_line *line_of(bridge *b, const char *name)
{
    unsigned i;

    for (i = 0; i < b->line_count; i++)
        if (strncmp(name, b->lines[i]->below, strlen(b->lines[i]->below)) == 0)
            return b->lines[i];
    return NULL;
}

static void take_events(bridge *b)
{
    static broker_event event;
    unsigned i;

    while (broker_next(&b->settings.mqtt, &event)) {
        bridge_line *owner;

        if (event.kind == BROKER_CONNECTED) {
            for (i = 0; i < b->line_count; i++)
                bridge_line_connected(b->lines[i]);
            broker_publish(&b->settings.mqtt, "status", NULL, "online", 1);
            continue;
        }
        owner = line_of(b, event.bytes);
        if (owner)
            bridge_line_write(owner, event.bytes + strlen(owner->below), &event);
        else
            broker_publish(&b->settings.mqtt, event.bytes, "result", "there is no such field", 0);
    }
}

/* Reports once that there is no broker for some time. Returns how long to sleep at most. */
static uint32_t watch_broker(bridge *b)
{
    if (atomic_load(&b->settings.mqtt.is_connected)) {
        b->aloneSinceMs = line_milliseconds();
        b->is_alone = 0;
        return UINT32_MAX;
    }
    if (!b->is_alone && line_milliseconds() - b->aloneSinceMs >= UNREACHED_MS) {
        report_log(REPORT_WARNING,
                   "the broker %s cannot be reached. The bridge reads on, and tries it again",
                   b->settings.mqtt.address);
        b->is_alone = 1;
    }
    return b->is_alone ? UINT32_MAX : 1000000;
}

/* --- work --- */

/* Sleeps until there is something to do, and notes what it is. */
static void rest(bridge *b, uint32_t micros)
{
    static struct pollfd polls[1 + BRIDGE_LINES + SERVICE_WAITS];
    line *polled[1 + BRIDGE_LINES] = {0};
    nfds_t count = 1, n;
    unsigned i;

    polls[0] = (struct pollfd){b->settings.mqtt.events[0], POLLIN, 0};
    for (i = 0; i < b->line_count; i++) {
        const uint32_t delay = bridge_line_delay(b->lines[i]);

        if (delay < micros)
            micros = delay;
        polled[count] = &b->lines[i]->at;
        count += (nfds_t)line_polls(polled[count], &polls[count]);
    }
    b->has_events = 1;
    if (service_wait(&b->service, polls, count, micros) < 0)
        return;
    b->has_events = polls[0].revents != 0;
    found_port_begin_round(&b->round);
    for (n = 1; n < count; n++)
        line_polled(polled[n], &b->round, &polls[n]);
}

static void work(bridge *b)
{
    unsigned i, polls;

    if (service_reload_is_wanted(&b->service))
        reload(b);
    service_work(&b->service);
    if (b->has_events)
        take_events(b);
    for (i = 0; i < b->line_count; i++) {
        polls = 0;
        /* A poll may leave work that waits for nothing: after a reply the next read is due. */
        do
            bridge_line_poll(b->lines[i]);
        while (++polls < SERVICE_POLLS && bridge_line_delay(b->lines[i]) == 0);
    }
    found_port_end_round(&b->round);
    if (!report_stopped)
        rest(b, watch_broker(b));
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
    {"values_not_available", "Values that are not available, as their devices say.", 0},
};

static void fill_stats(void *context, stats *numbers)
{
    bridge *b = (bridge *)context;
    unsigned i;

    numbers->command = "bridge";
    numbers->kinds = KINDS;
    numbers->count = sizeof KINDS / sizeof KINDS[0];
    numbers->values[0] = (uint64_t)atomic_load(&b->settings.mqtt.is_connected);
    numbers->values[1] = atomic_load(&b->settings.mqtt.connects);
    numbers->values[2] = atomic_load(&b->settings.mqtt.published);
    numbers->values[3] = b->settings.written;
    numbers->values[4] = b->settings.refused;
    numbers->values[5] = atomic_load(&b->settings.mqtt.lost);
    numbers->values[6] = b->reloads;
    numbers->values[7] = b->refused_reloads;
    numbers->values[8] = 0;
    for (i = 0; i < b->line_count; i++)
        numbers->values[8] += bridge_line_not_available(b->lines[i]);
    for (i = 0; i < b->line_count; i++) {
        const line *at = &b->lines[i]->at;
        const int has_link = at->place.kind != PLACE_UDP;

        numbers->lines[numbers->line_count++] =
            (stats_line){.name = *b->lines[i]->topic ? b->lines[i]->topic : b->lines[i]->text,
                         .counters = &at->counters,
                         .link = has_link ? &at->losses : NULL,
                         .is_up = !has_link || mbm_link_state(&at->kept) == MBM_LINK_IS_UP};
    }
}

/* --- the command line --- */

/* The key of an option that sets a setting is SETTING and the number of the setting. */
enum { SETTING = 0x100, CHECK = 0x200 };

/* Sets the setting of an option, whose name has - for the _ of the setting's. */
static void take_value(bridge *b, const struct argp_state *state, int setting, const char *text)
{
    const char *wrong = bridge_setup_value(&b->given, setting, text ? text : "yes");
    char option[32], *at = option;

    snprintf(option, sizeof option, "%s", bridge_names[setting]);
    while ((at = strchr(at, '_')) != NULL)
        *at = '-';
    if (wrong)
        options_wrong(state, "--%s %s", option, wrong);
}

/* Reads a word that is no option: FILE of a bridge, or LINE and FILE by turns. */
static void read_word(bridge *b, const struct argp_state *state, char *text)
{
    const size_t length = strlen(text);
    const char *wrong = NULL;
    place where;

    if (state->arg_num == 0 && length > 5 && strcmp(text + length - 5, ".yaml") == 0) {
        b->path = text;
    } else if (b->path) {
        options_wrong(state, "\"%s\" is one word too many: the lines are in the file", text);
    } else if (state->arg_num % 2 == 0) {
        options_place(state, &where, text, 0);
        b->last_line = text;
    } else {
        wrong = bridge_setup_line(&b->given, b->last_line, text, NULL);
        b->last_line = NULL;
    }
    if (wrong)
        options_wrong(state, "%s", wrong);
}

static void check_options(bridge *b, const struct argp_state *state)
{
    const char *wrong = bridge_setup_check(&b->given, "--");

    if (!b->path && (b->given.line_count == 0 || b->last_line))
        options_wrong(state, "a bridge needs LINE and FILE, or a FILE of a bridge");
    if (wrong && !b->path)
        options_wrong(state, "%s", wrong);
    /* The topics of one line need no name that tells it from others. */
    if (b->given.line_count == 1)
        b->given.lines[0].topic[0] = '\0';
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    bridge *b = (bridge *)state->input;

    if (key >= SETTING && key < SETTING + BRIDGE_SETTINGS) {
        take_value(b, state, key - SETTING, text);
        return 0;
    }
    switch (key) {
    case 'b': take_value(b, state, BRIDGE_BROKER, text); return 0;
    case 't': take_value(b, state, BRIDGE_TOPIC, text); return 0;
    case 'q': options.is_quiet = 1; return 0;
    case CHECK: b->is_check = 1; return 0;
    case ARGP_KEY_INIT: state->child_inputs[1] = &b->service; return 0;
    case ARGP_KEY_ARG: read_word(b, state, text); return 0;
    case ARGP_KEY_END: check_options(b, state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"broker", 'b', "HOST[:PORT]", 0, "The broker (localhost; port 1883, with --ca 8883)", 1},
    {"topic", 't', "TOPIC", 0, "The beginning of all topics (modbus)", 1},
    {"id", SETTING + BRIDGE_ID, "ID", 0, "The MQTT client identifier (random)", 1},
    {"user", SETTING + BRIDGE_USER, "USER", 0,
     "The user; the password is in the environment variable MQTT_PASSWORD", 1},
    {"ca", SETTING + BRIDGE_CA, "FILE", 0,
     "Connect with TLS; the certificates that sign the broker's", 1},
    {"cert", SETTING + BRIDGE_CERT, "FILE", 0, "The bridge's certificate", 1},
    {"key", SETTING + BRIDGE_KEY, "FILE", 0, "The bridge's key", 1},
    {"keep-alive", SETTING + BRIDGE_KEEP_ALIVE, "TIME", 0,
     "After this time without a sign of the broker it is taken for lost, 5s to 1h (15s)", 1},
    {"plain", SETTING + BRIDGE_PLAIN, NULL, 0, "Publish plain text instead of JSON", 2},
    {"all", SETTING + BRIDGE_ALL, NULL, 0, "Publish every reading, not only changes", 2},
    {"discovery", SETTING + BRIDGE_DISCOVERY, "WHOSE", 0,
     "Publish for each field how homeassistant finds it, by MQTT discovery", 2},
    {"discovery-prefix", SETTING + BRIDGE_DISCOVERY_PREFIX, "PREFIX", 0,
     "The beginning of the topics of discovery (homeassistant)", 2},
    {"gap", SETTING + BRIDGE_GAP, "N", 0,
     "Registers between two fields that one request may read too, 0 to 123 (gap of FILE, or 0)", 3},
    {"write-function", SETTING + BRIDGE_WRITE_FUNCTION, "WORD", 0,
     "How fields are written whose FILE does not say it: single, with functions 05 and 06, or "
     "multiple, with 0F and 10 (as many values as there are)",
     3},
    {"check", CHECK, NULL, 0, "Only check the command line and the files", 4},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 4},
    {0}};

static const struct argp_child children[] = {{.argp = &options_request, .group = 3},
                                             {.argp = &options_service},
                                             {.argp = &options_trace, .group = 4},
                                             {0}};
static const struct argp parser = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE FILE [LINE FILE]...\nBRIDGE.yaml",
    .doc =
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
    .children = children};

/* Opens all lines. Each terminal of the command line must be there. Returns an exit code. */
static int begin_lines(bridge *b)
{
    static next_line next[BRIDGE_LINES];
    char wrong[YAML_FILE_WRONG_BYTES];
    unsigned i;
    int code = prepare_all(b, &b->setup, next, wrong);

    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    if (b->is_check)
        forget(next, b->setup.line_count);
    for (i = 0; !b->is_check && i < b->setup.line_count; i++) {
        code = bridge_line_begin(next[i].line, next[i].table, b->path != NULL);
        if (code != CODE_DONE) {
            forget(next + i, b->setup.line_count - i);
            return code;
        }
        b->lines[b->line_count++] = next[i].line;
    }
    return CODE_DONE;
}

/* Begins all of it. Returns an exit code, after reporting the reason if it is not CODE_DONE. */
static int begin(bridge *b)
{
    int code = read_setup(b, &b->setup);

    if (code != CODE_DONE)
        return report(code, "%s", b->setup.wrong);
    if (!bridge_setup_options(&b->setup, &b->to))
        return report(CODE_SYSTEM, REPORT_NO_MEMORY);
    b->settings.is_plain = (uint8_t)bridge_setup_is(&b->setup, BRIDGE_PLAIN);
    b->settings.is_every = (uint8_t)bridge_setup_is(&b->setup, BRIDGE_ALL);
    b->settings.has_discovery = b->setup.values[BRIDGE_DISCOVERY] != NULL;
    if (b->setup.values[BRIDGE_DISCOVERY_PREFIX])
        b->settings.discovery_prefix = strdup(b->setup.values[BRIDGE_DISCOVERY_PREFIX]);
    code = begin_lines(b);
    if (b->is_check)
        return code;
    if (code == CODE_DONE)
        code = service_begin(&b->service, fill_stats, b);
    if (code == CODE_DONE)
        code = broker_begin(&b->settings.mqtt, &b->to);
    b->aloneSinceMs = line_milliseconds();
    return code;
}

int bridge_command(int argc, char **argv)
{
    static bridge data;
    bridge *b = &data;
    int code;

    b->has_events = 1;
    argp_parse(&parser, argc, argv, 0, NULL, b);
    code = begin(b);
    if (code == CODE_DONE && !b->is_check) {
        service_is_ready();
        while (!report_stopped)
            work(b);
        service_end(&b->service);
        broker_end(&b->settings.mqtt);
        if (!options.is_quiet)
            fprintf(stderr, "%s: messages published: %lu, writes lost: %lu.\n", report_name,
                    atomic_load(&b->settings.mqtt.published), atomic_load(&b->settings.mqtt.lost));
    }
    while (b->line_count > 0)
        bridge_line_end(b->lines[--b->line_count]);
    bridge_setup_free(&b->setup);
    bridge_setup_free(&b->given);
    return code;
}
