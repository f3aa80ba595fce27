/* The part of a HAL for STM32 that ports/stm32 uses, played by chip_model.c: the names are those of
 * ST's HAL, the code is the tests' own. */
#ifndef MAIN_H
#define MAIN_H

#include <stddef.h>
#include <stdint.h>

typedef enum { HAL_OK, HAL_ERROR, HAL_BUSY, HAL_TIMEOUT } HAL_StatusTypeDef;
typedef enum { GPIO_PIN_RESET, GPIO_PIN_SET } GPIO_PinState;
typedef struct {
    volatile uint32_t ODR;
} GPIO_TypeDef;
typedef struct {
    volatile uint32_t LOAD, VAL;
} SysTick_Type;
typedef struct {
    volatile uint32_t SR, CR1, CR3;
} USART_TypeDef;
typedef struct {
    volatile uint32_t CR, NDTR;
} DMA_Stream_TypeDef;
typedef struct {
    uint32_t Direction, MemInc, MemDataAlignment, Mode;
} DMA_InitTypeDef;
typedef struct {
    DMA_Stream_TypeDef *Instance;
    DMA_InitTypeDef Init;
} DMA_HandleTypeDef;
typedef struct {
    uint32_t BaudRate, WordLength, Parity, Mode;
} UART_InitTypeDef;
typedef struct {
    USART_TypeDef *Instance;
    UART_InitTypeDef Init;
    DMA_HandleTypeDef *hdmatx, *hdmarx;
    volatile uint32_t gState, RxState, ErrorCode;
} UART_HandleTypeDef;

enum { HAL_UART_STATE_RESET, HAL_UART_STATE_READY, HAL_UART_STATE_BUSY_TX, HAL_UART_STATE_BUSY_RX };
enum {
    HAL_UART_ERROR_PE = 1,
    HAL_UART_ERROR_NE = 2,
    HAL_UART_ERROR_FE = 4,
    HAL_UART_ERROR_ORE = 8,
    HAL_UART_ERROR_DMA = 16
};
enum { UART_WORDLENGTH_8B, UART_WORDLENGTH_9B, UART_PARITY_NONE = 0, UART_PARITY_EVEN };
enum { UART_MODE_RX = 1, UART_MODE_TX, UART_MODE_TX_RX };
enum { UART_FLAG_PE = 1, UART_FLAG_FE = 2, UART_FLAG_NE = 4, UART_FLAG_ORE = 8 };
enum { UART_IT_ERR = 1, UART_IT_PE = 2 };
enum { DMA_PERIPH_TO_MEMORY, DMA_MEMORY_TO_PERIPH, DMA_MINC_ENABLE = 1, DMA_MDATAALIGN_BYTE = 0 };
enum { GPIO_PIN_8 = 0x100 };
#define DMA_NORMAL 0u
#define DMA_CIRCULAR 1u
#define USART_CR3_HDSEL 8u

extern SysTick_Type SysTick[1];
extern GPIO_TypeDef GPIOA[1];
extern uint32_t SystemCoreClock;

#define __HAL_DMA_GET_COUNTER(dma) ((dma)->Instance->NDTR)
#define __HAL_UART_GET_FLAG(uart, flag) (((uart)->Instance->SR & (flag)) != 0u)
#define __HAL_UART_CLEAR_PEFLAG(uart) ((uart)->Instance->SR = 0u)
#define __HAL_UART_CLEAR_OREFLAG(uart) ((uart)->Instance->SR = 0u)
#define __HAL_UART_DISABLE_IT(uart, which) ((uart)->Instance->CR1 &= ~(uint32_t)(which))

uint32_t HAL_GetTick(void);
void HAL_Delay(uint32_t ms);
void HAL_GPIO_WritePin(GPIO_TypeDef *port, uint16_t pin, GPIO_PinState state);
HAL_StatusTypeDef HAL_UART_Transmit_DMA(UART_HandleTypeDef *uart, const uint8_t *bytes, uint16_t n);
HAL_StatusTypeDef HAL_UART_Transmit_IT(UART_HandleTypeDef *uart, const uint8_t *bytes, uint16_t n);
HAL_StatusTypeDef HAL_UART_Receive_IT(UART_HandleTypeDef *uart, uint8_t *bytes, uint16_t n);
HAL_StatusTypeDef HAL_UARTEx_ReceiveToIdle_DMA(UART_HandleTypeDef *uart, uint8_t *bytes,
                                               uint16_t n);
HAL_StatusTypeDef HAL_UART_AbortReceive(UART_HandleTypeDef *uart);
HAL_StatusTypeDef HAL_UART_AbortTransmit(UART_HandleTypeDef *uart);
HAL_StatusTypeDef HAL_HalfDuplex_EnableReceiver(UART_HandleTypeDef *uart);
HAL_StatusTypeDef HAL_HalfDuplex_EnableTransmitter(UART_HandleTypeDef *uart);

void HAL_UART_TxCpltCallback(UART_HandleTypeDef *huart);
void HAL_UART_RxCpltCallback(UART_HandleTypeDef *huart);
void HAL_UARTEx_RxEventCallback(UART_HandleTypeDef *huart, uint16_t Size);
void HAL_UART_ErrorCallback(UART_HandleTypeDef *huart);

extern UART_HandleTypeDef huart1;

void Error_Handler(void);

/* Small buffers, so that tests are often at their ends. */
#define MBM_STM32_RECEIVE_BYTES 64

#endif
