/* The program: a master with MASTER, a server with SERVER, with both one after the other; over
 * nanoMODBUS with NANO. */
#if defined(MASTER) && defined(NANO)
#include "nano_master.h"
#elif defined(MASTER)
#include "master.h"
#endif
#if defined(SERVER) && defined(NANO)
#include "nano_server.h"
#elif defined(SERVER)
#include "server.h"
#endif

uint8_t run(void)
{
    uint8_t wrong = 0;

#ifdef MASTER
    wrong = run_master();
#endif
#ifdef SERVER
    wrong = wrong ? wrong : run_server();
#endif
    return wrong;
}
