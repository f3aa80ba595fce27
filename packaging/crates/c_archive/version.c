#include "mbm.h"

#include <stdio.h>

int main(void)
{
    printf("mbm %s\n", mbm_version());
    return 0;
}
