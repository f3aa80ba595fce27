/* libmodbus clients that call in a thread of their own while the test runs a sketch's loop. */
#ifndef LIBMODBUS_CLIENT_H
#define LIBMODBUS_CLIENT_H

#include "network.h"

extern "C" {
#include "await.h"
#include <modbus.h>
#include <pthread.h>
}

/* Connects a client to the port on which the sketch listens as `port`. */
inline modbus_t *connect_client(uint16_t port, int unit = 255)
{
    modbus_t *peer = modbus_new_tcp("127.0.0.1", networkPort(port));
    modbus_set_slave(peer, unit);
    modbus_set_response_timeout(peer, PATIENCE_MS / 1000, 0);
    assert_int_equal(modbus_connect(peer), 0);
    return peer;
}

inline void close_client(modbus_t *peer)
{
    modbus_close(peer);
    modbus_free(peer);
}

struct ClientCall {
    modbus_t *peer;
    int (*call)(modbus_t *);
    int result;
    int over;
};

inline void *run_client_call(void *argument)
{
    ClientCall *c = static_cast<ClientCall *>(argument);
    c->result = c->call(c->peer);
    __atomic_store_n(&c->over, 1, __ATOMIC_SEQ_CST);
    return nullptr;
}

/* Runs `loop` again and again until the client's call returns. Returns its result. */
template <typename Loop> int result_of(modbus_t *peer, int (*call)(modbus_t *), Loop loop)
{
    ClientCall c = {peer, call, -2, 0};
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, nullptr, run_client_call, &c), 0);
    AWAIT((loop(), __atomic_load_n(&c.over, __ATOMIC_SEQ_CST)));
    pthread_join(thread, nullptr);
    return c.result;
}

#endif
