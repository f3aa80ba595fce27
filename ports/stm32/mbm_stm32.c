/* See mbm_stm32.h. Licence: MIT OR Apache-2.0. */
#include "mbm_stm32.h"

#include <string.h>

/* The most bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 12 };

/* Milliseconds that a transmission may take longer than its characters, twice. */
enum { PATIENCE = 50 };

static mbm_stm32Line *lines;

static mbm_stm32Line *line_of(const UART_HandleTypeDef *uart)
{
    mbm_stm32Line *line = lines;

    while (line != NULL && line->uart != uart)
        line = line->next;
    return line;
}

static void wake(const mbm_stm32Line *line)
{
    if (line->wake != NULL)
        line->wake(line->context);
}

/* --- the driver of the transceiver, or of the single wire */

static uint8_t is_single_wire(const UART_HandleTypeDef *uart)
{
    return (uart->Instance->CR3 & USART_CR3_HDSEL) != 0u;
}

static void driver_on(void *context)
{
    mbm_stm32Line *line = context;

    if (line->uart == NULL)
        return;
    if (is_single_wire(line->uart) && HAL_HalfDuplex_EnableTransmitter(line->uart) != HAL_OK)
        line->hasFailed = 1;
    if (line->driverPort == NULL)
        return;
    HAL_GPIO_WritePin(line->driverPort, line->driverPin, GPIO_PIN_SET);
    /* A port without its clock, and a pin that the chip does not have, keep nothing. */
    if ((line->driverPort->ODR & line->driverPin) == 0u)
        line->hasFailed = 1;
}

static void driver_off(void *context)
{
    mbm_stm32Line *line = context;

    if (line->uart == NULL)
        return;
    if (line->driverPort != NULL)
        HAL_GPIO_WritePin(line->driverPort, line->driverPin, GPIO_PIN_RESET);
    /* The HAL refuses while the program is in another function for this UART. flush tries again. */
    if (is_single_wire(line->uart))
        line->isDeaf = HAL_HalfDuplex_EnableReceiver(line->uart) != HAL_OK;
}

/* --- memory that DMA and processor share */

static void before_sending(mbm_stm32Line *line, uint16_t length)
{
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
    if ((SCB->CCR & SCB_CCR_DC_Msk) != 0u)
        SCB_CleanDCache_by_Addr((void *)line->toSend, length);
#else
    (void)line;
    (void)length;
#endif
}

/* Called before the DMA begins too: what the program has written to the buffer, such as zeros,
 * would else reach the memory later, over what the DMA has put there. */
static void before_reading(mbm_stm32Line *line)
{
#if defined(__DCACHE_PRESENT) && __DCACHE_PRESENT
    if ((SCB->CCR & SCB_CCR_DC_Msk) != 0u)
        SCB_InvalidateDCache_by_Addr((void *)line->received, (int32_t)sizeof line->received);
#else
    (void)line;
#endif
}

static uint8_t dma_reaches(const void *memory)
{
#if defined(D1_DTCMRAM_BASE)
    return (uintptr_t)memory - D1_DTCMRAM_BASE >= 0x20000u;
#elif defined(CD_DTCMRAM_BASE)
    return (uintptr_t)memory - CD_DTCMRAM_BASE >= 0x20000u;
#elif defined(CCMDATARAM_BASE)
    return (uintptr_t)memory - CCMDATARAM_BASE >= 0x10000u;
#else
    (void)memory;
    return 1;
#endif
}

/* --- reception */

/* The DMA of chips without DMA_CIRCULAR, such as STM32U5, is of another kind: there reception is by
 * interrupt. */
static uint8_t receives_by_dma(const UART_HandleTypeDef *uart)
{
#if MBM_STM32_BY_DMA && defined(DMA_CIRCULAR)
    return uart->hdmarx != NULL;
#else
    (void)uart;
    return 0;
#endif
}

/* A DMA that was reset has the counter 0. Its ring then stays where it is: no byte is added. */
static uint16_t remaining(void *context)
{
    const mbm_stm32Line *line = context;
    uint32_t left = __HAL_DMA_GET_COUNTER(line->uart->hdmarx);

    return left == 0u && line->uart->RxState != HAL_UART_STATE_BUSY_RX ? UINT16_MAX
                                                                       : (uint16_t)left;
}

static uint8_t is_receiving(const mbm_stm32Line *line)
{
    const UART_HandleTypeDef *uart = line->uart;

    if (uart->RxState != HAL_UART_STATE_BUSY_RX)
        return 0;
    /* The enable bit is bit 0 of the first register in all these DMAs, CR or CCR. */
    return !receives_by_dma(uart) ||
           (*(const volatile uint32_t *)uart->hdmarx->Instance & 1u) != 0u;
}

static void count_overrun(mbm_stm32Line *line)
{
    line->overruns++;
    /* An overrun that stays set ends reception, or calls the interrupt again and again. */
    __HAL_UART_CLEAR_OREFLAG(line->uart);
}

/* Counts an overrun. Returns 1 if a framing, noise or parity error is set. */
static uint8_t note_flags(mbm_stm32Line *line)
{
    const UART_HandleTypeDef *uart = line->uart;

    if (__HAL_UART_GET_FLAG(uart, UART_FLAG_ORE))
        count_overrun(line);
    if (__HAL_UART_GET_FLAG(uart, UART_FLAG_FE) || __HAL_UART_GET_FLAG(uart, UART_FLAG_NE) ||
        __HAL_UART_GET_FLAG(uart, UART_FLAG_PE))
        return 1;
    return 0;
}

/* An error that is still set would end reception at once. */
static void clear_errors(mbm_stm32Line *line)
{
#ifdef UART_CLEAR_FEF
    if (__HAL_UART_GET_FLAG(line->uart, UART_FLAG_ORE))
        count_overrun(line);
    __HAL_UART_CLEAR_FLAG(line->uart, UART_CLEAR_FEF | UART_CLEAR_NEF | UART_CLEAR_PEF);
#else
    if (note_flags(line))
        __HAL_UART_CLEAR_PEFLAG(line->uart);
#endif
}

static HAL_StatusTypeDef receive(mbm_stm32Line *line)
{
    UART_HandleTypeDef *uart = line->uart;
    HAL_StatusTypeDef status;

    clear_errors(line);
    if (!receives_by_dma(uart))
        return HAL_UART_Receive_IT(uart, &line->byte, 1);
    line->lost = mbm_stm32_lost(line);
    before_reading(line);
    mbm_dmaRing_begin(&line->ring.ofDma, line->received, sizeof line->received, remaining, line);
    status = HAL_UARTEx_ReceiveToIdle_DMA(uart, line->received, sizeof line->received);
    /* In its interrupt for errors the HAL would stop the DMA at each disturbed character. The CRC
     * finds those; read counts them. */
    __HAL_UART_DISABLE_IT(uart, UART_IT_ERR);
    __HAL_UART_DISABLE_IT(uart, UART_IT_PE);
#ifdef UART_IT_RTO
    __HAL_UART_DISABLE_IT(uart, UART_IT_RTO);
#endif
    return status == HAL_OK && !is_receiving(line) ? HAL_ERROR : status;
}

/* Starts reception that has stopped. The DMA begins at the front of its buffer, so all that had
 * arrived must be taken. */
static int16_t receive_again(mbm_stm32Line *line)
{
    HAL_StatusTypeDef status;

    if (line->uart->RxState == HAL_UART_STATE_BUSY_RX)
        (void)HAL_UART_AbortReceive(line->uart);
    status = receive(line);
    if (status == HAL_OK)
        line->restarts++;
    return status == HAL_ERROR ? -1 : 0;
}

/* Counts the errors since the last call, where no interrupt does. */
static void count_flags(mbm_stm32Line *line)
{
    const uint16_t flags = note_flags(line);

    if (flags > line->flags)
        line->faulty++;
    line->flags = flags;
#ifdef UART_CLEAR_FEF
    /* Elsewhere the DMA clears them when it reads the next character. */
    __HAL_UART_CLEAR_FLAG(line->uart, UART_CLEAR_FEF | UART_CLEAR_NEF | UART_CLEAR_PEF);
    line->flags = 0;
#endif
}

static uint16_t take(mbm_stm32Line *line, uint8_t *bytes, uint16_t capacity)
{
    uint16_t count;

    if (!receives_by_dma(line->uart))
        return mbm_ring_read(&line->ring.ofInterrupt, bytes, capacity);
    count_flags(line);
    count = mbm_dmaRing_available(&line->ring.ofDma);
    if (count == 0u)
        return 0;
    before_reading(line);
    return mbm_dmaRing_read(&line->ring.ofDma, bytes, count < capacity ? count : capacity);
}

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_stm32Line *line = context;
    uint16_t count;

    if (line->uart == NULL || line->uart->RxState == HAL_UART_STATE_RESET)
        return -1;
    if (line->hasFailed && !line->isSending) {
        line->hasFailed = 0;
        return -1;
    }
    count = take(line, bytes, capacity);
    return count == 0u && !is_receiving(line) ? receive_again(line) : (int16_t)count;
}

/* --- transmission */

/* Counts a transmission that the HAL has ended before its last bit. The next call reports it. */
static void stall(mbm_stm32Line *line)
{
    line->isSending = 0;
    line->hasFailed = 1;
    line->stalled++;
    driver_off(line);
}

/* Aborts a transmission that takes too long. */
static void end_if_overdue(mbm_stm32Line *line)
{
    if (!line->isSending || HAL_GetTick() - line->sentAt < line->sendingTime)
        return;
    (void)HAL_UART_AbortTransmit(line->uart);
    stall(line);
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_stm32Line *line = context;
    UART_HandleTypeDef *uart = line->uart;
    HAL_StatusTypeDef status;
    uint16_t count = length < sizeof line->toSend ? length : (uint16_t)sizeof line->toSend;

    if (uart == NULL || uart->gState == HAL_UART_STATE_RESET)
        return -1;
    end_if_overdue(line);
    if (line->hasFailed) {
        line->hasFailed = 0;
        return -1;
    }
    if (line->isSending || uart->gState != HAL_UART_STATE_READY)
        return 0;
    memcpy(line->toSend, bytes, count);
    before_sending(line, count);
    line->hasMore = count < length;
    line->sentAt = HAL_GetTick();
    line->sendingTime = 2u * count * BITS * 1000u / uart->Init.BaudRate + PATIENCE;
    line->isSending = 1;
    if (MBM_STM32_BY_DMA && uart->hdmatx != NULL)
        status = HAL_UART_Transmit_DMA(uart, line->toSend, count);
    else
        status = HAL_UART_Transmit_IT(uart, line->toSend, count);
    if (status == HAL_OK)
        return (int16_t)count;
    line->isSending = 0;
    return status == HAL_BUSY ? 0 : -1;
}

static uint8_t line_flush(void *context)
{
    mbm_stm32Line *line = context;

    if (line->uart == NULL)
        return 1;
    /* While it sends, nothing reads, and the HAL's handler of an idle line would clear an overrun.
     */
    if (receives_by_dma(line->uart))
        count_flags(line);
    end_if_overdue(line);
    if (line->isDeaf && !line->isSending)
        driver_off(line);
    return !line->isSending;
}

/* --- the clock */

/* The tick of the HAL, and within it SysTick's counter, if that has the tick's period. Where the
 * HAL counts another timer's ticks, the two are not in step, and the clock waits instead of
 * stepping back. */
static uint32_t line_micros(void *context)
{
    mbm_stm32Line *line = context;
    uint32_t period = SysTick->LOAD + 1u, ticks, counter, now;

    do {
        ticks = HAL_GetTick();
        counter = SysTick->VAL;
    } while (ticks != HAL_GetTick());
    now = ticks * 1000u;
    if (period == SystemCoreClock / 1000u && counter < period)
        now += (period - 1u - counter) * 1000u / period;
    if (line->latestMicros - now < 65536u)
        return line->latestMicros;
    line->latestMicros = now;
    return now;
}

/* --- what the interrupts call */

void mbm_stm32_noteTransmitted(UART_HandleTypeDef *uart)
{
    mbm_stm32Line *line = line_of(uart);

    if (line == NULL)
        return;
    if (!line->hasMore)
        driver_off(line);
    line->isSending = 0;
    wake(line);
}

static void count_errors(mbm_stm32Line *line)
{
    uint32_t errors = line->uart->ErrorCode;

    if ((errors & (HAL_UART_ERROR_FE | HAL_UART_ERROR_NE | HAL_UART_ERROR_PE)) != 0u)
        line->faulty++;
    if ((errors & HAL_UART_ERROR_ORE) != 0u)
        count_overrun(line);
}

void mbm_stm32_noteReceived(UART_HandleTypeDef *uart)
{
    mbm_stm32Line *line = line_of(uart);

    if (line == NULL)
        return;
    if (receives_by_dma(uart)) {
        mbm_dmaRing_note(&line->ring.ofDma);
    } else {
        /* The next call of the HAL forgets the errors of this byte. If it is refused, read tries
         * again. */
        count_errors(line);
        (void)mbm_ring_put(&line->ring.ofInterrupt, line->byte);
        (void)HAL_UART_Receive_IT(uart, &line->byte, 1);
    }
    wake(line);
}

void mbm_stm32_noteError(UART_HandleTypeDef *uart)
{
    mbm_stm32Line *line = line_of(uart);

    if (line == NULL)
        return;
    count_errors(line);
    if (receives_by_dma(uart)) {
        mbm_dmaRing_note(&line->ring.ofDma);
    } else if (uart->RxState == HAL_UART_STATE_READY) {
        line->restarts++;
        (void)HAL_UART_Receive_IT(uart, &line->byte, 1);
    }
    /* The HAL has ended a transmission whose DMA failed. */
    if (line->isSending && (uart->ErrorCode & HAL_UART_ERROR_DMA) != 0u &&
        uart->gState == HAL_UART_STATE_READY)
        stall(line);
    wake(line);
}

/* --- begin and end */

static uint8_t fault_of_dma(const mbm_stm32Line *line, const UART_HandleTypeDef *uart)
{
#if MBM_STM32_BY_DMA && defined(DMA_CIRCULAR)
    const DMA_HandleTypeDef *in = uart->hdmarx, *out = uart->hdmatx;

    if (in != NULL &&
        (in->Init.Mode != DMA_CIRCULAR || in->Init.MemDataAlignment != DMA_MDATAALIGN_BYTE ||
         in->Init.MemInc != DMA_MINC_ENABLE || in->Init.Direction != DMA_PERIPH_TO_MEMORY))
        return MBM_STM32_RECEIVE_DMA;
    if (out != NULL &&
        (out->Init.Mode != DMA_NORMAL || out->Init.MemDataAlignment != DMA_MDATAALIGN_BYTE ||
         out->Init.MemInc != DMA_MINC_ENABLE || out->Init.Direction != DMA_MEMORY_TO_PERIPH))
        return MBM_STM32_TRANSMIT_DMA;
#endif
    if (MBM_STM32_BY_DMA && (uart->hdmarx != NULL || uart->hdmatx != NULL) && !dma_reaches(line))
        return MBM_STM32_MEMORY;
    return MBM_STM32_OK;
}

static uint8_t fault_of(const mbm_stm32Line *line, const UART_HandleTypeDef *uart)
{
    if (line->uart != NULL || line_of(uart) != NULL)
        return MBM_STM32_OPEN;
    if (uart->Instance == NULL || uart->gState == HAL_UART_STATE_RESET || uart->Init.BaudRate == 0u)
        return MBM_STM32_NOT_STARTED;
    if (uart->gState != HAL_UART_STATE_READY || uart->RxState != HAL_UART_STATE_READY)
        return MBM_STM32_BUSY;
    /* The HAL counts the parity bit as a bit of the word. */
    if (uart->Init.WordLength !=
            (uart->Init.Parity == UART_PARITY_NONE ? UART_WORDLENGTH_8B : UART_WORDLENGTH_9B) ||
        uart->Init.Mode != UART_MODE_TX_RX)
        return MBM_STM32_FORMAT;
    if (line->driverPort != NULL && line->driverPin == 0u)
        return MBM_STM32_PIN;
    return fault_of_dma(line, uart);
}

#if defined(USE_HAL_UART_REGISTER_CALLBACKS) && USE_HAL_UART_REGISTER_CALLBACKS
static void note_event(UART_HandleTypeDef *uart, uint16_t length)
{
    (void)length;
    mbm_stm32_noteReceived(uart);
}

static void set_callbacks(UART_HandleTypeDef *uart)
{
    (void)HAL_UART_RegisterCallback(uart, HAL_UART_TX_COMPLETE_CB_ID, mbm_stm32_noteTransmitted);
    (void)HAL_UART_RegisterCallback(uart, HAL_UART_RX_COMPLETE_CB_ID, mbm_stm32_noteReceived);
    (void)HAL_UART_RegisterCallback(uart, HAL_UART_ERROR_CB_ID, mbm_stm32_noteError);
    (void)HAL_UART_RegisterRxEventCallback(uart, note_event);
}
#else
static void set_callbacks(UART_HandleTypeDef *uart)
{
    (void)uart;
}
#endif

static void forget(mbm_stm32Line *line)
{
    mbm_stm32Line **place = &lines;

    while (*place != NULL && *place != line)
        place = &(*place)->next;
    if (*place != NULL)
        *place = line->next;
    line->uart = NULL;
}

uint8_t mbm_stm32_open(mbm_stm32Line *line, UART_HandleTypeDef *uart, mbm_port *port)
{
    static const mbm_port hooks = {
        .read = line_read, .write = line_write, .micros = line_micros, .flush = line_flush};
    uint8_t fault;

    if (line == NULL || uart == NULL || port == NULL)
        return MBM_STM32_NULL;
    fault = fault_of(line, uart);
    if (fault != MBM_STM32_OK)
        return fault;
    line->faulty = line->overruns = line->restarts = line->stalled = 0;
    line->lost = line->flags = 0;
    line->isSending = line->hasFailed = line->isDeaf = 0;
    line->latestMicros = HAL_GetTick() * 1000u;
    memset(&line->ring, 0, sizeof line->ring);
    if (!receives_by_dma(uart))
        mbm_ring_begin(&line->ring.ofInterrupt, line->received, sizeof line->received);
    /* A line that was zeroed while it was open is in the list already. */
    forget(line);
    line->uart = uart;
    line->next = lines;
    lines = line;
    set_callbacks(uart);
    *port = hooks;
    port->context = line;
    if (line->driverPort != NULL || is_single_wire(uart)) {
        port->preTransmission = driver_on;
        port->postTransmission = driver_off;
    }
    driver_off(line);
    if (receive(line) != HAL_OK) {
        forget(line);
        return MBM_STM32_RECEPTION;
    }
    return MBM_STM32_OK;
}

void mbm_stm32_close(mbm_stm32Line *line)
{
    if (line == NULL || line->uart == NULL)
        return;
    (void)HAL_UART_AbortTransmit(line->uart);
    (void)HAL_UART_AbortReceive(line->uart);
    driver_off(line);
    line->lost = mbm_stm32_lost(line);
    forget(line);
}

uint16_t mbm_stm32_lost(const mbm_stm32Line *line)
{
    if (line == NULL)
        return 0;
    if (line->uart == NULL)
        return line->lost;
    if (receives_by_dma(line->uart))
        return (uint16_t)(line->lost + mbm_dmaRing_lost(&line->ring.ofDma));
    return (uint16_t)(line->lost + mbm_ring_lost(&line->ring.ofInterrupt));
}

const char *mbm_stm32_text(uint8_t fault)
{
    static const char *const texts[] = {
        "the line is open",
        "line, UART or port is NULL",
        "the line is open already, or another line has this UART",
        "the UART is not initialised: call MX_USARTx_UART_Init before",
        "another part of the program sends or receives on this UART",
        "the UART needs both directions and 8 data bits: with parity the word length is 9 bits",
        "the DMA of USARTx_RX must be circular, of bytes, and increment the memory's address",
        "the DMA of USARTx_TX must be normal, of bytes, and increment the memory's address",
        "the DMA does not reach the memory of the line: place it in a RAM of the DMA's domain",
        "the driver's pin has no number",
        "the HAL does not start reception: is the DMA initialised before the UART?",
    };

    return fault < sizeof texts / sizeof texts[0] ? texts[fault] : "no fault of this port";
}
