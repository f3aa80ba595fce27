/* A board for linking the examples with the real ioLibrary: its bus goes to a register, and nothing
 * runs. */
#include "board.h"

#include "wizchip_conf.h"

#include <stddef.h>

#define SPI_DATA (*(volatile uint8_t *)0x40013000u)
#define CHIP_SELECT (*(volatile uint32_t *)0x40020000u)
#define TICKS (*(volatile uint32_t *)0x40030000u)

static void select_chip(void)
{
    CHIP_SELECT = 0;
}

static void release_chip(void)
{
    CHIP_SELECT = 1;
}

static uint8_t read_byte(void)
{
    return SPI_DATA;
}

static void write_byte(uint8_t byte)
{
    SPI_DATA = byte;
}

void board_begin(void)
{
    static uint8_t sizes[16] = {2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2};
    static wiz_NetInfo network = {
        .mac = {2, 0, 0, 0, 0, 1}, .ip = {192, 168, 0, 8}, .sn = {255, 255, 255, 0}};

    reg_wizchip_cs_cbfunc(select_chip, release_chip);
#if _WIZCHIP_ == W6100
    reg_wizchip_spi_cbfunc(read_byte, write_byte, NULL, NULL);
#else
    reg_wizchip_spi_cbfunc(read_byte, write_byte);
#endif
    (void)wizchip_init(sizes, sizes + 8);
    wizchip_setnetinfo(&network);
}

uint32_t board_micros(void *none)
{
    (void)none;
    return TICKS * 1000u;
}

void board_print(const char *text)
{
    while (*text != '\0')
        SPI_DATA = (uint8_t)*text++;
}

void board_printNumber(unsigned long number)
{
    SPI_DATA = (uint8_t)number;
}
