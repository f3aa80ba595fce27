/* Draws the values of polled fields as a table that stays in its place. */
#include "live.h"

#include "clock.h"
#include "report.h"
#include "screen.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A value is marked for so long after it has changed. */
enum { MARKED_MS = 3000 };
/* Lines beside those of fields: the title and the heads above, units and keys below. */
enum { ABOVE = 2, BELOW = 2, LONGEST_VALUE = 32, LONGEST_NUMBER = 16 };
/* A screen of less lines has no heads, and none below. */
enum { FEW_LINES = 6 };

#define BOLD "\033[1m"
#define DIM "\033[2m"
#define MARKED "\033[1;36m"
#define WRONG "\033[1;31m"
#define PLAIN "\033[0m"

enum column { MARK, NAME, VALUE, UNIT, AGE, CHANGED, LEAST, MOST, STATUS, COLUMNS };
static const char *const HEADS[COLUMNS] = {"",        "NAME", "VALUE", "UNIT",  "AGE",
                                           "CHANGED", "MIN",  "MAX",   "STATUS"};

/* A table as it is drawn once. */
typedef struct drawing {
    FILE *to;
    int columns, left; /* of the screen, and of the line that is drawn */
    int has_style, widths[COLUMNS];
    const char *next; /* ends a line */
} drawing;

/* --- pieces --- */

/* NO_COLOR is what users set who want none (no-color.org). */
static void style(const drawing *d, const char *escape)
{
    const char *no_colour = getenv("NO_COLOR");

    if (no_colour && *no_colour && (strcmp(escape, MARKED) == 0 || strcmp(escape, WRONG) == 0))
        escape = BOLD;
    if (d->has_style)
        fputs(escape, d->to);
}

static void put_spaces(drawing *d, int count)
{
    if (count > d->left)
        count = d->left;
    fprintf(d->to, "%*s", count, "");
    d->left -= count;
}

/* Prints a text in so many columns, cut with a mark if it is longer; -1: as many as it takes. */
static void put(drawing *d, const char *text, int width)
{
    int taken = screen_width(text);

    if (width < 0 || width > d->left)
        width = width < 0 && taken < d->left ? taken : d->left;
    if (taken <= width) {
        fputs(text, d->to);
    } else if (width > 0) {
        const size_t length = screen_fit(text, width - 1);

        fprintf(d->to, "%.*s…", (int)length, text);
        /* A wide character may have left a column. */
        taken = width;
    }
    d->left -= width > taken ? taken : width;
    if (width > taken)
        put_spaces(d, width - taken);
}

static void __attribute__((format(printf, 2, 3))) say_there(drawing *d, const char *format, ...)
{
    char text[512];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    put(d, text, -1);
}

static void end_line(drawing *d)
{
    style(d, PLAIN);
    fputs(d->next, d->to);
    d->left = d->columns;
}

/* A time in few characters: 0.4s, 12s, 5m, 3h. */
static const char *short_time(int64_t milliseconds, char text[24])
{
    if (milliseconds < 9950)
        snprintf(text, 24, "%.1fs", (double)milliseconds / 1000);
    else if (milliseconds < 99500)
        snprintf(text, 24, "%ds", (int)((milliseconds + 500) / 1000));
    else if (milliseconds < 99 * 60000)
        snprintf(text, 24, "%dm", (int)(milliseconds / 60000));
    else
        snprintf(text, 24, "%dh",
                 (int)(milliseconds / 3600000 > 9999 ? 9999 : milliseconds / 3600000));
    return text;
}

/* --- columns --- */

static int more(int a, int b)
{
    return a > b ? a : b;
}

/* Takes columns from the name, and then from the value, until the table fits or they have their
 * least. Returns the width of the table. */
static int shrink(int widths[COLUMNS], int total, int most, int name, int value)
{
    int i;

    for (i = NAME; i <= VALUE && total > most; i++) {
        const int least = i == NAME ? name : value, over = total - most;
        const int cut = widths[i] - over < least ? more(widths[i] - least, 0) : over;

        widths[i] -= cut;
        total -= cut;
    }
    return total;
}

/* Gives the name and the value what is left, up to what they need. */
static void give_back(int widths[COLUMNS], const int needed[COLUMNS], int left)
{
    int i;

    for (i = VALUE; i >= NAME && left > 0; i--) {
        const int given = needed[i] - widths[i] < left ? needed[i] - widths[i] : left;

        widths[i] += given;
        left -= given;
    }
}

/* The columns that fit, in the order in which they are left out. Before that the name and the value
 * shrink, as long as a date fits; and if that is not enough, further. */
static void choose_widths(watch *w, drawing *d)
{
    static const enum column DROPPED[] = {UNIT, CHANGED, LEAST, MOST, AGE, STATUS};
    enum { NAME_KEEPS = 16, VALUE_KEEPS = 25, LEAST_WIDTH = 8 };
    int *widths = d->widths, needed[COLUMNS], total = 0, i;

    widths[MARK] = 1;
    widths[NAME] = more(screen_width(HEADS[NAME]), polled_name_width(w->of->of));
    widths[VALUE] = more(w->value_width, 12);
    widths[UNIT] = w->of->unit_count > 1 ? 4 : 0;
    widths[AGE] = 5;
    widths[CHANGED] = 7;
    widths[LEAST] = widths[MOST] = more(w->number_width, 6);
    widths[STATUS] = 16;
    memcpy(needed, widths, sizeof needed);
    for (i = 0; i < COLUMNS; i++)
        total += widths[i] ? widths[i] + (i == MARK ? 1 : 2) : 0;
    total = shrink(widths, total, d->columns, NAME_KEEPS, VALUE_KEEPS);
    for (i = 0; i < (int)(sizeof DROPPED / sizeof DROPPED[0]) && total > d->columns; i++) {
        const enum column one = DROPPED[i];

        total -= widths[one] ? widths[one] + 2 : 0;
        widths[one] = 0;
        /* One of the two alone would look like the other. */
        if (one == LEAST) {
            total -= widths[MOST] + 2;
            widths[MOST] = 0;
        }
    }
    total = shrink(widths, total, d->columns, LEAST_WIDTH, LEAST_WIDTH);
    give_back(widths, needed, d->columns - total);
}

static void put_column(drawing *d, enum column column, const char *text)
{
    if (d->widths[column] == 0)
        return;
    put(d, text, column == STATUS ? -1 : d->widths[column]);
    if (column != STATUS)
        put_spaces(d, column == MARK ? 1 : 2);
}

static void draw_heads(drawing *d)
{
    int i;

    style(d, DIM);
    for (i = 0; i < COLUMNS; i++)
        put_column(d, (enum column)i, HEADS[i]);
    end_line(d);
}

static const char *mark_of(const followed_field *one)
{
    return one->direction > 0 ? "▲" : one->direction < 0 ? "▼" : "•";
}

static void draw_field(watch *w, drawing *d, uint16_t field)
{
    polled *of = w->of->of;
    const followed_field *one = &w->of->fields[field];
    const int64_t since = clock_milliseconds() - one->changed_at;
    const int is_marked = one->changed_at != 0 && since < MARKED_MS;
    char status[256], age[24] = "", changed[24] = "", unit[8];
    uint32_t ageMs;

    const uint8_t code = device_plan_status(&of->plan, &of->meter, field, &ageMs);
    const int is_wrong =
        code != MBM_PENDING && report_code_of(code, polled_exception(code)) != CODE_DONE;

    if (ageMs != UINT32_MAX)
        (void)short_time(ageMs, age);
    if (one->changed_at != 0)
        (void)short_time(since, changed);
    snprintf(unit, sizeof unit, "%u", of->meter.planned[field].unit);
    if (is_wrong)
        style(d, WRONG);
    put_column(d, MARK, is_marked ? mark_of(one) : is_wrong ? "!" : "");
    put_column(d, NAME, of->meter.fields[field].name);
    if (is_marked)
        style(d, MARKED);
    put_column(d, VALUE, one->text ? one->text : "-");
    style(d, PLAIN);
    put_column(d, UNIT, unit);
    put_column(d, AGE, age);
    put_column(d, CHANGED, changed);
    put_column(d, LEAST, one->has_number ? one->least_text : "");
    put_column(d, MOST, one->has_number ? one->most_text : "");
    if (is_wrong)
        style(d, WRONG);
    /* Why the link was lost says more in a few columns than that it was. */
    put_column(d, STATUS,
               code == MBM_LINK_LOST && line_reason(&of->at) ? line_reason(&of->at)
                                                             : polled_status(of, code, status));
    end_line(d);
}

/* --- lines above and below --- */

static void draw_title(watch *w, drawing *d)
{
    polled *of = w->of->of;
    const uint16_t right = polled_read_count(of);

    style(d, BOLD);
    if (of->meter.name)
        say_there(d, "%s  ", of->meter.name);
    say_there(d, "%s", of->at.place.text);
    style(d, PLAIN);
    if (right < of->meter.readable && w->round > 0)
        style(d, WRONG);
    say_there(d, "  %u of %u fields read", right, of->meter.readable);
    style(d, PLAIN);
    if (w->round > 0)
        say_there(d, "  round %u, %s", (unsigned)w->round, w->time);
    end_line(d);
}

/* The units, first those whose reads have failed; all in one line, or each in its own. */
static void draw_units(watch *w, drawing *d, int is_one_line)
{
    char text[FOLLOWED_UNIT_BYTES];
    const char *between = "";
    int failing;
    uint16_t i;

    for (failing = 1; failing >= 0; failing--)
        for (i = 0; i < w->of->unit_count; i++) {
            const followed_unit *unit = &w->of->units[i];

            if ((followed_failures(unit) > 0) != failing)
                continue;
            put(d, between, -1);
            if (failing)
                style(d, WRONG);
            put(d, followed_unit_text(unit, text), -1);
            style(d, PLAIN);
            between = is_one_line ? "; " : "";
            if (!is_one_line)
                end_line(d);
        }
    if (is_one_line)
        end_line(d);
}

static void draw_keys(const watch *w, drawing *d, unsigned shown)
{
    const unsigned count = w->of->of->meter.readable;

    style(d, DIM);
    if (shown < count)
        say_there(d, "fields %u-%u of %u  ↑↓ PgUp PgDn  ", w->top + 1u, w->top + shown, count);
    say_there(d, "q end  r forget MIN and MAX");
    if (*w->page)
        say_there(d, "  %s", w->page);
    style(d, PLAIN);
}

/* --- the whole --- */

/* Columns only grow. */
static void grow(watch *w)
{
    uint16_t i;

    for (i = 0; i < w->of->of->meter.readable; i++) {
        const followed_field *one = &w->of->fields[i];

        if (one->text)
            w->value_width = more(w->value_width, screen_width(one->text));
        if (one->has_number)
            w->number_width = more(w->number_width,
                                   more((int)strlen(one->least_text), (int)strlen(one->most_text)));
    }
    if (w->value_width > LONGEST_VALUE)
        w->value_width = LONGEST_VALUE;
    if (w->number_width > LONGEST_NUMBER)
        w->number_width = LONGEST_NUMBER;
}

/* How many fields fit into a screen. */
static int fields_in(int rows)
{
    const int fields = rows < FEW_LINES ? rows - 1 : rows - ABOVE - BELOW;

    return fields > 1 ? fields : 1;
}

static void scroll_to(watch *w, int top, int fields)
{
    const int last = w->of->of->meter.readable - fields;

    if (top > last)
        top = last;
    w->top = (uint16_t)(top > 0 ? top : 0);
}

void watch_draw(watch *w)
{
    const int count = w->of->of->meter.readable;
    drawing d = {.has_style = 1, .next = SCREEN_NEXT};
    int rows, columns, fields, i;
    char *text = NULL;
    size_t length = 0;

    screen_size(&rows, &columns);
    d.to = open_memstream(&text, &length);
    if (!d.to)
        return;
    d.columns = d.left = columns > 1 ? columns - 1 : 1;
    fields = fields_in(rows);
    scroll_to(w, w->top, fields);
    grow(w);
    choose_widths(w, &d);
    draw_title(w, &d);
    if (rows >= FEW_LINES)
        draw_heads(&d);
    for (i = 0; i < fields && w->top + i < count; i++)
        draw_field(w, &d, (uint16_t)(w->top + i));
    if (rows >= FEW_LINES) {
        draw_units(w, &d, 1);
        draw_keys(w, &d, (unsigned)i);
        fputs("\033[K", d.to);
    }
    if (fclose(d.to) == 0)
        screen_draw(text, text[length - 1] == '\n' ? length - 1 : length);
    free(text);
}

void watch_print(watch *w)
{
    drawing d = {.to = stdout, .next = "\n"};
    int rows, i;

    screen_size(&rows, &d.columns);
    d.left = --d.columns;
    choose_widths(w, &d);
    draw_title(w, &d);
    draw_heads(&d);
    for (i = 0; i < w->of->of->meter.readable; i++)
        draw_field(w, &d, (uint16_t)i);
    draw_units(w, &d, 0);
    report_flush();
}

int watch_keys(watch *w)
{
    int rows, columns, fields, key, is_new = 0;

    screen_size(&rows, &columns);
    fields = fields_in(rows);
    while ((key = screen_key()) != 0) {
        is_new = 1;
        switch (key) {
        case 'q':
        case 'Q':
        case SCREEN_GONE: return -1;
        case 'r': followed_forget(w->of); break;
        case 'j':
        case SCREEN_DOWN: scroll_to(w, w->top + 1, fields); break;
        case 'k':
        case SCREEN_UP: scroll_to(w, w->top - 1, fields); break;
        case ' ':
        case SCREEN_PAGE_DOWN: scroll_to(w, w->top + fields, fields); break;
        case 'b':
        case SCREEN_PAGE_UP: scroll_to(w, w->top - fields, fields); break;
        case 'g':
        case SCREEN_HOME: scroll_to(w, 0, fields); break;
        case 'G':
        case SCREEN_END: scroll_to(w, w->of->of->meter.readable, fields); break;
        default: break;
        }
    }
    return is_new;
}
