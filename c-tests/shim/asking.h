/* What the tests of the clients' classes share: a loop, and one exchange on the wire. */
#ifndef ASKING_H
#define ASKING_H

#include "wire.h"

#include "ModbusClient.h"

/* As loop does, until no request is pending. */
inline void ends(ModbusClient &client)
{
    uint32_t until = bench().now + 60000000;
    while (client.poll() == MBM_PENDING)
        assert_true(static_cast<int32_t>(until - bench().now) > 0);
    assert_int_equal(client.pending(), 0);
}

/* A request that was queued goes out as one frame, and this is the reply; both without
 * their CRC. */
inline void exchanges(ModbusClient &client, uint8_t queued, std::initializer_list<int> request,
                      std::initializer_list<int> response)
{
    assert_int_equal(queued, MBM_PENDING);
    Serial.reply(adu(response));
    ends(client);
    assert_sent(Serial, request);
}

#endif
