/* A Stream over a pty, for a sketch's class with a real device at the far end. */
#ifndef PTY_STREAM_H
#define PTY_STREAM_H

#include "Arduino.h"

#include <sys/ioctl.h>
#include <unistd.h>

class PtyStream : public Stream {
public:
    using Print::write;
    int fd = -1;

    int available() override
    {
        int waiting = 0;
        return ioctl(fd, FIONREAD, &waiting) == 0 ? waiting : 0;
    }
    int read() override
    {
        uint8_t value;
        return available() > 0 && ::read(fd, &value, 1) == 1 ? value : -1;
    }
    int peek() override { return -1; }
    size_t write(uint8_t value) override { return ::write(fd, &value, 1) == 1; }
};

#endif
