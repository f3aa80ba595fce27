/* The state of the simulated board, for tests: its clock and its log. */
#ifndef SHIM_BOARD_H
#define SHIM_BOARD_H

#include <stdint.h>
#include <string>
#include <time.h>

struct Board {
    uint32_t now = 0;        /* microseconds, modulo 2^32 */
    uint32_t tick = 20;      /* microseconds that each read of the clock takes */
    bool realTime = false;   /* use the clock of the host instead */
    unsigned clockReads = 0; /* how often the clock was read */
    unsigned yields = 0;
    std::string log; /* the events in their order; equal events in a row are logged once */

    void logEvent(const char *event)
    {
        std::string entry(event);
        entry += ' ';
        bool repeated = log.size() >= entry.size() &&
                        log.compare(log.size() - entry.size(), entry.size(), entry) == 0 &&
                        (log.size() == entry.size() || log[log.size() - entry.size() - 1] == ' ');
        if (!repeated)
            log += entry;
    }

    uint32_t micros()
    {
        clockReads++;
        if (realTime) {
            struct timespec t;
            clock_gettime(CLOCK_MONOTONIC, &t);
            return static_cast<uint32_t>(static_cast<uint64_t>(t.tv_sec) * 1000000u +
                                         static_cast<uint64_t>(t.tv_nsec) / 1000u);
        }
        now += tick;
        return now;
    }
};

inline Board &board()
{
    static Board only;
    return only;
}

#endif
