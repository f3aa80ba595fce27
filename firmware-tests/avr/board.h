/* An AVR board in a cycle-accurate simulator, and the wires that end at it. All times are
 * CPU cycles, and none depends on the speed of the host. */
#pragma once

#include <stddef.h>
#include <stdint.h>

enum { MHZ = 16, MS = MHZ * 1000, WIRES = 4, FRAME = 300, QUEUE = 2048 };

typedef struct board board;
typedef struct wire wire;

/* The device at the far end. It is called with each frame once the wire has been silent for
 * the time that separates frames. It answers with wire_play. */
typedef void (*wire_device)(wire *w, const uint8_t *frame, size_t length);

struct wire {
    board *on;
    wire_device device;
    void *context;   /* the device's */
    uint64_t bit;    /* cycles of one bit */
    unsigned frames; /* number of frames so far, including the one that the device is called with */
    uint64_t first_started; /* first byte of that frame: the time of its start bit */
    uint64_t last_started;  /* last byte of it: the time of its start bit */
    uint64_t received;      /* when the board had received the last byte of a reply */
    unsigned bytes_received;
    /* private */
    int is_loop;
    struct end *end;
    uint8_t frame[FRAME];
    size_t length;
    uint8_t queue[QUEUE];
    uint64_t due[QUEUE];
    size_t head, tail;
    uint64_t last_due;
};

board *board_new(const char *elf, const char *mcu);
void board_free(board *b);

/* Connects a device to hardware UART `number`. The board's own divider gives the length of
 * a bit. A byte has ten bits. */
wire *board_uart(board *b, char number, wire_device device, void *context);

/* Wires TX of hardware UART `number` to its RX. */
void board_loop(board *b, char number);

/* Connects a device bit by bit: it reads the board's pin `port``tx` and drives `port``rx`. */
wire *board_pins(board *b, char port, int rx, int tx, unsigned baud, wire_device device,
                 void *context);

/* Queues bytes for the board, `delay` cycles from now or after the bytes that are queued. */
void wire_play(wire *w, uint64_t delay, const uint8_t *bytes, size_t length);

/* Called whenever a pin changes. */
typedef void (*pin_changed)(void *context, int level, uint64_t cycle);
void board_watch_pin(board *b, char port, int pin, pin_changed changed, void *context);
int board_pin(board *b, char port, int pin);

/* Sets the voltage at an analogue pin. The board's supply is 5 V. */
void board_sensor(board *b, int channel, unsigned millivolts);

/* Runs for `cycles` cycles. Returns false if the firmware crashed. */
int board_run(board *b, uint64_t cycles);
/* Runs until a byte of RAM has a value, at most for `cycles`. Returns false if it never had. */
int board_run_until(board *b, uint16_t address, uint8_t value, uint64_t cycles);
uint64_t board_cycle(const board *b);

/* The address of a global of the sketch. The test fails if there is none. */
uint16_t board_symbol(board *b, const char *name);
uint8_t board_byte(const board *b, uint16_t address);
uint16_t board_word(const board *b, uint16_t address);

/* Fills the RAM below the stack. board_stack_depth returns how many bytes the stack has
 * grown below that place since. */
void board_paint(board *b);
unsigned board_stack_depth(const board *b);
