/* Loads the library that its argument names, and calls its CRC-16 function. */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

int main(int argc, char **argv)
{
    uint16_t (*crc)(const uint8_t *, uint16_t);
    void *library = argc == 2 ? dlopen(argv[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    void *found;

    if (library == NULL) {
        fprintf(stderr, "load: %s\n", argc == 2 ? dlerror() : "give the path of a library");
        return 1;
    }
    found = dlsym(library, "mbm_frame_crc16");
    if (found == NULL) {
        fprintf(stderr, "load: %s\n", dlerror());
        return 1;
    }
    memcpy(&crc, &found, sizeof crc);
    /* The check value of CRC-16/MODBUS. */
    return crc((const uint8_t *)"123456789", 9) == 0x4B37 ? 0 : 1;
}
