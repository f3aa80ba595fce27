/* What mbm says on stderr, and its exit codes. */
#pragma once

#include <signal.h>
#include <stddef.h>
#include <stdint.h>

enum {
    CODE_DONE = 0,
    CODE_SYSTEM = 1,    /* a file, the memory */
    CODE_WRONG = 2,     /* the command line, or what a file says */
    CODE_LINE = 3,      /* the line could not be opened, or was lost */
    CODE_NO_REPLY = 4,  /* no reply in time, or Ctrl-C before the reply */
    CODE_EXCEPTION = 5, /* the device answered with an exception */
    CODE_DAMAGED = 6    /* the reply was damaged or malformed */
};

#define REPORT_EXIT_CODES                                                                          \
    "Exit codes:\n"                                                                                \
    "  0  done\n"                                                                                  \
    "  1  the system failed: a file, the memory\n"                                                 \
    "  2  the command line or a file is wrong\n"                                                   \
    "  3  the line could not be opened, or was lost\n"                                             \
    "  4  no reply in time, or Ctrl-C before the reply\n"                                          \
    "  5  the device answered with an exception\n"                                                 \
    "  6  the reply was damaged or malformed\n"                                                    \
    "Of several results the first failure counts.\n"

/* What every command says without memory. */
#define REPORT_NO_MEMORY "there is not enough memory"

/* "mbm" and the command, which begin each sentence. */
extern const char *report_name;

/* Prints a sentence, given without its full stop, after report_name to stderr. Returns the code.
 * The first code of a program that is not CODE_DONE stays in report_code. */
int report(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));
extern int report_code;

/* The levels of log lines, which are those of the system's log. */
enum { REPORT_ERROR = 3, REPORT_WARNING = 4, REPORT_INFO = 6, REPORT_DEBUG = 7 };

/* The words for the levels, for --log-level, and the level of each. NULL ends the words. */
extern const char *const report_level_names[];
extern const int report_level_numbers[];

/* Lines above this level are left out: REPORT_INFO at first. */
extern int report_level;

/* Prints a log line of a service to stderr, given without its full stop: "warning:
 * rtu:/dev/ttyUSB0: Input/output error." If stderr is systemd's journal, the level is "<4>" before
 * the line, as the journal wants it. Any thread may call it. */
void report_log(int level, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Notes a failure that is shown in another way. Returns report_code. */
int report_note(int code);

/* The exit code for the status of a request. */
int report_code_of(uint8_t status, uint8_t exception);

/* Sets how many requests may be in flight at once. The advice on a missing reply names more than
 * one: as a sentence that follows another, or an empty text. */
void report_set_in_flight(unsigned most);
const char *report_in_flight(void);

/* Notes and reports how a request failed, and what to look at. `who` was asked, such as "unit 17",
 * and had `timeoutMs` to answer. `why` says why the link was lost, or what came in place of a
 * reply, or is NULL; `advice` is that of advice.h. Returns the exit code. */
int report_failure(const char *who, uint8_t status, uint8_t exception, uint32_t timeoutMs,
                   const char *why, const char *advice);

/* The status of a request in words; an exception has its code too. */
const char *report_words(uint8_t status, uint8_t exception);

/* An error number in words. EPIPE is the end of a line here, not "Broken pipe" as strerror says. */
const char *report_error_text(int error);

/* Writes a text to a file, or to stdout if `path` is NULL. Returns CODE_DONE, or another exit code
 * after reporting the reason; what is wrong with stdout is reported at the end. */
int report_write_file(const char *path, const char *text, size_t length);

/* Prints an object in one line to stdout, and frees it. report_add_json adds the status of a
 * request to it: its exit code, its status in words, and the code of an exception. report_json does
 * both. */
struct cJSON;
void report_add_json(struct cJSON *object, uint8_t status, uint8_t exception, const char *words);
void report_print_json(struct cJSON *object);
void report_json(struct cJSON *object, uint8_t status, uint8_t exception, const char *words);

/* Ctrl-C, SIGTERM and SIGHUP set `report_stopped`. A SIGHUP that nohup ignores stays ignored. */
extern volatile sig_atomic_t report_stopped;
void report_catch_signals(void);

/* Opens /dev/null in place of standard input, output and stderr if they are closed. Otherwise a
 * line would get the number of one of them, and what is printed would be sent on the line. At the
 * end the program exits with CODE_SYSTEM if its output could not be written. */
void report_begin(void);

/* Flushes stdout, and keeps the reason if that fails. */
void report_flush(void);
