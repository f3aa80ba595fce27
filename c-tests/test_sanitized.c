/* The variant `sanitized` finds mistakes in the archive too, not only in C: the archive is
 * compiled with the address sanitizer. */
#include "mbm.h"
#include "test.h"

#include <sys/wait.h>
#include <unistd.h>

#if defined(__SANITIZE_ADDRESS__)
#define SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define SANITIZED 1
#endif
#endif
#ifndef SANITIZED
#define SANITIZED 0
#endif

enum { BYTES = 8 };

/* Begins a ring over `bytes` bytes of 8, and puts one into each. Only the archive stores them, and
 * it calls no function of libc for that. */
static void fill_ring(uint16_t bytes)
{
    uint8_t *storage = malloc(BYTES), taken;
    mbm_ring ring;

    mbm_ring_begin(&ring, storage, bytes);
    for (unsigned i = 0; i < bytes; i++) {
        mbm_ring_put(&ring, 1);
        mbm_ring_read(&ring, &taken, 1);
    }
    free(storage);
}

/* Runs fill_ring in a process of its own. Returns whether that ended well; `report` gets what it
 * printed. */
static int fills_ring(uint16_t bytes, char *report, size_t capacity)
{
    size_t length = 0;
    ssize_t more;
    int ends[2], result;

    assert_int_equal(pipe(ends), 0);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        dup2(ends[1], STDERR_FILENO);
        fill_ring(bytes);
        _exit(0);
    }
    close(ends[1]);
    while ((more = read(ends[0], report + length, capacity - 1 - length)) > 0)
        length += (size_t)more;
    report[length] = 0;
    close(ends[0]);
    assert_int_equal(waitpid(child, &result, 0), child);
    return WIFEXITED(result) && WEXITSTATUS(result) == 0;
}

TEST(a_store_by_the_archive_within_its_buffer_is_not_reported)
{
    char report[16384];

    assert_true(fills_ring(BYTES, report, sizeof report));
    assert_string_equal(report, "");
}

TEST(a_store_by_the_archive_beyond_its_buffer_is_reported)
{
    char report[16384];

    if (!SANITIZED)
        skip();
    assert_false(fills_ring(BYTES + 1, report, sizeof report));
    assert_non_null(strstr(report, "heap-buffer-overflow"));
    assert_non_null(strstr(report, "WRITE of size 1"));
}
