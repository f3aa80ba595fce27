/* A program that calls the ten functions of the master. */
#include "size.h"

int main(void)
{
    begin();
    for (;;) {
        CALL_TEN_FUNCTIONS();
    }
}
