/* The part of Arduino that the library's classes use, for tests on a host. SHIM_UARTS, 1 to 4,
 * is the number of the board's UARTs. A test may define it before it includes this file. */
#ifndef SHIM_ARDUINO_H
#define SHIM_ARDUINO_H

#include "Print.h"
#include "board.h"
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
    return board().micros();
}
inline unsigned long millis()
{
    return board().micros() / 1000;
}
#define lowByte(w) ((uint8_t)((w)&0xff))
#define highByte(w) ((uint8_t)((w) >> 8))
inline void yield()
{
    board().yields++;
}
inline void delay(unsigned long milliseconds)
{
    const uint32_t start = board().micros();
    while (board().micros() - start < milliseconds * 1000)
        yield();
}

class Stream : public Print {
public:
    using Print::write;
    virtual int available() = 0;
    virtual int read() = 0;
    virtual int peek() = 0;
    virtual void flush() {}
};

/* A UART. The test queues replies, and each flush lets the next reply arrive. */
class HardwareSerial : public Stream {
public:
    typedef std::vector<uint8_t> Bytes;

    unsigned long baud = 0;       /* 0: not open */
    std::vector<Bytes> sent;      /* each element: the bytes between two flushes */
    uint32_t sentAt = 0;          /* time of the end of the last sent byte, us */
    uint32_t startedAt = 0;       /* time of the first write of a frame, us */
    uint32_t delay = 1000;        /* from a flush to the reply, us */
    uint32_t character = 573;     /* from one byte of a reply to the next, us */
    size_t writeSpace = SIZE_MAX; /* bytes that one write accepts */

    void begin(unsigned long rate) { baud = rate; }

    /* Queues a reply: each flush takes one from the queue. */
    void reply(const Bytes &bytes) { replies.push_back(bytes); }

    /* Lets bytes arrive now, without a request. */
    void inject(const Bytes &bytes) { arrive(bytes, board().now, 0); }

    /* Lets bytes arrive from a time on, `pace` microseconds apart. */
    void arrive(const Bytes &bytes, uint32_t when, uint32_t pace)
    {
        for (size_t i = 0; i < bytes.size(); i++)
            line.push_back(Arrival{when + static_cast<uint32_t>(i) * pace, bytes[i]});
    }

    int available() override
    {
        int count = 0;
        for (const Arrival &arrival : line)
            count += static_cast<int32_t>(board().now - arrival.when) >= 0;
        return count;
    }
    int read() override
    {
        if (available() == 0)
            return -1;
        board().logEvent("read");
        uint8_t value = line.front().value;
        line.pop_front();
        return value;
    }
    int peek() override { return available() == 0 ? -1 : line.front().value; }

    size_t write(uint8_t value) override
    {
        if (writeSpace == 0) {
            setWriteError();
            return 0;
        }
        board().logEvent("write");
        if (out.empty())
            startedAt = board().now;
        out.push_back(value);
        return 1;
    }
    size_t write(const uint8_t *bytes, size_t length) override
    {
        return Stream::write(bytes, length < writeSpace ? length : writeSpace);
    }
    void flush() override
    {
        board().logEvent("flush");
        board().now += static_cast<uint32_t>(out.size()) * character;
        sentAt = board().now;
        sent.push_back(out);
        out.clear();
        if (!replies.empty()) {
            arrive(replies.front(), board().now + delay, character);
            replies.pop_front();
        }
    }

    /* Sets all members to their first values. */
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
