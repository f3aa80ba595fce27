/* The classes that network libraries have in common, as far as the examples use them. The
 * network of a simulated board is a UART: it carries the bytes of one connection, with
 * 115200 baud, and a test has sockets at its far end. `Network::uart()` returns it. */
#ifndef UART_NETWORK_H
#define UART_NETWORK_H

#include <Arduino.h>
#include <Client.h>
#include <IPAddress.h>
#include <Server.h>

template <typename Network> struct UartState {
    static bool isWaiting; /* a client that the listener has not handed over */
    static bool isOpen;
};
template <typename Network> bool UartState<Network>::isWaiting;
template <typename Network> bool UartState<Network>::isOpen;

template <typename Network> class UartServer;

template <typename Network> class UartClient : public Client {
public:
    UartClient() : socket(none) {}
    int connect(IPAddress, uint16_t) override { return connect("", 0); }
    int connect(const char *, uint16_t) override
    {
        Network::uart().begin(115200);
        UartState<Network>::isOpen = true;
        socket = 0;
        return 1;
    }
    size_t write(uint8_t value) override { return write(&value, 1); }
    size_t write(const uint8_t *bytes, size_t length) override
    {
        return connected() ? Network::uart().write(bytes, length) : 0;
    }
    int available() override { return connected() ? Network::uart().available() : 0; }
    int read() override { return connected() ? Network::uart().read() : -1; }
    int read(uint8_t *bytes, size_t length) override
    {
        size_t count = 0;
        while (count < length && available() > 0)
            bytes[count++] = static_cast<uint8_t>(read());
        return count > 0 ? static_cast<int>(count) : -1;
    }
    int peek() override { return connected() ? Network::uart().peek() : -1; }
    void flush() override {}
    void stop() override
    {
        if (connected())
            UartState<Network>::isOpen = false;
        socket = none;
    }
    uint8_t connected() override { return socket != none && UartState<Network>::isOpen; }
    operator bool() override { return socket != none; }
    bool operator==(const UartClient &other) { return socket == other.socket; }

private:
    friend class UartServer<Network>;
    enum : uint8_t { none = 8 };
    uint8_t socket;
};

template <typename Network> class UartServer : public Server {
public:
    explicit UartServer(uint16_t) {}
    void begin() override
    {
        Network::uart().begin(115200);
        UartState<Network>::isWaiting = true;
    }
    UartClient<Network> accept()
    {
        UartClient<Network> client;
        if (UartState<Network>::isWaiting) {
            UartState<Network>::isWaiting = false;
            UartState<Network>::isOpen = true;
            client.socket = 0;
        }
        return client;
    }
    UartClient<Network> available() { return accept(); }
    size_t write(uint8_t value) override { return Network::uart().write(value); }
    using Print::write;
};

#endif
