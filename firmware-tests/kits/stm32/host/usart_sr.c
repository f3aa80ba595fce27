/* The USART with SR and DR, of F1 and F4 (RM0008, RM0090). */
#include "chip.h"

enum { ERRORS = USART_SR_PE | USART_SR_FE | USART_SR_NE | USART_SR_ORE };

static uint32_t sr, seen; /* the flags; those that a read of SR has shown */
static uint8_t rdr, tdr;

void usart_reset(void)
{
    sr = USART_SR_TXE | USART_SR_TC;
    seen = 0;
}

unsigned chip_kept(void)
{
    return 1;
}

static void read_data(void)
{
    sr &= ~(USART_SR_RXNE | seen);
    seen = 0;
}

int usart_has_byte(void)
{
    return (usart->CR3 & USART_CR3_DMAR) && (sr & USART_SR_RXNE);
}

uint8_t usart_take_byte(void)
{
    read_data();
    return rdr;
}

int usart_wants_byte(void)
{
    return (usart->CR3 & USART_CR3_DMAT) && (sr & USART_SR_TXE);
}

void usart_put_byte(uint8_t byte)
{
    tdr = byte;
    sr &= ~(USART_SR_TXE | USART_SR_TC);
}

void usart_before(void)
{
    usart->SR = sr;
    usart->DR = rdr;
}

void usart_after(uint32_t offset, int isWrite)
{
    if (offset == 0 && isWrite)
        sr &= usart->SR | ~(uint32_t)(USART_SR_TC | USART_SR_RXNE);
    else if (offset == 0)
        seen = sr & (ERRORS | USART_SR_IDLE);
    else if (offset == 4 && isWrite)
        usart_put_byte((uint8_t)usart->DR);
    else if (offset == 4)
        read_data();
}

void chip_receive(uint8_t byte, unsigned errors)
{
    if (!(usart->CR1 & USART_CR1_RE))
        return;
    sr |= (errors & FRAMING ? USART_SR_FE : 0) | (errors & NOISE ? USART_SR_NE : 0) |
          (errors & PARITY ? USART_SR_PE : 0);
    /* After an overrun nothing is received until the program has seen it. */
    if (sr & (USART_SR_RXNE | USART_SR_ORE)) {
        sr |= USART_SR_ORE;
        return;
    }
    if (errors & OVERRUN)
        sr |= USART_SR_ORE;
    rdr = byte;
    sr |= USART_SR_RXNE;
    if (m.rxDmaStops)
        dma_stop_reception();
    dma_serve();
}

void chip_idle(void)
{
    sr |= USART_SR_IDLE;
}

int chip_next(void)
{
    int next;

    dma_serve();
    if (sr & USART_SR_TXE)
        return -1;
    if (m.txDmaStops && !(usart->CR3 & USART_CR3_DMAT) && huart1.TxXferCount < 4)
        return -1;
    next = tdr;
    sr |= USART_SR_TXE;
    dma_serve();
    return next;
}

void chip_sent(void)
{
    if (sr & USART_SR_TXE)
        sr |= USART_SR_TC;
}

int usart_interrupts(void)
{
    uint32_t cr1 = usart->CR1, cr3 = usart->CR3;

    return ((sr & USART_SR_TXE) && (cr1 & USART_CR1_TXEIE)) ||
           ((sr & USART_SR_TC) && (cr1 & USART_CR1_TCIE)) ||
           ((sr & (USART_SR_RXNE | USART_SR_ORE)) && (cr1 & USART_CR1_RXNEIE)) ||
           ((sr & USART_SR_IDLE) && (cr1 & USART_CR1_IDLEIE)) ||
           ((sr & USART_SR_PE) && (cr1 & USART_CR1_PEIE)) ||
           ((sr & (USART_SR_FE | USART_SR_NE | USART_SR_ORE)) && (cr3 & USART_CR3_EIE) &&
            (cr3 & USART_CR3_DMAR));
}
