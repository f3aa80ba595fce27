/* The parts of a chip of which USART1, its two channels of a DMA, and GPIOA are played, as the
 * reference manuals of the families describe their registers. usart_sr.c has the USART of F1 and
 * F4, usart_isr.c that of G0 and H7; dma_channel.c the DMA of F1 and G0, dma_stream.c that of F4
 * and H7; cache.c the data cache of an H7. */
#ifndef CHIP_H
#define CHIP_H

#include "machine.h"
#include "main.h"

#if defined(STM32G071xx)
enum { FIFO_DEPTH = 8 };
#elif defined(STM32H743xx)
enum { FIFO_DEPTH = 16 };
#else
enum { FIFO_DEPTH = 1 };
#endif

extern DMA_HandleTypeDef rxDma, txDma;
extern USART_TypeDef *usart; /* as the chip sees them */

void usart_reset(void);
void usart_before(void);
void usart_after(uint32_t offset, int isWrite);
int usart_interrupts(void);
/* Between USART and DMA: whether it wants a byte moved, and the byte. */
int usart_has_byte(void);
uint8_t usart_take_byte(void);
int usart_wants_byte(void);
void usart_put_byte(uint8_t byte);

enum { RX_WAITS = 1, TX_WAITS = 2 };

/* Fills in the parts of both handles that the chip settles; `registers` is the DMA's page. */
void dma_wire(uint8_t *registers);
void dma_reset(void);
void dma_before(void);
void dma_after(void);
/* Moves what the USART wants moved. */
void dma_serve(void);
void dma_stop_reception(void);
/* Whose interrupts wait: RX_WAITS, TX_WAITS. */
unsigned dma_waits(void);

/* The memory as the DMA sees it. */
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
void cache_start(uint8_t *registers);
void cache_after(uint32_t offset, int isWrite);
void dma_write(uint32_t address, uint8_t byte);
uint8_t dma_read(uint32_t address);
#else
static inline void dma_write(uint32_t address, uint8_t byte)
{
    *(uint8_t *)(uintptr_t)address = byte;
}

static inline uint8_t dma_read(uint32_t address)
{
    return *(const uint8_t *)(uintptr_t)address;
}
#endif

#endif
