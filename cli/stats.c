/* Writes statistics as JSON and in Prometheus' text format.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "stats.h"

#include "clock.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The numbers of a line, in the order of line_values. */
static const stats_kind OF_LINE[STATS_OF_LINE] = {
    {"requests", "Requests sent, repetitions too.", 1},
    {"replies", "Replies to these requests, exceptions too.", 1},
    {"exceptions", "Replies that were exceptions.", 1},
    {"timeouts", "Requests without a reply in time.", 1},
    {"bad_crcs", "Requests whose reply was damaged.", 1},
    {"foreign_frames", "Frames of other units and late replies.", 1},
    {"bytes_sent", "Bytes sent.", 1},
    {"bytes_received", "Bytes received.", 1},
    {"reconnects", "How often the line was opened again.", 1},
    {"line_up", "1 while the line is open.", 0},
};

static void line_values(const stats_line *line, uint64_t values[STATS_OF_LINE])
{
    const mbm_counters *counters = line->counters;

    values[0] = counters->requests;
    values[1] = counters->replies;
    values[2] = counters->exceptions;
    values[3] = counters->timeouts;
    values[4] = counters->badCrc;
    values[5] = counters->foreignFrames;
    values[6] = counters->bytesSent;
    values[7] = counters->bytesReceived;
    values[8] = line->link && line->link->connected > 0 ? line->link->connected - 1 : 0;
    values[9] = line->is_up;
}

char *stats_json(const stats *from)
{
    cJSON *root = cJSON_CreateObject(), *list;
    char when[CLOCK_TEXT_BYTES];
    size_t at, line;
    char *text;

    cJSON_AddStringToObject(root, "time", clock_now_text(when));
    cJSON_AddStringToObject(root, "command", from->command);
    for (at = 0; at < from->count; at++)
        cJSON_AddNumberToObject(root, from->kinds[at].name, (double)from->values[at]);
    list = cJSON_AddArrayToObject(root, "lines");
    for (line = 0; line < from->line_count; line++) {
        cJSON *one = cJSON_CreateObject();
        uint64_t values[STATS_OF_LINE];

        line_values(&from->lines[line], values);
        cJSON_AddStringToObject(one, "line", from->lines[line].name);
        for (at = 0; at < STATS_OF_LINE; at++)
            cJSON_AddNumberToObject(one, OF_LINE[at].name, (double)values[at]);
        cJSON_AddItemToArray(list, one);
    }
    text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}

/* --- the text format 0.0.4 --- */

static void print_head(FILE *to, const stats *from, const stats_kind *kind)
{
    const char *end = kind->is_counter ? "_total" : "";

    fprintf(to, "# HELP mbm_%s_%s%s %s\n# TYPE mbm_%s_%s%s %s\n", from->command, kind->name, end,
            kind->help, from->command, kind->name, end, kind->is_counter ? "counter" : "gauge");
}

/* Backslash, quote and line feed are escaped in the value of a label. */
static void print_label(FILE *to, const char *text)
{
    for (; *text; text++) {
        if (*text == '\\' || *text == '"')
            fputc('\\', to);
        if (*text == '\n')
            fputs("\\n", to);
        else
            fputc(*text, to);
    }
}

char *stats_prometheus(const stats *from)
{
    uint64_t values[STATS_OF_LINE];
    char *text = NULL;
    size_t length, at, line;
    FILE *to = open_memstream(&text, &length);

    if (!to)
        return NULL;
    for (at = 0; at < from->count; at++) {
        print_head(to, from, &from->kinds[at]);
        fprintf(to, "mbm_%s_%s%s %" PRIu64 "\n", from->command, from->kinds[at].name,
                from->kinds[at].is_counter ? "_total" : "", from->values[at]);
    }
    for (at = 0; at < STATS_OF_LINE; at++) {
        print_head(to, from, &OF_LINE[at]);
        for (line = 0; line < from->line_count; line++) {
            line_values(&from->lines[line], values);
            fprintf(to, "mbm_%s_%s%s{line=\"", from->command, OF_LINE[at].name,
                    OF_LINE[at].is_counter ? "_total" : "");
            print_label(to, from->lines[line].name);
            fprintf(to, "\"} %" PRIu64 "\n", values[at]);
        }
    }
    if (fclose(to) != 0) {
        free(text);
        return NULL;
    }
    return text;
}
