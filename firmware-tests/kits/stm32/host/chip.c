/* A chip of the families F1, F4, G0 and H7, with ST's HAL over it. See chip.h. */
#include "chip.h"
#include "registers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PAGE_OF(address) ((uint32_t)(address) / 4096u * 4096u)

UART_HandleTypeDef huart1;
uint32_t SystemCoreClock = 16000000;

DMA_HandleTypeDef rxDma, txDma;
USART_TypeDef *usart;
static uint8_t usesRxDma, usesTxDma;

static uint8_t *usartPage, *dmaPage;
static GPIO_TypeDef *gpio;
static SysTick_Type *tick;

/* --- what the HAL asks of its other files */

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

uint32_t HAL_RCC_GetSysClockFreq(void)
{
    return SystemCoreClock;
}

#if defined(STM32H743xx)
uint32_t HAL_RCCEx_GetD3PCLK1Freq(void)
{
    return SystemCoreClock;
}

void HAL_RCCEx_GetPLL2ClockFreq(PLL2_ClocksTypeDef *clocks)
{
    clocks->PLL2_Q_Frequency = SystemCoreClock;
}

void HAL_RCCEx_GetPLL3ClockFreq(PLL3_ClocksTypeDef *clocks)
{
    clocks->PLL3_Q_Frequency = SystemCoreClock;
}
#endif

void HAL_UART_MspInit(UART_HandleTypeDef *huart)
{
    rxDma.Init.Direction = DMA_PERIPH_TO_MEMORY;
    rxDma.Init.Mode = DMA_CIRCULAR;
    txDma.Init.Direction = DMA_MEMORY_TO_PERIPH;
    txDma.Init.Mode = DMA_NORMAL;
    rxDma.Init.MemInc = txDma.Init.MemInc = DMA_MINC_ENABLE;
#if defined(DMA_REQUEST_USART1_RX)
    rxDma.Init.Request = DMA_REQUEST_USART1_RX;
    txDma.Init.Request = DMA_REQUEST_USART1_TX;
#endif
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

/* --- what the tests ask of a chip */

static void map(void)
{
    usartPage = registers_map(PAGE_OF(USART1_BASE));
    usart = (USART_TypeDef *)(usartPage + USART1_BASE % 4096);
    dmaPage = registers_map(PAGE_OF(DMA1_BASE));
    gpio = (GPIO_TypeDef *)(registers_map(PAGE_OF(GPIOA_BASE)) + GPIOA_BASE % 4096);
    registers_plain(PAGE_OF(RCC_BASE));
#if defined(STM32H743xx)
    registers_plain(PAGE_OF(DBGMCU_BASE));
#endif
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
    tick = (SysTick_Type *)(registers_map(SCS_BASE) + SysTick_BASE % 4096);
#else
    registers_plain(SCS_BASE);
    tick = SysTick;
#endif
}

void chip_start(uint8_t receivesByDma, uint8_t sendsByDma)
{
    if (!usart)
        map();
    registers_catch();
    memset(usartPage, 0, 4096);
    memset(dmaPage, 0, 4096);
    memset(gpio, 0, sizeof *gpio);
    memset(&huart1, 0, sizeof huart1);
    memset(&rxDma, 0, sizeof rxDma);
    memset(&txDma, 0, sizeof txDma);
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
    cache_start((uint8_t *)tick - SysTick_BASE % 4096);
#endif
    usart_reset();
    dma_reset();
    dma_wire(dmaPage);
    usesRxDma = receivesByDma;
    usesTxDma = sendsByDma;
    huart1.Instance = USART1;
    huart1.Init.BaudRate = 115200;
    huart1.Init.WordLength = UART_WORDLENGTH_9B;
    huart1.Init.Parity = UART_PARITY_EVEN;
    huart1.Init.Mode = UART_MODE_TX_RX;
    chip_start_uart();
    tick->LOAD = 15999;
    chip_clock();
}

/* As CubeMX's project does when FIFO mode is on. */
static void set_fifo(void)
{
#ifdef WITH_FIFO
    if (HAL_UARTEx_SetTxFifoThreshold(&huart1, UART_TXFIFO_THRESHOLD_1_8) != HAL_OK ||
        HAL_UARTEx_SetRxFifoThreshold(&huart1, WITH_FIFO) != HAL_OK ||
        HAL_UARTEx_EnableFifoMode(&huart1) != HAL_OK)
        abort();
#endif
}

void chip_start_uart(void)
{
    if (HAL_UART_Init(&huart1) != HAL_OK)
        abort();
    set_fifo();
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
    set_fifo();
}

void chip_clock(void)
{
    tick->VAL = 15999u - (uint32_t)(m.now % 1000000u * 16u / 1000u);
}

int chip_is_driving(void)
{
    if (usart->CR3 & USART_CR3_HDSEL)
        return (usart->CR1 & (USART_CR1_TE | USART_CR1_RE)) == USART_CR1_TE;
    return (gpio->ODR & GPIO_PIN_8) != 0;
}

/* --- each access of the HAL */

void chip_before(uint32_t address)
{
    if (PAGE_OF(address) == PAGE_OF(USART1_BASE))
        usart_before();
    if (PAGE_OF(address) == PAGE_OF(DMA1_BASE))
        dma_before();
}

static void set_pins(uint32_t address)
{
    if (address == (uint32_t)(uintptr_t)&GPIOA->BSRR)
        gpio->ODR = (gpio->ODR | (gpio->BSRR & 0xFFFF)) & ~(gpio->BSRR >> 16);
#if defined(STM32G071xx)
    if (address == (uint32_t)(uintptr_t)&GPIOA->BRR)
        gpio->ODR &= ~gpio->BRR;
#endif
}

void chip_after(uint32_t address, int isWrite)
{
    if (PAGE_OF(address) == PAGE_OF(USART1_BASE)) {
        usart_after(address - USART1_BASE, isWrite);
        dma_serve();
    } else if (PAGE_OF(address) == PAGE_OF(DMA1_BASE)) {
        if (isWrite)
            dma_after();
    } else if (PAGE_OF(address) == PAGE_OF(GPIOA_BASE)) {
        if (isWrite && !m.hasNoPin)
            set_pins(address);
    }
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
    else if (PAGE_OF(address) == SCS_BASE)
        cache_after(address - SCS_BASE, isWrite);
#endif
}

/* --- interrupts */

/* On a G0 both channels have one interrupt, whose handler asks both. */
static int dma_interrupts(void)
{
    unsigned waiting = dma_waits();

#if defined(STM32G071xx)
    if (waiting) {
        HAL_DMA_IRQHandler(&rxDma);
        HAL_DMA_IRQHandler(&txDma);
    }
#else
    if (waiting & RX_WAITS)
        HAL_DMA_IRQHandler(&rxDma);
    else if (waiting & TX_WAITS)
        HAL_DMA_IRQHandler(&txDma);
#endif
    return waiting != 0;
}

void chip_interrupts(void)
{
    for (unsigned calls = 0; calls < 1000; calls++) {
        if (dma_interrupts())
            continue;
        if (!usart_interrupts())
            return;
        HAL_UART_IRQHandler(&huart1);
    }
    fprintf(stderr, "an interrupt is called again and again: CR1 %x CR3 %x\n", usart->CR1,
            usart->CR3);
    abort();
}
