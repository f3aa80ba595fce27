/* Reads device files from texts, for the tests of their keys.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_TEXT_H
#define DEVICE_TEXT_H

#include "device.h"
#include "report.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char path[] = "/tmp/mbm-device-XXXXXX";
static device meter;
static char wrong[YAML_FILE_WRONG_BYTES];

static void make_file(void)
{
    const int fd = mkstemp(path);

    assert_true(fd >= 0);
    close(fd);
}

static void remove_file(void)
{
    remove(path);
}

static void free_meter(void)
{
    device_free(&meter);
}

fixture all_tests = {make_file, remove_file};
fixture each_test = {NULL, free_meter};

/* Reads a file into `meter`. */
static inline int read_bytes(const char *text, size_t length)
{
    FILE *file = fopen(path, "wb");

    free_meter();
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, length, file), length);
    assert_int_equal(fclose(file), 0);
    return device_file_read(&meter, path, wrong);
}

static inline void read_text(const char *text)
{
    if (read_bytes(text, strlen(text)) != CODE_DONE)
        fail_msg("%s", wrong);
}

static inline void expect_reason(const char *text, size_t length, const char *reason)
{
    char wanted[YAML_FILE_WRONG_BYTES + sizeof path];

    assert_int_equal(read_bytes(text, length), CODE_WRONG);
    snprintf(wanted, sizeof wanted, "%s:%s", path, reason);
    assert_string_equal(wrong, wanted);
    assert_null(meter.fields);
    assert_null(meter.planned);
    assert_int_equal(meter.count, 0);
}

static inline void expect_refused(const char *text, const char *reason)
{
    expect_reason(text, strlen(text), reason);
}

/* The same, but for what follows the reason. */
static inline void expect_refused_like(const char *text, const char *reason)
{
    char wanted[YAML_FILE_WRONG_BYTES + sizeof path];

    assert_int_equal(read_bytes(text, strlen(text)), CODE_WRONG);
    snprintf(wanted, sizeof wanted, "%s:%s", path, reason);
    wrong[strlen(wanted)] = '\0';
    assert_string_equal(wrong, wanted);
}

#endif
