/* The classes of a network library over real sockets. Every address is that of this machine.
 * networkPort maps the ports of a sketch to free ports of this machine. */
#ifndef SHIM_NETWORK_H
#define SHIM_NETWORK_H

#include "Client.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <map>
#include <memory>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>
#include <vector>

/* Returns the port of this machine for a port of the sketch. A listener sets it, and a test sets
 * it before a sketch connects. */
inline uint16_t &networkPort(uint16_t sketchPort)
{
    static std::map<uint16_t, uint16_t> ports;
    return ports[sketchPort];
}

/* A connection. A copy is the same connection, as in the real libraries. */
class SocketClient : public Client {
public:
    size_t writeSpace = SIZE_MAX; /* bytes that one write accepts */

    SocketClient() = default;
    explicit SocketClient(int fd) : socket(std::make_shared<Socket>(fd)) {}

    int connect(IPAddress, uint16_t port) override { return connectTo(networkPort(port)); }
    int connect(const char *, uint16_t port) override { return connectTo(networkPort(port)); }

    size_t write(uint8_t value) override { return write(&value, 1); }
    size_t write(const uint8_t *bytes, size_t length) override
    {
        ssize_t sent = send(fd(), bytes, length < writeSpace ? length : writeSpace, MSG_NOSIGNAL);
        return sent < 0 ? 0 : static_cast<size_t>(sent);
    }
    int available() override
    {
        int waiting = 0;
        return fd() >= 0 && ioctl(fd(), FIONREAD, &waiting) == 0 ? waiting : 0;
    }
    int read() override
    {
        uint8_t value;
        return read(&value, 1) == 1 ? value : -1;
    }
    int read(uint8_t *bytes, size_t length) override
    {
        return fd() < 0 ? -1 : static_cast<int>(recv(fd(), bytes, length, 0));
    }
    int peek() override
    {
        uint8_t value;
        return fd() >= 0 && recv(fd(), &value, 1, MSG_PEEK) == 1 ? value : -1;
    }
    void flush() override {}
    void stop() override { socket.reset(); }
    /* True also after the peer has closed, while received bytes are unread, as in the libraries. */
    uint8_t connected() override
    {
        uint8_t value;
        ssize_t count = fd() < 0 ? 0 : recv(fd(), &value, 1, MSG_PEEK);
        return count > 0 || (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK));
    }
    operator bool() override { return fd() >= 0; }
    bool operator==(const SocketClient &other) const { return socket == other.socket; }

private:
    struct Socket {
        int fd;
        explicit Socket(int descriptor) : fd(descriptor)
        {
            fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
        }
        ~Socket() { close(fd); }
        Socket(const Socket &) = delete;
        Socket &operator=(const Socket &) = delete;
    };
    std::shared_ptr<Socket> socket;

    int fd() const { return socket ? socket->fd : -1; }

    int connectTo(uint16_t port)
    {
        struct sockaddr_in to;
        memset(&to, 0, sizeof to);
        to.sin_family = AF_INET;
        to.sin_port = htons(port);
        to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (::connect(fd, reinterpret_cast<struct sockaddr *>(&to), sizeof to) != 0) {
            close(fd);
            return 0;
        }
        socket = std::make_shared<Socket>(fd);
        return 1;
    }
};

/* A listener. Its derived classes return connections in one of two ways. */
class SocketServer {
public:
    explicit SocketServer(uint16_t port) : sketchPort(port) {}
    ~SocketServer() { end(); }
    SocketServer(const SocketServer &) = delete;
    SocketServer &operator=(const SocketServer &) = delete;

    void begin()
    {
        struct sockaddr_in at;
        socklen_t length = sizeof at;
        memset(&at, 0, sizeof at);
        at.sin_family = AF_INET;
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        end();
        listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        if (bind(listener, reinterpret_cast<struct sockaddr *>(&at), sizeof at) == 0 &&
            listen(listener, 8) == 0 &&
            getsockname(listener, reinterpret_cast<struct sockaddr *>(&at), &length) == 0)
            networkPort(sketchPort) = ntohs(at.sin_port);
    }
    void end()
    {
        if (listener >= 0)
            close(listener);
        listener = -1;
    }

protected:
    /* Returns the descriptor of a new connection, each once, or -1. */
    int acceptFd() { return accept4(listener, nullptr, nullptr, SOCK_CLOEXEC); }
    /* Returns any connection with unread bytes, as often as it has some. */
    template <typename Link> Link withBytes(std::vector<Link> &links)
    {
        for (int fd = acceptFd(); fd >= 0; fd = acceptFd())
            links.push_back(Link(fd));
        for (Link &link : links)
            if (link.available() > 0)
                return link;
        return Link();
    }

private:
    uint16_t sketchPort;
    int listener = -1;
};

#endif
