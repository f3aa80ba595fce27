/* A program that reads holding registers and writes them from the transmit words. */
#include "size.h"

int main(void)
{
    begin();
    for (;;)
        CALL_FC03_AND_FC16();
}
