/* What CubeMX makes around an example, for scripts/check/real: USART1 at 115200 baud with even
 * parity, a driver's pin and, unless WITHOUT_DMA is defined, a circular DMA for reception and a
 * normal one for transmission. Licence: MIT OR Apache-2.0. */
#include "main.h"
#include "app.h"

#include <stdio.h>

extern void initialise_monitor_handles(void);
void SysTick_Handler(void);
void USART1_IRQHandler(void);

UART_HandleTypeDef huart1;

void Error_Handler(void)
{
    printf("Error_Handler\n");
    for (;;)
        ;
}

#ifndef WITHOUT_DMA
DMA_HandleTypeDef hdma_usart1_rx, hdma_usart1_tx;

#if defined(STM32F103xB)
#define CLOCK __HAL_RCC_DMA1_CLK_ENABLE()
#define RX DMA1_Channel5
#define TX DMA1_Channel4
#define RX_HANDLER DMA1_Channel5_IRQHandler
#define TX_HANDLER DMA1_Channel4_IRQHandler
#define RX_INTERRUPT DMA1_Channel5_IRQn
#define TX_INTERRUPT DMA1_Channel4_IRQn
#elif defined(STM32F405xx)
#define CLOCK __HAL_RCC_DMA2_CLK_ENABLE()
#define RX DMA2_Stream2
#define TX DMA2_Stream7
#define RX_HANDLER DMA2_Stream2_IRQHandler
#define TX_HANDLER DMA2_Stream7_IRQHandler
#define RX_INTERRUPT DMA2_Stream2_IRQn
#define TX_INTERRUPT DMA2_Stream7_IRQn
#elif defined(STM32G071xx)
#define CLOCK __HAL_RCC_DMA1_CLK_ENABLE()
#define RX DMA1_Channel1
#define TX DMA1_Channel2
#define RX_HANDLER DMA1_Channel1_IRQHandler
#define TX_HANDLER DMA1_Channel2_3_IRQHandler
#define RX_INTERRUPT DMA1_Channel1_IRQn
#define TX_INTERRUPT DMA1_Channel2_3_IRQn
#else
#define CLOCK __HAL_RCC_DMA1_CLK_ENABLE()
#define RX DMA1_Stream0
#define TX DMA1_Stream1
#define RX_HANDLER DMA1_Stream0_IRQHandler
#define TX_HANDLER DMA1_Stream1_IRQHandler
#define RX_INTERRUPT DMA1_Stream0_IRQn
#define TX_INTERRUPT DMA1_Stream1_IRQn
#endif

void RX_HANDLER(void);
void TX_HANDLER(void);

void RX_HANDLER(void)
{
    HAL_DMA_IRQHandler(&hdma_usart1_rx);
}

void TX_HANDLER(void)
{
    HAL_DMA_IRQHandler(&hdma_usart1_tx);
}

static void start_dma(DMA_HandleTypeDef *dma, uint32_t direction, uint32_t mode)
{
    dma->Init.Direction = direction;
    dma->Init.PeriphInc = DMA_PINC_DISABLE;
    dma->Init.MemInc = DMA_MINC_ENABLE;
    dma->Init.PeriphDataAlignment = DMA_PDATAALIGN_BYTE;
    dma->Init.MemDataAlignment = DMA_MDATAALIGN_BYTE;
    dma->Init.Mode = mode;
    dma->Init.Priority = DMA_PRIORITY_LOW;
    if (HAL_DMA_Init(dma) != HAL_OK)
        Error_Handler();
}

static void link_dma(UART_HandleTypeDef *huart)
{
    hdma_usart1_rx.Instance = RX;
    hdma_usart1_tx.Instance = TX;
#if defined(STM32F405xx)
    hdma_usart1_rx.Init.Channel = hdma_usart1_tx.Init.Channel = DMA_CHANNEL_4;
#elif !defined(STM32F103xB)
    hdma_usart1_rx.Init.Request = DMA_REQUEST_USART1_RX;
    hdma_usart1_tx.Init.Request = DMA_REQUEST_USART1_TX;
#endif
    start_dma(&hdma_usart1_rx, DMA_PERIPH_TO_MEMORY, DMA_CIRCULAR);
    start_dma(&hdma_usart1_tx, DMA_MEMORY_TO_PERIPH, DMA_NORMAL);
    __HAL_LINKDMA(huart, hdmarx, hdma_usart1_rx);
    __HAL_LINKDMA(huart, hdmatx, hdma_usart1_tx);
    HAL_NVIC_EnableIRQ(RX_INTERRUPT);
    HAL_NVIC_EnableIRQ(TX_INTERRUPT);
}
#endif

void HAL_UART_MspInit(UART_HandleTypeDef *huart)
{
    GPIO_InitTypeDef pins = {.Pin = GPIO_PIN_9 | GPIO_PIN_10, .Mode = GPIO_MODE_AF_PP};

    __HAL_RCC_USART1_CLK_ENABLE();
    __HAL_RCC_GPIOA_CLK_ENABLE();
#if defined(STM32G071xx)
    pins.Alternate = GPIO_AF1_USART1;
#elif !defined(STM32F103xB)
    pins.Alternate = GPIO_AF7_USART1;
#endif
    HAL_GPIO_Init(GPIOA, &pins);
#ifndef WITHOUT_DMA
    pins.Pin = DRIVER_Pin;
    pins.Mode = GPIO_MODE_OUTPUT_PP;
    HAL_GPIO_Init(DRIVER_GPIO_Port, &pins);
    link_dma(huart);
#else
    (void)huart;
#endif
    HAL_NVIC_EnableIRQ(USART1_IRQn);
}

#ifdef MEASURE
/* -DMEASURE is for the figures of docs/guide-stm32.md. With -icount QEMU takes a fixed time for an
 * instruction. The handler of the transmitter, which is SysTick's here, is not counted. The stack
 * was painted before. */
static uint32_t spent, calls;
extern uint32_t _ebss, _estack;

static void report(void)
{
    const uint32_t *place = &_ebss + 1024;

    while (*place == 0x5AFE5AFEu)
        place++;
    printf("%lu calls, %lu ticks; stack %lu bytes\n", (unsigned long)calls, (unsigned long)spent,
           (unsigned long)((const char *)&_estack - (const char *)place));
}

static void paint(void)
{
    uint32_t *place = &_ebss + 1024;

    while ((char *)place < (char *)__builtin_frame_address(0) - 64)
        *(volatile uint32_t *)place++ = 0x5AFE5AFEu;
}
#endif

void USART1_IRQHandler(void)
{
#ifdef MEASURE
    uint32_t before = SysTick->VAL, after;

    HAL_UART_IRQHandler(&huart1);
    after = SysTick->VAL;
    spent += before >= after ? before - after : before + SysTick->LOAD + 1u - after;
    calls++;
#else
    HAL_UART_IRQHandler(&huart1);
#endif
}

/* The newer families have a FIFO, and another name for this bit. */
#ifndef USART_CR1_TXEIE
#define USART_CR1_TXEIE USART_CR1_TXEIE_TXFNFIE
#endif

void SysTick_Handler(void)
{
    HAL_IncTick();
#ifdef WITHOUT_DMA
    /* QEMU's USART sends at once, and calls no interrupt for it. */
    while ((huart1.Instance->CR1 & (USART_CR1_TXEIE | USART_CR1_TCIE)) != 0u)
        HAL_UART_IRQHandler(&huart1);
#endif
}

int main(void)
{
    initialise_monitor_handles();
#ifdef WITHOUT_DMA
    /* That of QEMU's netduinoplus2. */
    SystemCoreClock = 168000000u;
#endif
    HAL_Init();
#ifndef WITHOUT_DMA
    CLOCK;
#endif
    huart1.Instance = USART1;
    huart1.Init.BaudRate = 115200;
    huart1.Init.WordLength = UART_WORDLENGTH_9B;
    huart1.Init.StopBits = UART_STOPBITS_1;
    huart1.Init.Parity = UART_PARITY_EVEN;
    huart1.Init.Mode = UART_MODE_TX_RX;
    huart1.Init.HwFlowCtl = UART_HWCONTROL_NONE;
    huart1.Init.OverSampling = UART_OVERSAMPLING_16;
    if (HAL_UART_Init(&huart1) != HAL_OK)
        Error_Handler();
#ifdef MEASURE
    paint();
    app_setup();
    for (unsigned round = 0; round < 5; round++)
        app_loop();
    report();
#else
    app_setup();
#endif
    for (;;)
        app_loop();
}
