/* As much of Arduino as ModbusMaster.h uses, for tests on a host. A test may
 * define SHIM_UARTS (1 to 4) before it includes this: the UARTs of its board. */
#ifndef SHIM_ARDUINO_H
#define SHIM_ARDUINO_H

#include "Print.h"
#include "bench.h"
#include "pins.h"

#include <deque>
#include <stddef.h>
#include <stdint.h>
#include <vector>

#define ARDUINO 10819

#ifndef SHIM_UARTS
#define SHIM_UARTS 4
#endif

inline unsigned long micros()
{
    return bench().micros();
}
inline unsigned long millis()
{
    return bench().micros() / 1000;
}
#define lowByte(w) ((uint8_t)((w)&0xff))
#define highByte(w) ((uint8_t)((w) >> 8))
inline void yield()
{
    bench().yields++;
}

class Stream : public Print {
public:
    using Print::write;
    virtual int available() = 0;
    virtual int read() = 0;
    virtual int peek() = 0;
    virtual void flush() {}
};

/* A UART whose far end a test scripts: each flush releases the next reply. */
class HardwareSerial : public Stream {
public:
    typedef std::vector<uint8_t> Bytes;

    unsigned long baud = 0;   /* 0: not open */
    std::vector<Bytes> sent;  /* what went out between two flushes */
    uint32_t sentAt = 0;      /* when the last byte had left */
    uint32_t startedAt = 0;   /* when the first byte was handed over */
    uint32_t delay = 1000;    /* from a flush to the reply, microseconds */
    uint32_t character = 573; /* between two bytes of a reply */
    size_t room = SIZE_MAX;   /* bytes that one write takes */

    void begin(unsigned long rate) { baud = rate; }

    /* What comes back after the next flush that has no reply yet. */
    void reply(const Bytes &bytes) { replies.push_back(bytes); }

    /* What arrives now, asked for by nobody. */
    void inject(const Bytes &bytes) { arrive(bytes, bench().now, 0); }

    /* What arrives at a time. */
    void arrive(const Bytes &bytes, uint32_t when, uint32_t pace)
    {
        for (size_t i = 0; i < bytes.size(); i++)
            line.push_back(Arrival{when + static_cast<uint32_t>(i) * pace, bytes[i]});
    }

    int available() override
    {
        int count = 0;
        for (const Arrival &arrival : line)
            count += static_cast<int32_t>(bench().now - arrival.when) >= 0;
        return count;
    }
    int read() override
    {
        if (available() == 0)
            return -1;
        bench().note("read");
        uint8_t value = line.front().value;
        line.pop_front();
        return value;
    }
    int peek() override { return available() == 0 ? -1 : line.front().value; }

    size_t write(uint8_t value) override
    {
        if (room == 0) {
            setWriteError();
            return 0;
        }
        bench().note("write");
        if (out.empty())
            startedAt = bench().now;
        out.push_back(value);
        return 1;
    }
    size_t write(const uint8_t *bytes, size_t length) override
    {
        return Stream::write(bytes, length < room ? length : room);
    }
    void flush() override
    {
        bench().note("flush");
        bench().now += static_cast<uint32_t>(out.size()) * character;
        sentAt = bench().now;
        sent.push_back(out);
        out.clear();
        if (!replies.empty()) {
            arrive(replies.front(), bench().now + delay, character);
            replies.pop_front();
        }
    }

    /* As fresh from the factory. */
    void reset() { *this = HardwareSerial(); }

private:
    struct Arrival {
        uint32_t when;
        uint8_t value;
    };
    std::deque<Arrival> line;
    std::deque<Bytes> replies;
    Bytes out;
};

inline HardwareSerial &shimSerial(unsigned index)
{
    static HardwareSerial ports[4];
    return ports[index];
}

#define Serial shimSerial(0)
#if SHIM_UARTS > 1
#define HAVE_HWSERIAL1
#define Serial1 shimSerial(1)
#endif
#if SHIM_UARTS > 2
#define HAVE_HWSERIAL2
#define Serial2 shimSerial(2)
#endif
#if SHIM_UARTS > 3
#define HAVE_HWSERIAL3
#define Serial3 shimSerial(3)
#endif

#endif
