/* The DMA with channels, of F1 and G0 (RM0008, RM0444). An F1 has fixed channels for USART1: 5 and
 * 4 of DMA1. A G0 has a DMAMUX; here channels 2 and 3, which have one interrupt. */
#include "chip.h"

#ifdef DMAMUX1
enum { RX = 1, TX = 2 }; /* counted from 0 */
#define IS_LED(channel, request) ((channel)->CCR == (request))
static DMAMUX_Channel_TypeDef *rxMux, *txMux;
#else
enum { RX = 4, TX = 3 };
#define IS_LED(channel, request) 1
#endif
enum { ALL = 1, COMPLETE = 2, HALF = 4, FAILED = 8 };

static DMA_TypeDef *dma;
static DMA_Channel_TypeDef *rx, *tx;
static uint32_t rxEnabled, txEnabled, rxReload, txReload, rxPlace, txPlace;

void dma_wire(uint8_t *registers)
{
    dma = (DMA_TypeDef *)(registers + DMA1_BASE % 4096);
#ifdef DMAMUX1
    rxDma.Instance = DMA1_Channel2;
    txDma.Instance = DMA1_Channel3;
    rxMux = (DMAMUX_Channel_TypeDef *)(registers + DMAMUX1_Channel1_BASE % 4096);
    txMux = (DMAMUX_Channel_TypeDef *)(registers + DMAMUX1_Channel2_BASE % 4096);
#else
    rxDma.Instance = DMA1_Channel5;
    txDma.Instance = DMA1_Channel4;
#endif
    rx = (DMA_Channel_TypeDef *)(registers + (uintptr_t)rxDma.Instance % 4096);
    tx = (DMA_Channel_TypeDef *)(registers + (uintptr_t)txDma.Instance % 4096);
}

void dma_reset(void)
{
    rxEnabled = txEnabled = 0;
}

/* A channel has moved a byte. */
static void count(DMA_Channel_TypeDef *channel, unsigned number, uint32_t reload)
{
    uint32_t flags = 0;

    channel->CNDTR--;
    if (channel->CNDTR == reload / 2)
        flags = HALF | ALL;
    else if (channel->CNDTR == 0)
        flags = COMPLETE | ALL;
    dma->ISR |= flags << (4 * number);
}

static void fail_reception(void)
{
    rxEnabled = rx->CCR &= ~DMA_CCR_EN;
    dma->ISR |= (uint32_t)(FAILED | ALL) << (4 * RX);
}

static void serve_reception(void)
{
    if ((rx->CCR & DMA_CCR_EN) && m.rxDmaFails && usart_has_byte())
        fail_reception();
    if (!IS_LED(rxMux, DMA_REQUEST_USART1_RX))
        return;
    while ((rx->CCR & DMA_CCR_EN) && rx->CNDTR != 0 && usart_has_byte()) {
        dma_write(rx->CMAR + rxPlace++, usart_take_byte());
        count(rx, RX, rxReload);
        if (rx->CNDTR != 0)
            continue;
        rxPlace = 0;
        /* Without CIRC a channel stays enabled, and moves nothing. */
        if (rx->CCR & DMA_CCR_CIRC)
            rx->CNDTR = rxReload;
    }
}

static void serve_transmission(void)
{
    if (!IS_LED(txMux, DMA_REQUEST_USART1_TX))
        return;
    while ((tx->CCR & DMA_CCR_EN) && tx->CNDTR != 0 && usart_wants_byte()) {
        if (m.txDmaStops && tx->CNDTR < 4)
            return;
        usart_put_byte(dma_read(tx->CMAR + txPlace++));
        count(tx, TX, txReload);
    }
}

void dma_serve(void)
{
    serve_reception();
    serve_transmission();
}

void dma_stop_reception(void)
{
    rxEnabled = rx->CCR &= ~DMA_CCR_EN;
}

void dma_before(void)
{
    dma->IFCR = 0;
}

static void clear(void)
{
    uint32_t clears = dma->IFCR;

    for (unsigned number = 0; number < 7; number++)
        if (clears >> (4 * number) & ALL)
            clears |= 0xFu << (4 * number);
    dma->ISR &= ~clears;
}

void dma_after(void)
{
    clear();
    if ((rx->CCR & DMA_CCR_EN) && !rxEnabled) {
        rxReload = rx->CNDTR;
        rxPlace = 0;
    }
    if ((tx->CCR & DMA_CCR_EN) && !txEnabled) {
        txReload = tx->CNDTR;
        txPlace = 0;
    }
    rxEnabled = rx->CCR & DMA_CCR_EN;
    txEnabled = tx->CCR & DMA_CCR_EN;
    dma_serve();
}

static int waits(const DMA_Channel_TypeDef *channel, unsigned number)
{
    uint32_t flags = dma->ISR >> (4 * number);

    return ((flags & COMPLETE) && (channel->CCR & DMA_CCR_TCIE)) ||
           ((flags & HALF) && (channel->CCR & DMA_CCR_HTIE)) ||
           ((flags & FAILED) && (channel->CCR & DMA_CCR_TEIE));
}

unsigned dma_waits(void)
{
    return (waits(rx, RX) ? RX_WAITS : 0) | (waits(tx, TX) ? TX_WAITS : 0);
}
