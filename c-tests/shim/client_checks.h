/* What the tests of ModbusSerialClient share: a loop, and a check of one exchange. */
#ifndef CLIENT_CHECKS_H
#define CLIENT_CHECKS_H

#include "wire.h"

#include "ModbusClient.h"

/* Calls poll, as a sketch's loop does, until no request is pending. */
inline void run_until_idle(ModbusClient &client)
{
    uint32_t until = board().now + 60000000;
    while (client.poll() == MBM_PENDING)
        assert_true(static_cast<int32_t>(until - board().now) > 0);
    assert_int_equal(client.pending(), 0);
}

/* Lets a queued request run to its end: expects its frame on the wire and lets `response`
 * arrive. Both are given without their CRC. */
inline void expect_exchange(ModbusClient &client, uint8_t queued,
                            std::initializer_list<int> request, std::initializer_list<int> response)
{
    assert_int_equal(queued, MBM_PENDING);
    Serial.reply(adu(response));
    run_until_idle(client);
    assert_sent(Serial, request);
}

#endif
