/* A chip with a HAL of the tests' own: what ST's HAL does, at the times of its callbacks. Where the
 * families differ, it does the worse: any error stops a DMA whose error interrupt is on, a single
 * byte's reception must be started again each time, and no idle event follows a full buffer. */
#include "machine.h"
#include "main.h"

#include <string.h>

SysTick_Type SysTick[1];
GPIO_TypeDef GPIOA[1];
uint32_t SystemCoreClock = 16000000;
UART_HandleTypeDef huart1;

static USART_TypeDef usart;
static DMA_Stream_TypeDef rxStream, txStream;
static DMA_HandleTypeDef rxDma, txDma;

static uint8_t *into; /* where reception puts bytes */
static uint16_t size, place;
static const uint8_t *from;
static uint16_t left;
static uint8_t isReceiver, isDead;
/* The interrupts that wait. */
static uint8_t full, half, idle, sent, failed;

void chip_start(uint8_t receivesByDma, uint8_t sendsByDma)
{
    memset(&huart1, 0, sizeof huart1);
    memset(&usart, 0, sizeof usart);
    memset(&rxStream, 0, sizeof rxStream);
    memset(&txStream, 0, sizeof txStream);
    memset(GPIOA, 0, sizeof GPIOA);
    full = half = idle = sent = failed = 0;
    isReceiver = 1;
    left = 0;
    from = NULL;
    rxDma =
        (DMA_HandleTypeDef){&rxStream, {DMA_PERIPH_TO_MEMORY, DMA_MINC_ENABLE, 0, DMA_CIRCULAR}};
    txDma = (DMA_HandleTypeDef){&txStream, {DMA_MEMORY_TO_PERIPH, DMA_MINC_ENABLE, 0, DMA_NORMAL}};
    huart1.hdmarx = receivesByDma ? &rxDma : NULL;
    huart1.hdmatx = sendsByDma ? &txDma : NULL;
    huart1.Init = (UART_InitTypeDef){115200, UART_WORDLENGTH_9B, UART_PARITY_EVEN, UART_MODE_TX_RX};
    SysTick->LOAD = 15999;
    chip_start_uart();
    chip_clock();
}

void chip_start_uart(void)
{
    huart1.Instance = &usart;
    huart1.gState = huart1.RxState = HAL_UART_STATE_READY;
}

unsigned chip_kept(void)
{
    return 1;
}

void chip_stop_uart(void)
{
    huart1.gState = huart1.RxState = HAL_UART_STATE_RESET;
    rxStream.CR = txStream.CR = 0;
    rxStream.NDTR = 0;
    from = NULL;
}

void chip_abort_reception(void)
{
    HAL_UART_AbortReceive(&huart1);
}

void chip_single_wire(void)
{
    usart.CR3 |= USART_CR3_HDSEL;
}

void chip_clock(void)
{
    SysTick->VAL = 15999u - (uint32_t)(m.now % 1000000u * 16u / 1000u);
}

uint32_t HAL_GetTick(void)
{
    return (uint32_t)(m.now / 1000000u);
}

int chip_is_driving(void)
{
    if (usart.CR3 & USART_CR3_HDSEL)
        return !isReceiver;
    return (GPIOA->ODR & GPIO_PIN_8) != 0;
}

void HAL_GPIO_WritePin(GPIO_TypeDef *port, uint16_t pin, GPIO_PinState state)
{
    if (m.hasNoPin)
        return;
    if (state == GPIO_PIN_SET)
        port->ODR |= pin;
    else
        port->ODR &= ~(uint32_t)pin;
}

/* --- transmission */

static HAL_StatusTypeDef transmit(const uint8_t *bytes, uint16_t n)
{
    if (huart1.gState != HAL_UART_STATE_READY)
        return HAL_BUSY;
    if (!bytes || n == 0)
        return HAL_ERROR;
    huart1.gState = HAL_UART_STATE_BUSY_TX;
    huart1.ErrorCode = 0;
    from = bytes;
    left = n;
    isDead = 0;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Transmit_DMA(UART_HandleTypeDef *uart, const uint8_t *bytes, uint16_t n)
{
    (void)uart;
    return transmit(bytes, n);
}

HAL_StatusTypeDef HAL_UART_Transmit_IT(UART_HandleTypeDef *uart, const uint8_t *bytes, uint16_t n)
{
    (void)uart;
    return transmit(bytes, n);
}

int chip_next(void)
{
    isDead |= m.txDmaStops && left < 4;
    if (!from || left == 0 || isDead)
        return -1;
    left--;
    return *from++;
}

void chip_sent(void)
{
    sent = from && left == 0;
}

HAL_StatusTypeDef HAL_UART_AbortTransmit(UART_HandleTypeDef *uart)
{
    (void)uart;
    from = NULL;
    left = 0;
    if (huart1.gState != HAL_UART_STATE_RESET)
        huart1.gState = HAL_UART_STATE_READY;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_HalfDuplex_EnableReceiver(UART_HandleTypeDef *uart)
{
    (void)uart;
    isReceiver = 1;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_HalfDuplex_EnableTransmitter(UART_HandleTypeDef *uart)
{
    (void)uart;
    isReceiver = 0;
    return HAL_OK;
}

/* --- reception */

static HAL_StatusTypeDef start(uint8_t *bytes, uint16_t n)
{
    if (huart1.RxState != HAL_UART_STATE_READY)
        return HAL_BUSY;
    huart1.RxState = HAL_UART_STATE_BUSY_RX;
    huart1.ErrorCode = 0;
    into = bytes;
    size = n;
    place = 0;
    usart.CR1 |= UART_IT_ERR | UART_IT_PE;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Receive_IT(UART_HandleTypeDef *uart, uint8_t *bytes, uint16_t n)
{
    (void)uart;
    return start(bytes, n);
}

HAL_StatusTypeDef HAL_UARTEx_ReceiveToIdle_DMA(UART_HandleTypeDef *uart, uint8_t *bytes, uint16_t n)
{
    HAL_StatusTypeDef status = start(bytes, n);

    (void)uart;
    if (status == HAL_OK) {
        rxStream.CR = 1;
        rxStream.NDTR = n;
    }
    return status;
}

HAL_StatusTypeDef HAL_UART_AbortReceive(UART_HandleTypeDef *uart)
{
    (void)uart;
    rxStream.CR = 0;
    if (huart1.RxState != HAL_UART_STATE_RESET)
        huart1.RxState = HAL_UART_STATE_READY;
    return HAL_OK;
}

static void note_errors(unsigned errors)
{
    static const struct {
        unsigned error, flag, code;
    } rows[] = {{FRAMING, UART_FLAG_FE, HAL_UART_ERROR_FE},
                {NOISE, UART_FLAG_NE, HAL_UART_ERROR_NE},
                {PARITY, UART_FLAG_PE, HAL_UART_ERROR_PE},
                {OVERRUN, UART_FLAG_ORE, HAL_UART_ERROR_ORE}};

    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (errors & rows[i].error) {
            usart.SR |= rows[i].flag;
            huart1.ErrorCode |= rows[i].code;
        }
}

void chip_receive(uint8_t byte, unsigned errors)
{
    uint8_t isDma = huart1.hdmarx != NULL;

    if (!isDma || !(errors & OVERRUN))
        usart.SR &= UART_FLAG_ORE;
    note_errors(errors);
    if (huart1.RxState != HAL_UART_STATE_BUSY_RX || (isDma && (rxStream.CR & 1) == 0)) {
        usart.SR |= UART_FLAG_ORE;
        return;
    }
    if (!isDma && full) {
        /* The interrupt has not taken the character before. */
        note_errors(OVERRUN);
        failed = 1;
        return;
    }
    if (m.rxDmaStops) {
        rxStream.CR = 0;
        return;
    }
    if (isDma && m.rxDmaFails) {
        /* The HAL ends both directions. */
        rxStream.CR = 0;
        huart1.RxState = HAL_UART_STATE_READY;
        (void)HAL_UART_AbortTransmit(&huart1);
        huart1.ErrorCode |= HAL_UART_ERROR_DMA;
        failed = 1;
        return;
    }
    /* The character that was lost is the one before. */
    into[place++] = byte;
    if (isDma)
        rxStream.NDTR = place == size ? size : size - place;
    half |= isDma && place == size / 2;
    if (place == size) {
        full = 1;
        place = 0;
    }
    if (errors && (usart.CR1 & UART_IT_ERR)) {
        failed = 1;
        if (isDma || (errors & OVERRUN)) {
            /* The HAL ends reception. */
            rxStream.CR = 0;
            if (isDma)
                huart1.RxState = HAL_UART_STATE_READY;
        }
    }
}

void chip_idle(void)
{
    idle = huart1.hdmarx && huart1.RxState == HAL_UART_STATE_BUSY_RX && place != 0;
}

void chip_interrupts(void)
{
    if (half) {
        half = 0;
        HAL_UARTEx_RxEventCallback(&huart1, size / 2);
    }
    if (full) {
        full = 0;
        if (huart1.hdmarx) {
            HAL_UARTEx_RxEventCallback(&huart1, size);
        } else {
            huart1.RxState = HAL_UART_STATE_READY;
            HAL_UART_RxCpltCallback(&huart1);
        }
    }
    if (failed) {
        failed = 0;
        HAL_UART_ErrorCallback(&huart1);
        huart1.ErrorCode = 0;
    }
    if (idle) {
        idle = 0;
        HAL_UARTEx_RxEventCallback(&huart1, place);
    }
    if (sent && huart1.gState == HAL_UART_STATE_BUSY_TX) {
        sent = 0;
        huart1.gState = HAL_UART_STATE_READY;
        HAL_UART_TxCpltCallback(&huart1);
    }
}
