/* What a test sees of the board behind the shim: its clock and its log. */
#ifndef BENCH_H
#define BENCH_H

#include <stdint.h>
#include <string>
#include <time.h>

struct Bench {
    uint32_t now = 0;      /* microseconds; wraps */
    uint32_t tick = 20;    /* what a look at the clock takes */
    bool realTime = false; /* the host's clock instead */
    unsigned looks = 0;    /* at the clock, so far */
    unsigned yields = 0;
    uint8_t pins[16] = {}; /* how often each was set high */
    std::string log;       /* what happened, in order; repetitions once */

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
