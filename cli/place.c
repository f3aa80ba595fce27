/* Reads the names of lines, and knows what each kind of line may have. */
#include "place.h"

#include "numbers.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static const struct {
    const char *scheme;
    enum place_kind kind;
    uint8_t framing;
    const char *service; /* NULL: must be given */
    const char *keys;
} kinds[] = {
    {"rtu:", PLACE_RTU, MBM_FRAMING_RTU, NULL,
     "baud, parity, stop, rs485, echo, gap, latency and shared"},
    {"ascii:", PLACE_ASCII, MBM_FRAMING_ASCII, NULL,
     "baud, parity, stop, data, rs485, echo and shared"},
    {"pty:", PLACE_PTY, MBM_FRAMING_RTU, NULL, ""},
    {"tcp://", PLACE_TCP, MBM_FRAMING_TCP, "502", ""},
    {"rtu+tcp://", PLACE_RTU_OVER_TCP, MBM_FRAMING_RTU_OVER_TCP, NULL, ""},
    {"udp://", PLACE_UDP, MBM_FRAMING_TCP, "502", ""},
    {"tls://", PLACE_TLS, MBM_FRAMING_TCP, "802", "ca, cert, key and name"},
};

enum { KINDS = sizeof kinds / sizeof kinds[0] };

/* --- keys --- */

/* Reads the key of a serial line. `wrong` receives what is wrong with the value. Returns 0 if there
 * is no such key. */
static int read_serial_key(place *p, const char *key, const char *value, const char **wrong)
{
    static const char *const parities[] = {"none", "even", "odd", NULL}, *const yes[] = {
                                                                             "no", "yes", NULL};
    const int is_ascii = p->kind == PLACE_ASCII;
    int64_t number = 0;
    int index = 0;

    if (strcmp(key, "baud") == 0) {
        *wrong = number_read(value, 50, 4000000, &number);
        p->tty.baud = (uint32_t)number;
    } else if (strcmp(key, "parity") == 0) {
        *wrong = number_word(value, parities, &index);
        p->tty.parity = "NEO"[index];
    } else if (strcmp(key, "stop") == 0) {
        *wrong = number_read(value, 1, 2, &number);
        p->tty.stop = (uint8_t)number;
    } else if (strcmp(key, "data") == 0 && is_ascii) {
        *wrong = number_read(value, 7, 8, &number);
        p->tty.data = (uint8_t)number;
    } else if (strcmp(key, "rs485") == 0) {
        *wrong = number_word(value, yes, &index);
        p->tty.rs485 = (uint8_t)index;
    } else if (strcmp(key, "echo") == 0) {
        *wrong = number_word(value, yes, &index);
        p->discards_echo = (uint8_t)index;
        p->has_echo = 1;
    } else if (strcmp(key, "shared") == 0) {
        *wrong = number_word(value, yes, &index);
        p->tty.shared = (uint8_t)index;
        p->tty.exclusive = !index;
    } else if (strcmp(key, "gap") == 0 && !is_ascii) {
        *wrong = number_time(value, 1, 60000, &p->gapMs);
        p->has_gap = 1;
    } else if (strcmp(key, "latency") == 0 && !is_ascii) {
        *wrong = number_time(value, 0, UINT16_MAX, &p->latencyMs);
        p->has_latency = 1;
    } else {
        return 0;
    }
    return 1;
}

static int read_tls_key(place *p, const char *key, const char *value, const char **wrong)
{
    char *const to = strcmp(key, "ca") == 0     ? p->ca
                     : strcmp(key, "cert") == 0 ? p->cert
                     : strcmp(key, "key") == 0  ? p->key
                     : strcmp(key, "name") == 0 ? p->name
                                                : NULL;

    if (to && (size_t)snprintf(to, PLACE_PATH_BYTES, "%s", value) >= PLACE_PATH_BYTES)
        *wrong = say("\"%s\" is too long", value);
    return to != NULL;
}

static int read_reach_key(place *p, const char *key, const char *value, const char **wrong)
{
    int i;

    for (i = 0; i < REACH_KEYS; i++)
        if (strcmp(key, reach_names[i]) == 0) {
            *wrong = reach_read(&p->reach, i, value);
            return 1;
        }
    return 0;
}

/* Reads KEY=VALUE&KEY=VALUE. */
static const char *read_keys(place *p, char *keys, int is_server)
{
    char *rest, *word;
    char seen[400] = "&";

    for (word = strtok_r(keys, "&", &rest); word; word = strtok_r(NULL, "&", &rest)) {
        char *value = strchr(word, '='), key[32];
        const char *wrong = NULL;
        int is_known;

        if (!value || value == word || !value[1])
            return say("%s: \"%s\" is not KEY=VALUE", p->text, word);
        *value++ = '\0';
        is_known = place_is_serial(p)     ? read_serial_key(p, word, value, &wrong)
                   : p->kind == PLACE_TLS ? read_tls_key(p, word, value, &wrong)
                                          : 0;
        if (!is_known && !is_server)
            is_known = read_reach_key(p, word, value, &wrong);
        if (!is_known && !*kinds[p->kind].keys && is_server)
            return say("%s: \"%s\" is unknown: %s has no keys", p->text, word,
                       kinds[p->kind].scheme);
        if (!is_known)
            return say("%s: the key \"%s\" is unknown: %s has %s%s%s", p->text, word,
                       kinds[p->kind].scheme, kinds[p->kind].keys,
                       is_server              ? ""
                       : *kinds[p->kind].keys ? "; and "
                                              : "",
                       is_server ? "" : REACH_WORDS);
        if (wrong) {
            char copy[400];

            snprintf(copy, sizeof copy, "%s", wrong);
            return say("%s: %s: %s", p->text, word, copy);
        }
        snprintf(key, sizeof key, "&%s&", word);
        if (strstr(seen, key))
            return say("%s: the key \"%s\" is given twice", p->text, word);
        strncat(seen, key + 1, sizeof seen - strlen(seen) - 1);
    }
    return NULL;
}

/* --- paths and hosts --- */

static const char *read_path(place *p, const char *path, int is_server)
{
    const mbm_tty_options defaults = {.baud = 19200,
                                      .anyRate = 1,
                                      .parity = 'E',
                                      .stop = 1,
                                      .exclusive = 1,
                                      .data = p->kind == PLACE_ASCII ? 7 : 8};

    p->tty = defaults;
    if (p->kind == PLACE_PTY && !is_server)
        return say("%s: only a server makes a pseudo terminal", p->text);
    if (p->kind != PLACE_PTY && !*path)
        return say("%s: the path of the terminal is missing, such as %s/dev/ttyUSB0", p->text,
                   kinds[p->kind].scheme);
    if ((size_t)snprintf(p->path, sizeof p->path, "%s", path) >= sizeof p->path)
        return say("%s: the path is too long", p->text);
    return NULL;
}

/* Reads HOST, HOST:PORT, [IPV6] or [IPV6]:PORT. */
static const char *read_host(place *p, char *host, int is_server)
{
    char *end = *host == '[' ? strchr(host, ']') : NULL, *service;
    const char *wrong;
    int64_t port;

    if (*host == '[' && !end)
        return say("%s: the bracket after the address is missing", p->text);
    service = strrchr(end ? end : host, ':');
    if (end) {
        if (end[1] && end[1] != ':')
            return say("%s: \"%s\" after the address is not :PORT", p->text, end + 1);
        *end = '\0';
        host++;
    } else if (service && memchr(host, ':', (size_t)(service - host))) {
        return say("%s: an IPv6 address needs brackets, such as [::1]:502", p->text);
    }
    if (service)
        *service++ = '\0';
    if (!*host && !is_server)
        return say("%s: the host is missing, such as %s192.168.0.7", p->text,
                   kinds[p->kind].scheme);
    if (strpbrk(host, "/ ,"))
        return say("%s: \"%s\" is not a host", p->text, host);
    if (!service && !kinds[p->kind].service)
        return say("%s: the port is missing, such as %s%s:4001", p->text, kinds[p->kind].scheme,
                   host);
    wrong = service ? number_read(service, is_server ? 0 : 1, 65535, &port) : NULL;
    if (wrong)
        return say("%s: the port %s", p->text, wrong);
    if ((size_t)snprintf(p->host, sizeof p->host, "%s", host) >= sizeof p->host)
        return say("%s: the host is too long", p->text);
    snprintf(p->service, sizeof p->service, "%s", service ? service : kinds[p->kind].service);
    return NULL;
}

const char *place_read(place *p, const char *text, int is_server)
{
    char copy[1500], *keys;
    const char *wrong, *rest;
    int i = 0;

    memset(p, 0, sizeof *p);
    p->text = text;
    while (i < KINDS && strncmp(text, kinds[i].scheme, strlen(kinds[i].scheme)) != 0)
        i++;
    if (i == KINDS)
        return say(
            "\"%s\" is not a line: it begins with rtu:, ascii:, tcp://, rtu+tcp://, udp:// or "
            "tls://, such as tcp://192.168.0.7 or rtu:/dev/ttyUSB0",
            text);
    p->kind = kinds[i].kind;
    p->framing = kinds[i].framing;
    rest = text + strlen(kinds[i].scheme);
    if ((size_t)snprintf(copy, sizeof copy, "%s", rest) >= sizeof copy)
        return say("the name of the line is too long");
    keys = strchr(copy, '?');
    if (keys)
        *keys++ = '\0';
    wrong = place_is_serial(p) ? read_path(p, copy, is_server) : read_host(p, copy, is_server);
    if (!wrong && keys)
        wrong = read_keys(p, keys, is_server);
    if (!wrong && p->kind == PLACE_TLS && !(*p->ca && *p->cert && *p->key))
        wrong = say("%s: tls:// needs the keys ca, cert and key, each a file", text);
    if (!wrong && keys) {
        const reach_line line = place_reach(p, 1);

        wrong = reach_check(&p->reach, &line, "");
        if (wrong)
            wrong = say("%s: %s", text, wrong);
    }
    return wrong;
}

reach_line place_reach(const place *p, uint32_t in_flight)
{
    return (reach_line){.framing = p->framing,
                        .has_link = p->kind != PLACE_UDP,
                        .in_flight = p->framing == MBM_FRAMING_TCP ? in_flight : 1};
}

int place_is_serial(const place *p)
{
    return p->kind == PLACE_RTU || p->kind == PLACE_ASCII || p->kind == PLACE_PTY;
}

int place_is_tcp(const place *p)
{
    return p->kind == PLACE_TCP || p->kind == PLACE_RTU_OVER_TCP || p->kind == PLACE_TLS;
}

const char *place_host(const place *p)
{
    return *p->host ? p->host : NULL;
}

const char *place_advice(const place *p, int error)
{
    if (!place_is_serial(p))
        return error == EACCES       ? "Ports below 1024 need the right to them"
               : error == EADDRINUSE ? "Another program listens there"
                                     : "";
    if (p->kind == PLACE_PTY)
        return error == ENOENT   ? "The folder of this name is not there"
               : error == EACCES ? "Take a name in a folder that you may write to"
                                 : "";
    switch (error) {
    case ENOENT: return "Is the adapter plugged in? ls /dev/tty* shows the terminals";
    case EACCES: return "On many systems the group dialout may open terminals: see groups";
    case EBUSY:
        return "End that program first. shared=yes in the name of the line lets both have it, but "
               "each byte then reaches only one of them";
    case ENOTTY: return "It is no terminal, or its driver has no RS-485";
    case EINVAL: return "The terminal does not have this rate, parity or number of bits";
    default: return "";
    }
}
