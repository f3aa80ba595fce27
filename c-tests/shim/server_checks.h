/* What the tests of ModbusServer share: a loop, and checks of the responses. */
#ifndef SERVER_CHECKS_H
#define SERVER_CHECKS_H

#include "wire.h"

#include "ModbusServer.h"

const uint32_t t35 = 2006; // 3.5 characters of 11 bits at 19200 baud, microseconds

/* Calls poll, as a sketch's loop does, for 20 ms. */
inline void run_loop(ModbusServer &server)
{
    uint32_t until = board().now + 20000;
    while (static_cast<int32_t>(until - board().now) > 0)
        assert_int_equal(server.poll(), MBM_OK);
}

inline void receive(ModbusServer &server, const Bytes &bytes)
{
    Serial.inject(bytes);
    run_loop(server);
}

/* Sends a request and expects one response. Both are given without their CRC. */
inline void expect_response(ModbusServer &server, std::initializer_list<int> request,
                            std::initializer_list<int> response)
{
    receive(server, adu(request));
    assert_sent(Serial, response);
}

inline void expect_no_response(ModbusServer &server, const Bytes &bytes)
{
    receive(server, bytes);
    assert_int_equal(Serial.sent.size(), 0);
}

#endif
