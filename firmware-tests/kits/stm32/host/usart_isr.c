/* The USART with ISR, ICR, RDR and TDR, and with a FIFO for each direction, of G0 and H7 (RM0444,
 * RM0433). Without FIFO mode a direction keeps one character. */
#include "chip.h"

#include <stddef.h>
#include <string.h>

enum { ERRORS = USART_ISR_PE | USART_ISR_FE | USART_ISR_NE | USART_ISR_ORE };

typedef struct fifo {
    uint8_t bytes[FIFO_DEPTH];
    uint32_t errors[FIFO_DEPTH];
    unsigned count;
} fifo;

static fifo in, out;
static uint32_t isr; /* the flags that stay until the program clears them */

unsigned chip_kept(void)
{
    return usart->CR1 & USART_CR1_FIFOEN ? FIFO_DEPTH : 1;
}

void usart_reset(void)
{
    in.count = out.count = 0;
    isr = USART_ISR_TC;
}

static uint8_t take(fifo *from)
{
    uint8_t byte = from->bytes[0];

    from->count--;
    memmove(from->bytes, from->bytes + 1, from->count);
    memmove(from->errors, from->errors + 1, from->count * sizeof from->errors[0]);
    return byte;
}

static uint8_t read_data(void)
{
    uint8_t byte = in.bytes[0];

    if (in.count == 0)
        return byte;
    byte = take(&in);
    /* The errors of a character show when it is the next to be read. */
    if (in.count > 0)
        isr |= in.errors[0];
    return byte;
}

int usart_has_byte(void)
{
    return (usart->CR3 & USART_CR3_DMAR) && in.count > 0;
}

uint8_t usart_take_byte(void)
{
    return read_data();
}

int usart_wants_byte(void)
{
    return (usart->CR3 & USART_CR3_DMAT) && out.count < chip_kept();
}

void usart_put_byte(uint8_t byte)
{
    /* A character that the program writes into a full transmitter is lost. */
    if (out.count < chip_kept())
        out.bytes[out.count++] = byte;
    isr &= ~USART_ISR_TC;
}

/* How many characters a threshold of the FIFO means: 1/8, 1/4, 1/2, 3/4, 7/8, all. */
static unsigned threshold(uint32_t configured)
{
    static const uint8_t eighths[8] = {1, 2, 4, 6, 7, 8, 8, 8};

    return FIFO_DEPTH * eighths[configured & 7] / 8;
}

static uint32_t flags(void)
{
    uint32_t cr1 = usart->CR1, cr3 = usart->CR3, all = isr;

    all |= (in.count > 0 ? USART_ISR_RXNE_RXFNE : 0) |
           (out.count < chip_kept() ? USART_ISR_TXE_TXFNF : 0) |
           (cr1 & USART_CR1_TE ? USART_ISR_TEACK : 0) | (cr1 & USART_CR1_RE ? USART_ISR_REACK : 0);
    if (!(cr1 & USART_CR1_FIFOEN))
        return all;
    return all | (out.count == 0 ? USART_ISR_TXFE : 0) |
           (in.count == FIFO_DEPTH ? USART_ISR_RXFF : 0) |
           (in.count >= threshold(cr3 >> USART_CR3_RXFTCFG_Pos) ? USART_ISR_RXFT : 0) |
           (FIFO_DEPTH - out.count >= threshold(cr3 >> USART_CR3_TXFTCFG_Pos) ? USART_ISR_TXFT : 0);
}

void usart_before(void)
{
    usart->ISR = flags();
    usart->RDR = in.bytes[0];
    usart->ICR = usart->RQR = 0;
}

void usart_after(uint32_t offset, int isWrite)
{
    switch (offset) {
    case offsetof(USART_TypeDef, RDR):
        if (!isWrite)
            (void)read_data();
        break;
    case offsetof(USART_TypeDef, TDR):
        if (isWrite)
            usart_put_byte((uint8_t)usart->TDR);
        break;
    case offsetof(USART_TypeDef, ICR): /* its bits have the places of the flags */
        isr &= ~(usart->ICR & (ERRORS | USART_ISR_IDLE | USART_ISR_TC));
        break;
    case offsetof(USART_TypeDef, RQR):
        if (usart->RQR & USART_RQR_RXFRQ)
            in.count = 0;
        if (usart->RQR & USART_RQR_TXFRQ)
            out.count = 0;
        break;
    case offsetof(USART_TypeDef, CR1):
        if (!(usart->CR1 & USART_CR1_UE))
            usart_reset();
        break;
    default: break;
    }
}

void chip_receive(uint8_t byte, unsigned errors)
{
    if ((usart->CR1 & (USART_CR1_UE | USART_CR1_RE)) != (USART_CR1_UE | USART_CR1_RE))
        return;
    /* After an overrun nothing is received until the program has cleared it. */
    if (in.count >= chip_kept() || (isr & USART_ISR_ORE)) {
        isr |= USART_ISR_ORE;
        return;
    }
    if (errors & OVERRUN)
        isr |= USART_ISR_ORE;
    in.bytes[in.count] = byte;
    in.errors[in.count] = (errors & FRAMING ? USART_ISR_FE : 0) |
                          (errors & NOISE ? USART_ISR_NE : 0) |
                          (errors & PARITY ? USART_ISR_PE : 0);
    if (in.count++ == 0)
        isr |= in.errors[0];
    if (m.rxDmaStops)
        dma_stop_reception();
    dma_serve();
}

void chip_idle(void)
{
    isr |= USART_ISR_IDLE;
}

int chip_next(void)
{
    int next;

    dma_serve();
    if (out.count == 0 || !(usart->CR1 & USART_CR1_TE))
        return -1;
    if (m.txDmaStops && !(usart->CR3 & USART_CR3_DMAT) && huart1.TxXferCount < 4)
        return -1;
    next = take(&out);
    dma_serve();
    return next;
}

void chip_sent(void)
{
    if (out.count == 0)
        isr |= USART_ISR_TC;
}

int usart_interrupts(void)
{
    uint32_t cr1 = usart->CR1, cr3 = usart->CR3, all = flags();

    return ((all & (USART_ISR_RXNE_RXFNE | USART_ISR_ORE)) && (cr1 & USART_CR1_RXNEIE_RXFNEIE)) ||
           ((all & USART_ISR_TXE_TXFNF) && (cr1 & USART_CR1_TXEIE_TXFNFIE)) ||
           ((all & USART_ISR_TC) && (cr1 & USART_CR1_TCIE)) ||
           ((all & USART_ISR_IDLE) && (cr1 & USART_CR1_IDLEIE)) ||
           ((all & USART_ISR_PE) && (cr1 & USART_CR1_PEIE)) ||
           ((all & USART_ISR_RXFT) && (cr3 & USART_CR3_RXFTIE)) ||
           ((all & USART_ISR_TXFT) && (cr3 & USART_CR3_TXFTIE)) ||
           ((all & (USART_ISR_FE | USART_ISR_NE | USART_ISR_ORE)) && (cr3 & USART_CR3_EIE));
}
