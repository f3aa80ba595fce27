/* Prints sentences, log lines and JSON, and keeps the exit code. */
#include "report.h"

#include "mbm.h"
#include "numbers.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

const char *report_name = "mbm";
int report_code;
volatile sig_atomic_t report_stopped;

const char *const report_level_names[] = {"error", "warning", "info", "debug", NULL};
const int report_level_numbers[] = {REPORT_ERROR, REPORT_WARNING, REPORT_INFO, REPORT_DEBUG};
int report_level = REPORT_INFO;

static void stop(int number)
{
    (void)number;
    report_stopped = 1;
}

void report_catch_signals(void)
{
    struct sigaction action = {0}, old;

    action.sa_handler = stop;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    if (sigaction(SIGHUP, NULL, &old) == 0 && old.sa_handler != SIG_IGN)
        sigaction(SIGHUP, &action, NULL);
    action.sa_handler = SIG_IGN;
    sigaction(SIGPIPE, &action, NULL);
}

static int output_error; /* the first of stdout, or 0 */

void report_flush(void)
{
    if ((fflush(stdout) != 0 || ferror(stdout)) && output_error == 0)
        output_error = errno ? errno : EIO;
}

static void close_output(void)
{
    report_flush();
    if (fclose(stdout) != 0 && output_error == 0)
        output_error = errno;
    if (output_error != 0)
        _exit(report(CODE_SYSTEM, "standard output: %s", strerror(output_error)));
}

void report_begin(void)
{
    int fd;

    for (fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0)
            (void)open("/dev/null", O_RDWR); /* the lowest descriptor that is free: this one */
    (void)atexit(close_output);
}

int report_note(int code)
{
    if (report_code == CODE_DONE)
        report_code = code;
    return report_code;
}

/* Whether stderr is the journal: JOURNAL_STREAM has the numbers of its socket. */
static int is_journal(void)
{
    const char *stream = getenv("JOURNAL_STREAM");
    struct stat file;
    char expected[48];

    if (!stream || fstat(2, &file) != 0)
        return 0;
    snprintf(expected, sizeof expected, "%" PRIuMAX ":%" PRIuMAX, (uintmax_t)file.st_dev,
             (uintmax_t)file.st_ino);
    return strcmp(stream, expected) == 0;
}

/* The full stop that a sentence lacks. A command in a line of its own has none. */
static const char *stop_of(const char *text)
{
    const size_t length = strlen(text);

    return strchr(text, '\n') || (length > 0 && strchr(".?!", text[length - 1])) ? "" : ".";
}

int report(int code, const char *format, ...)
{
    char text[1024];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    fprintf(stderr, "%s%s: %s%s\n", is_journal() ? "<3>" : "", report_name, text, stop_of(text));
    (void)report_note(code);
    return code;
}

void report_log(int level, const char *format, ...)
{
    char text[1024], before[16];
    va_list arguments;
    int word = 0;

    if (level > report_level)
        return;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    while (report_level_numbers[word] != level)
        word++;
    if (is_journal())
        snprintf(before, sizeof before, "<%d>", level);
    else
        snprintf(before, sizeof before, "%s: ", report_level_names[word]);
    fprintf(stderr, "%s%s%s\n", before, text, stop_of(text));
}

int report_code_of(uint8_t status, uint8_t exception)
{
    if (exception != 0)
        return CODE_EXCEPTION;
    switch (status) {
    case MBM_OK:
    case MBM_NOT_AVAILABLE: return CODE_DONE;
    case MBM_LINK_LOST:
    case MBM_CONNECT_TIMED_OUT:
    case MBM_LINE_BUSY: return CODE_LINE;
    case MBM_RESPONSE_TIMED_OUT:
    case MBM_CANCELLED: /* by Ctrl-C */
    case MBM_INVALID_SLAVE_ID: return CODE_NO_REPLY;
    case MBM_INVALID_CRC:
    case MBM_INVALID_FUNCTION:
    case MBM_MALFORMED_REPLY:
    case MBM_BUFFER_TOO_SMALL:
    case MBM_NO_PROGRESS:
    case MBM_MALFORMED_VALUE: return CODE_DAMAGED;
    default: return CODE_WRONG;
    }
}

const char *report_words(uint8_t status, uint8_t exception)
{
    static char text[64];
    const char *words = mbm_status_textOf(status, exception);

    if (exception == 0 || strncmp(words, "exception", 9) == 0)
        return words;
    snprintf(text, sizeof text, "exception %02X, which the standard does not have", exception);
    return text;
}

const char *report_error_text(int error)
{
    return error == EPIPE ? "the other end has closed it" : strerror(error);
}

static unsigned most_in_flight = 1;

void report_set_in_flight(unsigned most)
{
    most_in_flight = most;
}

/* Many devices answer one request, and drop those that come meanwhile. */
const char *report_in_flight(void)
{
    static char text[96];

    snprintf(text, sizeof text, ". Up to %u requests were in flight at once: try --in-flight 1",
             most_in_flight);
    return most_in_flight > 1 ? text : "";
}

int report_failure(const char *who, uint8_t status, uint8_t exception, uint32_t timeoutMs,
                   const char *why, const char *advice)
{
    const int code = report_code_of(status, exception);
    const char *space = *advice ? ". " : "", *colon = why ? ": " : "";
    char time[32];

    if (!why)
        why = "";
    if (status == MBM_CANCELLED)
        return report(code, "stopped before %s answered", who);
    if (status == MBM_RESPONSE_TIMED_OUT && exception == 0)
        return report(code,
                      *why ? "no right reply from %s within %s%s%s%s%s%s"
                           : "%s did not answer within %s%s%s%s%s%s",
                      who, number_time_text(timeoutMs, time), colon, why, space, advice,
                      report_in_flight());
    if (status == MBM_LINK_LOST && *why)
        return report(code, "%s: the link was lost: %s%s%s", who, why, space, advice);
    return report(code, "%s: %s%s%s%s%s", who, report_words(status, exception), colon, why, space,
                  advice);
}

int report_write_file(const char *path, const char *text, size_t length)
{
    FILE *file = path ? fopen(path, "wb") : stdout;
    int is_right;

    if (!file)
        return report(CODE_SYSTEM, "%s: %s", path, strerror(errno));
    is_right = fwrite(text, 1, length, file) == length;
    if (!path)
        report_flush();
    else if (fclose(file) != 0 || !is_right)
        return report(CODE_SYSTEM, "%s: %s", path, strerror(errno));
    return CODE_DONE;
}

void report_print_json(cJSON *object)
{
    char *text = cJSON_PrintUnformatted(object);

    puts(text ? text : "null");
    report_flush();
    cJSON_free(text);
    cJSON_Delete(object);
}

void report_add_json(cJSON *object, uint8_t status, uint8_t exception, const char *words)
{
    cJSON_AddNumberToObject(object, "code", report_code_of(status, exception));
    cJSON_AddStringToObject(object, "status", words);
    if (exception != 0)
        cJSON_AddNumberToObject(object, "exception", exception);
}

void report_json(cJSON *object, uint8_t status, uint8_t exception, const char *words)
{
    report_add_json(object, status, exception, words);
    report_print_json(object);
}
