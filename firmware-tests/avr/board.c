#include "board.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

/* The simulator's macros are signed. */
#define UART_IRQ(number) ((uint32_t)AVR_IOCTL_UART_GETIRQ(number))
#define ADC_IRQ(channel) (ADC_IRQ_ADC0 + (channel))
#define PORT_IRQ(port) ((uint32_t)AVR_IOCTL_IOPORT_GETIRQ(port))

enum { PAINT = 0xC5, SPL_AT = 0x5D };

/* The board's end of a wire: a UART or two pins. */
typedef struct end {
    avr_uart_t *uart;
    avr_irq_t *in;
    /* for a wire of two pins */
    int listening, level, bit_in, bit_out;
    uint16_t shift_in, shift_out;
} end;

typedef struct watch {
    board *on;
    pin_changed changed;
    void *context;
} watch;

struct board {
    avr_t *avr;
    elf_firmware_t firmware;
    wire wires[WIRES];
    end ends[WIRES];
    unsigned wired;
    watch watches[8];
    unsigned watched;
    uint16_t painted_from;
};

static void die(const char *what, const char *which)
{
    fprintf(stderr, "board: %s: %s\n", what, which);
    abort();
}

static void keep_quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    if (level == LOG_ERROR)
        vfprintf(stderr, format, arguments);
}

board *board_new(const char *elf, const char *mcu)
{
    board *b = calloc(1, sizeof *b);

    avr_global_logger_set(keep_quiet);
    if (!b || elf_read_firmware(elf, &b->firmware))
        die("cannot read", elf);
    b->avr = avr_make_mcu_by_name(mcu);
    if (!b->avr)
        die("unknown to the simulator", mcu);
    avr_init(b->avr);
    b->firmware.frequency = MHZ * 1000000;
    b->firmware.vcc = b->firmware.avcc = b->firmware.aref = 5000;
    avr_load_firmware(b->avr, &b->firmware);
    return b;
}

void board_free(board *b)
{
    avr_terminate(b->avr);
    free(b->avr);
    free(b->firmware.flash);
    free(b);
}

uint64_t board_cycle(const board *b)
{
    return b->avr->cycle;
}

/* --- the device's side */

static avr_cycle_count_t silent(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    wire *w = parameter;
    uint8_t frame[FRAME];
    size_t length = w->length;

    memcpy(frame, w->frame, length);
    w->length = 0;
    w->frames++;
    if (w->device)
        w->device(w, frame, length);
    return 0;
}

/* The board has begun to send a byte. */
static void byte_started(wire *w, uint8_t byte, uint64_t started)
{
    avr_t *avr = w->on->avr;
    uint64_t silence = 10 * w->bit + 35 * w->bit;

    if (w->length == 0)
        w->first_started = started;
    w->last_started = started;
    if (w->length < FRAME)
        w->frame[w->length++] = byte;
    avr_cycle_timer_cancel(avr, silent, w);
    avr_cycle_timer_register(avr, started + silence - avr->cycle, silent, w);
}

/* --- the board's side: a UART */

static avr_cycle_count_t next_byte(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    wire *w = parameter;

    /* In the simulator the UART has received the byte one byte time after this call. */
    avr_raise_irq(w->end->in, w->queue[w->tail % QUEUE]);
    w->tail++;
    if (w->tail == w->head)
        return 0;
    return w->due[w->tail % QUEUE] > avr->cycle ? w->due[w->tail % QUEUE] : avr->cycle + 1;
}

static void received(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    wire *w = parameter;

    if (!value)
        return;
    w->received = w->on->avr->cycle;
    w->bytes_received++;
}

static void byte_out(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    wire *w = parameter;
    uint64_t now = w->on->avr->cycle, next = w->last_started + 10 * w->bit;
    int follows = w->length > 0 && now - next < 5 * w->bit;

    byte_started(w, (uint8_t)value, now);
    /* The simulator's UART sends byte after byte without a pause. But it reports a byte when the
     * board's interrupt writes it, which another interrupt may delay. */
    if (follows)
        w->last_started = next;
    /* In the simulator the UART has received the byte one byte time after this call. */
    if (w->is_loop)
        avr_raise_irq(w->end->in, value);
}

/* The simulator's bytes are always eleven bits long. Corrects that for other formats. */
static void pace(wire *w)
{
    avr_uart_t *uart = w->end->uart;
    avr_t *avr = w->on->avr;
    uint32_t divider;

    if (!uart)
        return;
    divider = (avr->data[uart->ubrrl.reg] | (uint32_t)(avr->data[uart->ubrrh.reg] & 0xF) << 8) + 1;
    w->bit = divider * (avr_regbit_get(avr, uart->u2x) ? 8 : 16);
    uart->cycles_per_byte = 10 * w->bit;
}

static wire *new_wire(board *b, wire_device device, void *context)
{
    wire *w = &b->wires[b->wired];

    if (b->wired == WIRES)
        die("too many wires", "");
    w->end = &b->ends[b->wired++];
    w->on = b;
    w->device = device;
    w->context = context;
    return w;
}

wire *board_uart(board *b, char number, wire_device device, void *context)
{
    wire *w = new_wire(b, device, context);
    uint32_t flags = 0;
    avr_io_t *io;

    for (io = b->avr->io_port; io; io = io->next)
        if (strcmp(io->kind, "uart") == 0 && ((avr_uart_t *)io)->name == number)
            w->end->uart = (avr_uart_t *)io;
    if (!w->end->uart)
        die("no such UART", (char[]){number, 0});
    avr_ioctl(b->avr, (uint32_t)AVR_IOCTL_UART_GET_FLAGS(number), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POOL_SLEEP);
    avr_ioctl(b->avr, (uint32_t)AVR_IOCTL_UART_SET_FLAGS(number), &flags);
    w->end->in = avr_io_getirq(b->avr, UART_IRQ(number), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(b->avr, UART_IRQ(number), UART_IRQ_OUTPUT), byte_out, w);
    avr_irq_register_notify(
        avr_get_interrupt_irq(b->avr, w->end->uart->rxc.vector) + AVR_INT_IRQ_PENDING, received, w);
    return w;
}

static void ignore_frame(wire *w, const uint8_t *frame, size_t length) {}

void board_loop(board *b, char number)
{
    board_uart(b, number, ignore_frame, NULL)->is_loop = 1;
}

/* --- the board's side: pins, bit by bit */

static avr_cycle_count_t sample(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    wire *w = parameter;
    end *e = w->end;

    if (e->bit_in < 8) {
        e->shift_in = (uint16_t)(e->shift_in >> 1 | (e->level ? 0x80 : 0));
        e->bit_in++;
        return when + w->bit;
    }
    /* A byte without a stop bit is not a byte. */
    if (!e->level)
        die("a byte without its stop bit", "SoftwareSerial");
    e->listening = 0;
    byte_started(w, (uint8_t)e->shift_in, when - w->bit * 19 / 2);
    return 0;
}

static void level_out(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    wire *w = parameter;
    end *e = w->end;
    avr_t *avr = w->on->avr;

    e->level = value & 1;
    if (e->listening || e->level)
        return;
    e->listening = 1;
    e->bit_in = 0;
    avr_cycle_timer_register(avr, w->bit * 3 / 2, sample, w);
}

static avr_cycle_count_t next_bit(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    wire *w = parameter;
    end *e = w->end;

    if (e->bit_out == 0)
        e->shift_out = (uint16_t)(w->queue[w->tail % QUEUE] << 1 | 0x200);
    if (e->bit_out < 10) {
        avr_raise_irq(e->in, e->shift_out >> e->bit_out & 1);
        e->bit_out++;
        return when + w->bit;
    }
    e->bit_out = 0;
    w->received = avr->cycle;
    w->bytes_received++;
    w->tail++;
    if (w->tail == w->head)
        return 0;
    return w->due[w->tail % QUEUE] > when ? w->due[w->tail % QUEUE] : when + 1;
}

wire *board_pins(board *b, char port, int rx, int tx, unsigned baud, wire_device device,
                 void *context)
{
    wire *w = new_wire(b, device, context);

    w->bit = MHZ * 1000000u / baud;
    w->end->level = 1;
    w->end->listening = 0;
    w->end->in = avr_io_getirq(b->avr, PORT_IRQ(port), rx);
    avr_raise_irq(w->end->in, 1);
    avr_irq_register_notify(avr_io_getirq(b->avr, PORT_IRQ(port), tx), level_out, w);
    return w;
}

void wire_play(wire *w, uint64_t delay, const uint8_t *bytes, size_t length)
{
    avr_t *avr = w->on->avr;
    int idle = w->head == w->tail;
    uint64_t due =
        (idle || w->last_due + 10 * w->bit < avr->cycle ? avr->cycle : w->last_due + 10 * w->bit) +
        delay;
    avr_cycle_timer_t next = w->end->uart ? next_byte : next_bit;

    while (length-- > 0) {
        if (w->head - w->tail == QUEUE)
            die("too many bytes queued", "");
        w->queue[w->head % QUEUE] = *bytes++;
        w->due[w->head++ % QUEUE] = due;
        w->last_due = due;
        due += 10 * w->bit;
    }
    if (idle && w->head != w->tail)
        avr_cycle_timer_register(avr, w->due[w->tail % QUEUE] - avr->cycle + 1, next, w);
}

/* --- pins */

static void pin_out(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    watch *w = parameter;

    w->changed(w->context, value & 1, w->on->avr->cycle);
}

void board_watch_pin(board *b, char port, int pin, pin_changed changed, void *context)
{
    watch *w = &b->watches[b->watched++];

    w->on = b;
    w->changed = changed;
    w->context = context;
    avr_irq_register_notify(avr_io_getirq(b->avr, PORT_IRQ(port), pin), pin_out, w);
}

int board_pin(board *b, char port, int pin)
{
    avr_ioport_state_t state;

    avr_ioctl(b->avr, (uint32_t)AVR_IOCTL_IOPORT_GETSTATE(port), &state);
    return state.port >> pin & 1;
}

void board_sensor(board *b, int channel, unsigned millivolts)
{
    avr_raise_irq(avr_io_getirq(b->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ(channel)), millivolts);
}

/* --- running */

static int step(board *b)
{
    int state = avr_run(b->avr);
    unsigned i;

    for (i = 0; i < b->wired; i++)
        pace(&b->wires[i]);
    return state != cpu_Crashed && state != cpu_Done;
}

int board_run(board *b, uint64_t cycles)
{
    uint64_t end_at = b->avr->cycle + cycles;

    while (b->avr->cycle < end_at)
        if (!step(b))
            return 0;
    return 1;
}

int board_run_until(board *b, uint16_t address, uint8_t value, uint64_t cycles)
{
    uint64_t end_at = b->avr->cycle + cycles;

    while (b->avr->cycle < end_at) {
        if (!step(b))
            return 0;
        if (b->avr->data[address] == value)
            return 1;
    }
    return 0;
}

uint16_t board_symbol(board *b, const char *name)
{
    uint32_t i;

    for (i = 0; i < b->firmware.symbolcount; i++)
        if (strcmp(b->firmware.symbol[i]->symbol, name) == 0)
            return (uint16_t)b->firmware.symbol[i]->addr;
    die("the sketch has no such global", name);
    return 0;
}

uint8_t board_byte(const board *b, uint16_t address)
{
    return b->avr->data[address];
}

uint16_t board_word(const board *b, uint16_t address)
{
    return (uint16_t)(b->avr->data[address] | b->avr->data[address + 1] << 8);
}

void board_paint(board *b)
{
    uint16_t bottom = board_symbol(b, "_end");

    b->painted_from = b->avr->cycle ? board_word(b, SPL_AT) : b->avr->ramend;
    memset(b->avr->data + bottom, PAINT, b->painted_from - bottom + 1u);
}

unsigned board_stack_depth(const board *b)
{
    uint16_t at = board_symbol((board *)(uintptr_t)b, "_end");

    while (at <= b->painted_from && b->avr->data[at] == PAINT)
        at++;
    return (unsigned)(b->painted_from - at) + 1;
}
