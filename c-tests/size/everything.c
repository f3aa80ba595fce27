/* A master with its ten functions, and a server with every function, on a serial line in
 * RTU and ASCII and over TCP. */
#include "everything.h"

int main(void)
{
    serve_everything();
    begin();
    for (;;) {
        uart = CALL(mbm_server_poll(&server));
        CALL_TEN_FUNCTIONS();
    }
}
