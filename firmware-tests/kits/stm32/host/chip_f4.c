/* An STM32F405 of which USART1, its two streams of DMA2, and GPIOA are played, as its reference
 * manual (RM0090) describes their registers. The HAL over it is ST's. */
#include "machine.h"
#include "registers.h"

#include "stm32f4xx_hal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { USART_PAGE = 0x40011000, DMA_PAGE = 0x40026000, GPIO_PAGE = 0x40020000 };
enum { ERRORS = USART_SR_PE | USART_SR_FE | USART_SR_NE | USART_SR_ORE };

UART_HandleTypeDef huart1;
uint32_t SystemCoreClock = 16000000;
const uint8_t AHBPrescTable[16], APBPrescTable[8];

static DMA_HandleTypeDef rxDma, txDma;
static uint8_t usesRxDma, usesTxDma;

/* The registers as the chip sees them. */
static USART_TypeDef *usart;
static GPIO_TypeDef *gpio;
static DMA_TypeDef *dma;
static DMA_Stream_TypeDef *rx, *tx;

static uint32_t sr, seen; /* the flags; those that a read of SR has shown */
static uint8_t rdr, tdr;
static uint32_t rxEnabled, txEnabled, rxReload, rxPlace, txPlace;

uint32_t HAL_GetTick(void)
{
    return (uint32_t)(m.now / 1000000u);
}

uint32_t HAL_RCC_GetPCLK1Freq(void)
{
    return SystemCoreClock;
}

uint32_t HAL_RCC_GetPCLK2Freq(void)
{
    return SystemCoreClock;
}

void HAL_UART_MspInit(UART_HandleTypeDef *huart)
{
    rxDma.Instance = DMA2_Stream2;
    rxDma.Init.Direction = DMA_PERIPH_TO_MEMORY;
    rxDma.Init.Mode = DMA_CIRCULAR;
    txDma.Instance = DMA2_Stream7;
    txDma.Init.Direction = DMA_MEMORY_TO_PERIPH;
    txDma.Init.Mode = DMA_NORMAL;
    rxDma.Init.Channel = txDma.Init.Channel = DMA_CHANNEL_4;
    rxDma.Init.MemInc = txDma.Init.MemInc = DMA_MINC_ENABLE;
    if (usesRxDma && HAL_DMA_Init(&rxDma) == HAL_OK)
        __HAL_LINKDMA(huart, hdmarx, rxDma);
    if (usesTxDma && HAL_DMA_Init(&txDma) == HAL_OK)
        __HAL_LINKDMA(huart, hdmatx, txDma);
}

void HAL_UART_MspDeInit(UART_HandleTypeDef *huart)
{
    if (huart->hdmarx)
        HAL_DMA_DeInit(huart->hdmarx);
    if (huart->hdmatx)
        HAL_DMA_DeInit(huart->hdmatx);
}

void chip_start(uint8_t receivesByDma, uint8_t sendsByDma)
{
    if (!usart) {
        usart = (USART_TypeDef *)registers_map(USART_PAGE);
        gpio = (GPIO_TypeDef *)registers_map(GPIO_PAGE);
        dma = (DMA_TypeDef *)(registers_map(DMA_PAGE) + (DMA2_BASE & 0xFFF));
        rx = (DMA_Stream_TypeDef *)((uint8_t *)dma + 0x10 + 2 * 0x18);
        tx = (DMA_Stream_TypeDef *)((uint8_t *)dma + 0x10 + 7 * 0x18);
        registers_plain(SCS_BASE);
        registers_plain(RCC_BASE / 4096 * 4096);
    }
    registers_catch();
    memset(usart, 0, 4096);
    memset(gpio, 0, 4096);
    memset(dma, 0, 0xD0);
    memset(&huart1, 0, sizeof huart1);
    memset(&rxDma, 0, sizeof rxDma);
    memset(&txDma, 0, sizeof txDma);
    sr = USART_SR_TXE | USART_SR_TC;
    seen = rxEnabled = txEnabled = 0;
    usesRxDma = receivesByDma;
    usesTxDma = sendsByDma;
    huart1.Instance = USART1;
    huart1.Init.BaudRate = 115200;
    huart1.Init.WordLength = UART_WORDLENGTH_9B;
    huart1.Init.Parity = UART_PARITY_EVEN;
    huart1.Init.Mode = UART_MODE_TX_RX;
    chip_start_uart();
    SysTick->LOAD = 15999;
    chip_clock();
}

void chip_start_uart(void)
{
    if (HAL_UART_Init(&huart1) != HAL_OK)
        abort();
}

void chip_stop_uart(void)
{
    HAL_UART_DeInit(&huart1);
}

void chip_abort_reception(void)
{
    HAL_UART_AbortReceive(&huart1);
}

void chip_single_wire(void)
{
    if (HAL_HalfDuplex_Init(&huart1) != HAL_OK)
        abort();
}

void chip_clock(void)
{
    SysTick->VAL = 15999u - (uint32_t)(m.now % 1000000u * 16u / 1000u);
}

int chip_is_driving(void)
{
    if (usart->CR3 & USART_CR3_HDSEL)
        return (usart->CR1 & (USART_CR1_TE | USART_CR1_RE)) == USART_CR1_TE;
    return (gpio->ODR & GPIO_PIN_8) != 0;
}

/* --- the DMA */

/* A stream has moved a byte. Returns the flags that this sets: half and all. */
static uint32_t counted(DMA_Stream_TypeDef *stream, uint32_t reload, uint32_t half, uint32_t all)
{
    stream->NDTR--;
    if (stream->NDTR == reload / 2)
        return half;
    return stream->NDTR == 0 ? all : 0;
}

static void read_data(void)
{
    sr &= ~(USART_SR_RXNE | seen);
    seen = 0;
}

static void serve_reception(void)
{
    uint8_t *memory;

    if (!(usart->CR3 & USART_CR3_DMAR) || !(sr & USART_SR_RXNE) || !(rx->CR & DMA_SxCR_EN))
        return;
    memory = (uint8_t *)(uintptr_t)rx->M0AR;
    memory[rxPlace++] = rdr;
    read_data();
    dma->LISR |= counted(rx, rxReload, DMA_LISR_HTIF2, DMA_LISR_TCIF2);
    if (rx->NDTR == 0) {
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
    if (!(usart->CR3 & USART_CR3_DMAT) || !(sr & USART_SR_TXE) || !(tx->CR & DMA_SxCR_EN))
        return;
    if (m.txDmaStops && tx->NDTR < 4)
        return;
    tdr = ((const uint8_t *)(uintptr_t)tx->M0AR)[txPlace++];
    sr &= ~(USART_SR_TXE | USART_SR_TC);
    dma->HISR |= counted(tx, 0xFFFF, DMA_HISR_HTIF7, DMA_HISR_TCIF7);
    if (tx->NDTR == 0)
        tx->CR &= ~DMA_SxCR_EN;
    txEnabled = tx->CR & DMA_SxCR_EN;
}

static void enabled(void)
{
    if ((rx->CR & DMA_SxCR_EN) && !rxEnabled) {
        rxReload = rx->NDTR;
        rxPlace = 0;
    }
    if ((tx->CR & DMA_SxCR_EN) && !txEnabled)
        txPlace = 0;
    /* A stream that is switched off says that it has ended. */
    if (!(rx->CR & DMA_SxCR_EN) && rxEnabled)
        dma->LISR |= DMA_LISR_TCIF2;
    if (!(tx->CR & DMA_SxCR_EN) && txEnabled)
        dma->HISR |= DMA_HISR_TCIF7;
    rxEnabled = rx->CR & DMA_SxCR_EN;
    txEnabled = tx->CR & DMA_SxCR_EN;
    serve_reception();
    serve_transmission();
}

/* --- each access of the HAL */

void chip_before(uint32_t address)
{
    if (address == USART1_BASE)
        usart->SR = sr;
    if (address == USART1_BASE + 4)
        usart->DR = rdr;
    if (address == DMA2_BASE + 8 || address == DMA2_BASE + 12)
        dma->LIFCR = dma->HIFCR = 0;
}

static void after_usart(uint32_t address, int isWrite)
{
    switch (address - USART1_BASE) {
    case 0:
        if (isWrite)
            sr &= usart->SR | ~(uint32_t)(USART_SR_TC | USART_SR_RXNE);
        else
            seen = sr & (ERRORS | USART_SR_IDLE);
        break;
    case 4:
        if (!isWrite) {
            read_data();
        } else {
            tdr = (uint8_t)usart->DR;
            sr &= ~(USART_SR_TXE | USART_SR_TC);
        }
        break;
    default: serve_reception();
    }
}

void chip_after(uint32_t address, int isWrite)
{
    if (address / 4096 == USART_PAGE / 4096)
        after_usart(address, isWrite);
    if (!isWrite)
        return;
    if (address == GPIOA_BASE + 0x18) {
        if (!m.hasNoPin)
            gpio->ODR = (gpio->ODR | (gpio->BSRR & 0xFFFF)) & ~(gpio->BSRR >> 16);
    } else if (address / 4096 == DMA_PAGE / 4096) {
        dma->LISR &= ~dma->LIFCR;
        dma->HISR &= ~dma->HIFCR;
        enabled();
    }
}

/* --- the wire */

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
        rxEnabled = rx->CR &= ~DMA_SxCR_EN;
    serve_reception();
}

void chip_idle(void)
{
    sr |= USART_SR_IDLE;
}

int chip_next(void)
{
    int next;

    serve_transmission();
    if (sr & USART_SR_TXE)
        return -1;
    if (m.txDmaStops && !(usart->CR3 & USART_CR3_DMAT) && huart1.TxXferCount < 4)
        return -1;
    next = tdr;
    sr |= USART_SR_TXE;
    serve_transmission();
    return next;
}

void chip_sent(void)
{
    if (sr & USART_SR_TXE)
        sr |= USART_SR_TC;
}

/* --- interrupts */

static int usart_interrupts(void)
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

static int stream_interrupts(const DMA_Stream_TypeDef *stream, uint32_t flags)
{
    return ((flags & 0x20) && (stream->CR & DMA_SxCR_TCIE)) ||
           ((flags & 0x10) && (stream->CR & DMA_SxCR_HTIE));
}

void chip_interrupts(void)
{
    for (unsigned calls = 0; calls < 1000; calls++) {
        if (stream_interrupts(rx, dma->LISR >> 16))
            HAL_DMA_IRQHandler(&rxDma);
        else if (stream_interrupts(tx, dma->HISR >> 22))
            HAL_DMA_IRQHandler(&txDma);
        else if (usart_interrupts())
            HAL_UART_IRQHandler(&huart1);
        else
            return;
    }
    fprintf(stderr, "an interrupt is called again and again: SR %x CR1 %x\n", sr, usart->CR1);
    abort();
}
