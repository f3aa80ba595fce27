/* Takes over the terminal, and gives it back. */
#include "screen.h"

#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

/* The other page of the terminal, without a cursor and without lines that wrap; and back. */
static const char ENTER[] = "\033[?1049h\033[?25l\033[?7l";
static const char LEAVE[] = "\033[?7h\033[?25h\033[?1049l";

static struct termios before;
static volatile sig_atomic_t is_on, is_resized, is_stopping;

/* Writes all of it; also in a handler of signals. */
static void put(const char *text, size_t length)
{
    while (length > 0) {
        const ssize_t count = write(STDOUT_FILENO, text, length);

        if (count < 0 && errno != EINTR)
            return;
        if (count > 0) {
            text += count;
            length -= (size_t)count;
        }
    }
}

/* --- signals --- */

/* These end a program at once. The others that do so are caught by report_catch_signals. */
static const int FATAL[] = {SIGQUIT, SIGABRT, SIGSEGV, SIGBUS,  SIGFPE,    SIGILL,  SIGSYS, SIGTRAP,
                            SIGALRM, SIGUSR1, SIGUSR2, SIGPIPE, SIGVTALRM, SIGPROF, SIGXCPU};

static void end_by(int number)
{
    screen_end();
    (void)signal(number, SIG_DFL);
    (void)raise(number);
}

static void note(int number)
{
    if (number == SIGWINCH)
        is_resized = 1;
    else
        is_stopping = 1;
}

/* Catches a signal, unless the program ignores it or has a handler. */
static void catch_one(int number, void (*handler)(int))
{
    struct sigaction now, wanted;

    if (sigaction(number, NULL, &now) != 0 || now.sa_handler != SIG_DFL)
        return;
    memset(&wanted, 0, sizeof wanted);
    wanted.sa_handler = handler;
    wanted.sa_flags = SA_NODEFER;
    (void)sigaction(number, &wanted, NULL);
}

static void catch_signals(void)
{
    size_t i;

    for (i = 0; i < sizeof FATAL / sizeof FATAL[0]; i++)
        catch_one(FATAL[i], end_by);
    catch_one(SIGTSTP, note);
    catch_one(SIGWINCH, note);
}

/* --- the terminal --- */

const char *screen_wrong(void)
{
    const char *kind = getenv("TERM");

    if (!isatty(STDOUT_FILENO))
        return "standard output is no terminal";
    if (!isatty(STDIN_FILENO))
        return "standard input is no terminal, so no key would end it";
    if (!kind || !*kind || strcmp(kind, "dumb") == 0)
        return "the terminal cannot place text (TERM is dumb or not set)";
    return NULL;
}

static void enter(void)
{
    struct termios raw = before;

    /* Ctrl-C and Ctrl-Z stay signals. Ctrl-S would stop the requests too. */
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    raw.c_iflag &= ~(tcflag_t)(IXON | ICRNL);
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    (void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &raw);
    is_on = 1;
    put(ENTER, sizeof ENTER - 1);
}

int screen_begin(void)
{
    static uint8_t is_prepared;

    if (tcgetattr(STDIN_FILENO, &before) != 0)
        return -1;
    if (!is_prepared)
        (void)atexit(screen_end);
    is_prepared = 1;
    catch_signals();
    enter();
    return 0;
}

void screen_end(void)
{
    if (!is_on)
        return;
    is_on = 0;
    put(LEAVE, sizeof LEAVE - 1);
    (void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
}

int screen_is_new(void)
{
    int is_new = is_resized;

    is_resized = 0;
    if (is_stopping) {
        is_stopping = 0;
        screen_end();
        (void)raise(SIGSTOP);
        enter();
        is_new = 1;
    }
    return is_new;
}

void screen_size(int *rows, int *columns)
{
    struct winsize size;

    *rows = 24;
    *columns = 80;
    if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0)
        return;
    if (size.ws_row > 0)
        *rows = size.ws_row;
    if (size.ws_col > 0)
        *columns = size.ws_col;
}

void screen_draw(const char *text, size_t length)
{
    /* A terminal that knows 2026 shows the new text at once. */
    static const char BEFORE[] = "\033[?2026h\033[H", AFTER[] = "\033[J\033[?2026l";

    put(BEFORE, sizeof BEFORE - 1);
    put(text, length);
    put(AFTER, sizeof AFTER - 1);
}

/* --- keys --- */

/* The bytes that were read and not taken. */
static char typed[64];
static size_t typed_count;

static void take(size_t count)
{
    typed_count -= count;
    memmove(typed, typed + count, typed_count);
}

/* Returns the key of ESC [ or ESC O and what follows, 0 if it is not known, or -1 if more bytes
 * belong to it. */
static int key_of_sequence(void)
{
    static const struct {
        const char *bytes;
        int key;
    } KEYS[] = {{"A", SCREEN_UP},         {"B", SCREEN_DOWN}, {"5~", SCREEN_PAGE_UP},
                {"6~", SCREEN_PAGE_DOWN}, {"H", SCREEN_HOME}, {"F", SCREEN_END},
                {"1~", SCREEN_HOME},      {"4~", SCREEN_END}};
    size_t end = 2, i;

    if (typed_count < 2)
        return -1;
    if (typed[1] != '[' && typed[1] != 'O') {
        take(1);
        return 0;
    }
    while (end < typed_count && (typed[end] < '@' || typed[end] > '~'))
        end++;
    if (end == typed_count && typed_count < sizeof typed)
        return -1;
    for (i = 0; i < sizeof KEYS / sizeof KEYS[0]; i++)
        if (strlen(KEYS[i].bytes) == end - 1 && memcmp(typed + 2, KEYS[i].bytes, end - 1) == 0)
            break;
    take(end < typed_count ? end + 1 : typed_count);
    return i < sizeof KEYS / sizeof KEYS[0] ? KEYS[i].key : 0;
}

int screen_key(void)
{
    ssize_t count = 0;
    int key = 0;

    if (typed_count < sizeof typed)
        count = read(STDIN_FILENO, typed + typed_count, sizeof typed - typed_count);
    if (count < 0 && errno != EINTR && errno != EAGAIN)
        return SCREEN_GONE;
    if (count > 0)
        typed_count += (size_t)count;
    while (typed_count > 0 && key == 0) {
        if (typed[0] == '\033') {
            key = key_of_sequence();
            continue;
        }
        key = (unsigned char)typed[0];
        take(1);
    }
    return key > 0 ? key : 0;
}

/* --- texts --- */

/* Reads a character of UTF-8. A byte that is none counts as a character. Returns its bytes. */
static size_t read_character(const char *text, uint32_t *character)
{
    const unsigned char first = (unsigned char)*text;
    const size_t length = first < 0xC0 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    size_t i;

    *character = length == 1 ? first : first & (0xFFu >> (length + 1));
    for (i = 1; i < length; i++) {
        if (((unsigned char)text[i] & 0xC0) != 0x80)
            return i;
        *character = *character << 6 | ((unsigned char)text[i] & 0x3F);
    }
    return length;
}

/* The columns of a character: 0 of those that combine with another, 2 of those of East Asia. */
static int columns_of(uint32_t character)
{
    static const struct {
        uint32_t first, last;
        int columns;
    } RANGES[] = {{0x0300, 0x036F, 0},  {0x200B, 0x200F, 0}, {0xFE00, 0xFE0F, 0},
                  {0x20D0, 0x20FF, 0},  {0x1100, 0x115F, 2}, {0x2E80, 0xA4CF, 2},
                  {0xAC00, 0xD7A3, 2},  {0xF900, 0xFAFF, 2}, {0xFE30, 0xFE6F, 2},
                  {0xFF00, 0xFF60, 2},  {0xFFE0, 0xFFE6, 2}, {0x1F300, 0x1FAFF, 2},
                  {0x20000, 0x3FFFD, 2}};
    size_t i;

    for (i = 0; i < sizeof RANGES / sizeof RANGES[0]; i++)
        if (character >= RANGES[i].first && character <= RANGES[i].last)
            return RANGES[i].columns;
    return 1;
}

int screen_width(const char *text)
{
    uint32_t character;
    int width = 0;

    while (*text) {
        text += read_character(text, &character);
        width += columns_of(character);
    }
    return width;
}

size_t screen_fit(const char *text, int columns)
{
    const char *at = text;
    uint32_t character;

    while (*at) {
        const size_t length = read_character(at, &character);

        columns -= columns_of(character);
        if (columns < 0)
            break;
        at += length;
    }
    return (size_t)(at - text);
}
