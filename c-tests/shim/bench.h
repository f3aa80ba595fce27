/* The state of the simulated board that tests can read: its clock and its log. */
#ifndef BENCH_H
#define BENCH_H

#include <stdint.h>
#include <string>
#include <time.h>

struct Bench {
    uint32_t now = 0;      /* microseconds; wraps */
    uint32_t tick = 20;    /* microseconds that each read of the clock takes */
    bool realTime = false; /* use the clock of the host instead */
    unsigned looks = 0;    /* how often the clock was read */
    unsigned yields = 0;
    std::string log; /* the events in order; a repeated event is there once */

    void note(const char *event)
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
        looks++;
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

inline Bench &bench()
{
    static Bench only;
    return only;
}

#endif
