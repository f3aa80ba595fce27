/* The DMA with streams, of F4 and H7 (RM0090, RM0433): streams 2 and 7 of DMA2. An H7 has a
 * DMAMUX, which leads the requests of a peripheral to a stream. */
#include "chip.h"

#ifdef DMAMUX1
#define IS_LED(stream, request) ((stream)->CCR == (request))
static DMAMUX_Channel_TypeDef *rxMux, *txMux;
#else
#define IS_LED(stream, request) 1
#endif

static DMA_TypeDef *dma;
static DMA_Stream_TypeDef *rx, *tx;
static uint32_t rxEnabled, txEnabled, rxReload, txReload, rxPlace, txPlace;

void dma_wire(uint8_t *registers)
{
    dma = (DMA_TypeDef *)(registers + DMA2_BASE % 4096);
    rx = (DMA_Stream_TypeDef *)(registers + DMA2_Stream2_BASE % 4096);
    tx = (DMA_Stream_TypeDef *)(registers + DMA2_Stream7_BASE % 4096);
    rxDma.Instance = DMA2_Stream2;
    txDma.Instance = DMA2_Stream7;
#ifdef DMAMUX1
    rxMux = (DMAMUX_Channel_TypeDef *)(registers + DMAMUX1_Channel10_BASE % 4096);
    txMux = (DMAMUX_Channel_TypeDef *)(registers + DMAMUX1_Channel15_BASE % 4096);
#else
    rxDma.Init.Channel = txDma.Init.Channel = DMA_CHANNEL_4;
#endif
}

void dma_reset(void)
{
    rxEnabled = txEnabled = 0;
}

/* A stream has moved a byte. Returns the flags that this sets: half and all. */
static uint32_t counted(DMA_Stream_TypeDef *stream, uint32_t reload, uint32_t half, uint32_t all)
{
    stream->NDTR--;
    if (stream->NDTR == reload / 2)
        return half;
    return stream->NDTR == 0 ? all : 0;
}

static void fail_reception(void)
{
    rxEnabled = rx->CR &= ~DMA_SxCR_EN;
    dma->LISR |= DMA_LISR_TEIF2;
}

static void serve_reception(void)
{
    if ((rx->CR & DMA_SxCR_EN) && m.rxDmaFails && usart_has_byte())
        fail_reception();
    if (!(rx->CR & DMA_SxCR_EN) || !IS_LED(rxMux, DMA_REQUEST_USART1_RX))
        return;
    while ((rx->CR & DMA_SxCR_EN) && usart_has_byte()) {
        dma_write(rx->M0AR + rxPlace++, usart_take_byte());
        dma->LISR |= counted(rx, rxReload, DMA_LISR_HTIF2, DMA_LISR_TCIF2);
        if (rx->NDTR != 0)
            continue;
        rxPlace = 0;
        if (rx->CR & DMA_SxCR_CIRC)
            rx->NDTR = rxReload;
        else
            rx->CR &= ~DMA_SxCR_EN;
    }
    rxEnabled = rx->CR & DMA_SxCR_EN;
}

static void serve_transmission(void)
{
    if (!(tx->CR & DMA_SxCR_EN) || !IS_LED(txMux, DMA_REQUEST_USART1_TX))
        return;
    while ((tx->CR & DMA_SxCR_EN) && usart_wants_byte()) {
        if (m.txDmaStops && tx->NDTR < 4)
            break;
        usart_put_byte(dma_read(tx->M0AR + txPlace++));
        dma->HISR |= counted(tx, txReload, DMA_HISR_HTIF7, DMA_HISR_TCIF7);
        if (tx->NDTR == 0)
            tx->CR &= ~DMA_SxCR_EN;
    }
    txEnabled = tx->CR & DMA_SxCR_EN;
}

void dma_serve(void)
{
    serve_reception();
    serve_transmission();
}

void dma_stop_reception(void)
{
    rxEnabled = rx->CR &= ~DMA_SxCR_EN;
}

void dma_before(void)
{
    dma->LIFCR = dma->HIFCR = 0;
}

void dma_after(void)
{
    dma->LISR &= ~dma->LIFCR;
    dma->HISR &= ~dma->HIFCR;
    if ((rx->CR & DMA_SxCR_EN) && !rxEnabled) {
        rxReload = rx->NDTR;
        rxPlace = 0;
    }
    if ((tx->CR & DMA_SxCR_EN) && !txEnabled) {
        txReload = tx->NDTR;
        txPlace = 0;
    }
    /* A stream that is switched off says that it has ended. */
    if (!(rx->CR & DMA_SxCR_EN) && rxEnabled)
        dma->LISR |= DMA_LISR_TCIF2;
    if (!(tx->CR & DMA_SxCR_EN) && txEnabled)
        dma->HISR |= DMA_HISR_TCIF7;
    rxEnabled = rx->CR & DMA_SxCR_EN;
    txEnabled = tx->CR & DMA_SxCR_EN;
    dma_serve();
}

static int waits(const DMA_Stream_TypeDef *stream, uint32_t flags)
{
    return ((flags & 0x20) && (stream->CR & DMA_SxCR_TCIE)) ||
           ((flags & 0x10) && (stream->CR & DMA_SxCR_HTIE)) ||
           ((flags & 0x08) && (stream->CR & DMA_SxCR_TEIE));
}

unsigned dma_waits(void)
{
    return (waits(rx, dma->LISR >> 16) ? RX_WAITS : 0) |
           (waits(tx, dma->HISR >> 22) ? TX_WAITS : 0);
}
