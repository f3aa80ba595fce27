/* The functions of mbm_tls_linux.h. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tls_linux.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

#include <mbedtls/platform_util.h>

int mbm_tls_random(void *context, unsigned char *bytes, size_t count)
{
    ssize_t filled;

    (void)context;
    while (count > 0) {
        filled = getrandom(bytes, count, 0);
        if (filled < 0 && errno != EINTR)
            return -1;
        if (filled > 0) {
            bytes += filled;
            count -= (size_t)filled;
        }
    }
    return 0;
}

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* Reads a file into MBM_TLS_FILE_BYTES, with a zero after it. Returns how many bytes Mbed TLS
 * gets: for PEM the zero counts, for DER it does not. */
static ssize_t read_file(const char *path, uint8_t *bytes)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    size_t length = 0;
    ssize_t count = 1;
    int error;

    if (fd < 0)
        return -1;
    while (count != 0 && length < MBM_TLS_FILE_BYTES) {
        count = read(fd, bytes + length, MBM_TLS_FILE_BYTES - length);
        if (count < 0 && errno != EINTR)
            break;
        if (count > 0)
            length += (size_t)count;
    }
    error = errno;
    close(fd);
    if (count < 0)
        return refuse(error);
    if (length == MBM_TLS_FILE_BYTES)
        return refuse(EFBIG);
    if (length == 0)
        return refuse(ENODATA);
    bytes[length] = 0;
    return (ssize_t)length + (bytes[0] != 0x30);
}

int mbm_tls_load(mbm_tls_files *files, mbm_tls_options *options, const char *certificate,
                 const char *key, const char *authorities)
{
    const ssize_t own = read_file(certificate, files->certificate),
                  secret = own < 0 ? -1 : read_file(key, files->key),
                  known = secret < 0 ? -1 : read_file(authorities, files->authorities);

    if (known < 0)
        return -1;
    options->certificate = files->certificate;
    options->certificateBytes = (size_t)own;
    options->key = files->key;
    options->keyBytes = (size_t)secret;
    options->authorities = files->authorities;
    options->authoritiesBytes = (size_t)known;
    options->random = mbm_tls_random;
    return 0;
}

void mbm_tls_forgetKey(mbm_tls_files *files)
{
    mbedtls_platform_zeroize(files->key, sizeof files->key);
}

int mbm_tls_wait(mbm_tls *tlss, mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener,
                 int fd, uint32_t timeoutUs)
{
    int due = 0, woken;
    size_t i;

    for (i = 0; i < count; i++) {
        const uint32_t delay = mbm_tls_pollDelay(&tlss[i]);

        due |= delay == 0;
        if (delay < timeoutUs)
            timeoutUs = delay;
    }
    woken = mbm_tcp_wait(tcps, count, listener, fd, timeoutUs);
    return woken < 0 ? woken : woken || due;
}
