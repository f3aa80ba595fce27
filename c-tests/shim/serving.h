/* What the tests of the server class share: a loop, and checks of the responses. */
#ifndef SERVING_H
#define SERVING_H

#include "wire.h"

#include "ModbusServer.h"

const uint32_t t35 = 2006; // 3.5 characters of 11 bits at 19200 baud, microseconds

/* Calls poll as loop() does, for 20 ms. */
inline void loops(ModbusServer &server)
{
    uint32_t until = bench().now + 20000;
    while (static_cast<int32_t>(until - bench().now) > 0)
        assert_int_equal(server.poll(), MBM_OK);
}

inline void hears(ModbusServer &server, const Bytes &bytes)
{
    Serial.inject(bytes);
    loops(server);
}

/* Sends a request and expects one response. Both are given without their CRC. */
inline void answers(ModbusServer &server, std::initializer_list<int> request,
                    std::initializer_list<int> response)
{
    hears(server, adu(request));
    assert_sent(Serial, response);
}

inline void keeps_silent(ModbusServer &server, const Bytes &bytes)
{
    hears(server, bytes);
    assert_int_equal(Serial.sent.size(), 0);
}

#endif
