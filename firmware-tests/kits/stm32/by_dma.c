/* The interrupts of a frame of 256 bytes that the line receives by DMA, and of one that it sends,
 * for scripts/bench/kits. QEMU has no DMA of an STM32: here USART, DMA and GPIO are memory, the
 * program sets the flags that the chip would set, and makes the interrupts wait at the NVIC. The
 * HAL, the port and the processor's exceptions are real. For an F4. Licence: MIT OR Apache-2.0. */
#include "app.h"
#include "mbm_stm32.h"

#include <string.h>

enum { HALF_OF_2 = 1 << 20, FULL_OF_2 = 1 << 21, FULL_OF_7 = 1 << 27 };

extern DMA_HandleTypeDef hdma_usart1_rx, hdma_usart1_tx;

/* The HAL finds the flags from the address of a stream. */
static struct {
    DMA_TypeDef flags;
    DMA_Stream_TypeDef streams[8];
} dma __attribute__((aligned(1024)));
static USART_TypeDef usart;
static GPIO_TypeDef gpio = {.ODR = GPIO_PIN_8};
static mbm_stm32Line uart = {.driverPort = &gpio, .driverPin = GPIO_PIN_8};
static mbm_port port;
static uint8_t frame[MBM_MAX_FRAME];

void app_setup(void)
{
    huart1.Instance = &usart;
    hdma_usart1_rx.Instance = &dma.streams[2];
    hdma_usart1_tx.Instance = &dma.streams[7];
    if (HAL_DMA_Init(&hdma_usart1_rx) != HAL_OK || HAL_DMA_Init(&hdma_usart1_tx) != HAL_OK ||
        HAL_UART_Init(&huart1) != HAL_OK || mbm_stm32_open(&uart, &huart1, &port) != MBM_STM32_OK)
        Error_Handler();
}

/* The interrupt comes at once. What it has cleared stays set in memory. */
static void interrupt(IRQn_Type number)
{
    NVIC_SetPendingIRQ(number);
    __DSB();
    __ISB();
    dma.flags.LISR = dma.flags.HISR = usart.SR = 0;
}

static void receive(uint32_t left, uint32_t flag)
{
    dma.streams[2].NDTR = left;
    dma.flags.LISR = flag;
    interrupt(DMA2_Stream2_IRQn);
    usart.SR = USART_SR_IDLE;
    interrupt(USART1_IRQn);
    if (port.read(port.context, frame, sizeof frame) != sizeof frame)
        Error_Handler();
}

static void send(void)
{
    if (port.write(port.context, frame, sizeof frame) != sizeof frame)
        Error_Handler();
    dma.flags.HISR = FULL_OF_7;
    interrupt(DMA2_Stream7_IRQn);
    usart.SR = USART_SR_TC;
    interrupt(USART1_IRQn);
    if (port.flush(port.context) != 1)
        Error_Handler();
}

void app_loop(void)
{
    receive(MBM_STM32_RECEIVE_BYTES / 2, HALF_OF_2);
    send();
    receive(MBM_STM32_RECEIVE_BYTES, FULL_OF_2);
    send();
}
