/* The test kit for ports: a table of ports with one fault each, with the sentence that says it, and
 * right ports of each kind. The UART is a model with a clock of its own. */
#include "mbm_porttest.h"
#include "model_uart.h"
#include "test.h"

/* What a run said. */
typedef struct said {
    char sentences[24][256];
    mbm_portFinding kinds[24];
    unsigned count;
} said;

/* A port on a model, and its test. */
typedef struct kit {
    model_uart uart, far;
    mbm_port port, other;
    mbm_portTest test;
} kit;

static kit k;
static said heard;

static void hear(void *context, mbm_portFinding kind, const char *sentence)
{
    assert_true(heard.count < COUNT(heard.sentences));
    /* A sentence that is as long as its buffer would be cut off. */
    assert_true(strlen(sentence) < sizeof k.test.sentence - 1);
    heard.kinds[heard.count] = kind;
    strcpy(heard.sentences[heard.count++], sentence);
}

/* A % stands for a time in microseconds. */
static int is_like(const char *sentence, const char *wanted)
{
    for (; *wanted != '\0'; wanted++) {
        if (*wanted == '%') {
            const size_t digits = strspn(sentence, "0123456789");

            if (digits == 0)
                return 0;
            sentence += digits;
        } else if (*sentence++ != *wanted) {
            return 0;
        }
    }
    return *sentence == '\0';
}

static int was_said(mbm_portFinding kind, const char *sentence)
{
    for (unsigned i = 0; i < heard.count; i++)
        if (heard.kinds[i] == kind && is_like(heard.sentences[i], sentence))
            return 1;
    return 0;
}

static void says(mbm_portFinding kind, const char *sentence)
{
    if (was_said(kind, sentence))
        return;
    for (unsigned i = 0; i < heard.count; i++)
        print_error("%s: %s\n", mbm_portFinding_name(heard.kinds[i]), heard.sentences[i]);
    fail_msg("it does not say: %s", sentence);
}

/* --- kinds of ports */

/* An interrupt and a ring of 257 bytes at 9600 baud. */
static model_uart with_interrupt(void)
{
    return (model_uart){
        .baud = 9600, .callNs = 20000, .stepUs = 1, .txBuffer = 300, .ring = 256, .block = 1};
}

/* A UART with a FIFO of 16 bytes each way that the main loop polls. */
static model_uart with_fifo(void)
{
    model_uart uart = with_interrupt();

    uart.txBuffer = uart.ring = 16;
    return uart;
}

/* DMA both ways: the ring is read when the line is idle, or a half is full. */
static model_uart with_dma(void)
{
    model_uart uart = with_interrupt();

    uart.block = 64;
    uart.idleChars = 1;
    return uart;
}

/* Packets of 64 bytes, and no rate. */
static model_uart over_usb(void)
{
    model_uart uart = with_interrupt();

    uart.baud = 0;
    uart.block = 64;
    uart.idleChars = 64;
    return uart;
}

/* Blocks of any length, no rate, and a far end that may close. */
static model_uart over_socket(void)
{
    model_uart uart = over_usb();

    uart.block = uart.txBuffer;
    uart.isSocket = uart.holdsBack = 1;
    return uart;
}

/* Begins the model and a test that uses all it has. */
static void prepare(model_uart uart, int driver)
{
    memset(&k, 0, sizeof k);
    memset(&heard, 0, sizeof heard);
    k.uart = uart;
    model_begin(&k.uart);
    k.port = model_port(&k.uart, driver);
    k.test.port = &k.port;
    k.test.isLooped = 1;
    k.test.baud = uart.baud;
    k.test.holds = uart.ring;
    k.test.say = hear;
    k.test.lost = model_lost;
    k.test.begin = model_again;
    if (uart.isSocket)
        k.test.hangUp = model_hangUp;
    else
        k.test.disturb = model_disturb;
    k.test.context = &k.uart;
    if (driver || uart.ownDriver)
        k.test.driver = model_driver;
}

static void run_right(model_uart uart, int driver)
{
    prepare(uart, driver);
    if (mbm_portTest_run(&k.test) != 0)
        says(MBM_PORT_WRONG, "nothing");
    assert_int_equal(k.test.wrong, 0);
}

/* --- broken ports */

/* What a fault needs to show. */
static model_uart broken(model_fault fault)
{
    model_uart uart = fault == FULL_BLOCKS     ? with_dma()
                      : fault >= CLOSED_SILENT ? over_socket()
                                               : with_interrupt();

    uart.fault = fault;
    uart.ownDriver = fault == DRIVER_EARLY;
    return uart;
}

static int has_driver(model_fault fault)
{
    return (fault >= DRIVER_INVERTED && fault < DRIVER_EARLY) || fault == NO_FLUSH;
}

/* Puts a % in the place of each number. */
static void drop_numbers(char *words)
{
    char *to = words;

    while (*words != '\0') {
        const size_t digits = strspn(words, "0123456789");

        *to++ = digits > 0 ? '%' : *words;
        words += digits > 0 ? digits : 1;
    }
    *to = '\0';
}

/* The same sentence, with other numbers. */
static void finds_beside_tasks(model_fault fault, const char *sentence)
{
    model_uart uart = broken(fault);
    char words[256];

    strcpy(words, sentence);
    drop_numbers(words);
    uart.awayNs = 3000000;
    for (uart.awayCalls = 977; uart.awayCalls < 9000; uart.awayCalls += 1103) {
        prepare(uart, has_driver(fault));
        assert_int_equal(mbm_portTest_run(&k.test), 1);
        says(MBM_PORT_WRONG, words);
    }
}

/* The port has this fault, and the test says this sentence and no other of its kind. It does so
 * too if other tasks use the processor. */
static void finds(model_fault fault, const char *sentence)
{
    prepare(broken(fault), has_driver(fault));
    assert_int_equal(mbm_portTest_run(&k.test), 1);
    says(MBM_PORT_WRONG, sentence);
    finds_beside_tasks(fault, sentence);
}

TEST_ROW(
    a_clock_that_stands_still,
    finds(CLOCK_STANDS,
          "`micros` always returns the same time: start the timer, and let its interrupt run."))
TEST_ROW(
    a_clock_in_milliseconds,
    finds(
        CLOCK_IN_MILLIS,
        "8 characters took % us, and last 8333 at 9600 baud: the clock does not count microseconds, or the line has another rate."))
TEST_ROW(
    a_read_that_waits,
    finds(
        READ_WAITS,
        "`read` waited for % us although nothing had come: return 0 at once (a timeout of 0, a socket that is non-blocking)."))
TEST_ROW(
    a_read_that_returns_minus_one_for_nothing,
    finds(
        READ_MINUS_ONE,
        "`read` or `write` was negative, which means that the link is lost: open it, or return 0 while there is nothing to do."))
TEST_ROW(
    a_read_that_repeats_its_last_byte,
    finds(
        READ_ENDLESS,
        "`read` returns bytes without end although nothing is sent: return 0 when the ring is empty; give the RX pin a pull-up; set the rate of the line."))
TEST_ROW(
    a_read_past_its_capacity,
    finds(
        READ_OVERFLOWS,
        "`read` wrote past `capacity`, which was 1: copy at most `capacity` bytes; keep the rest for the next call."))
TEST_ROW(
    a_write_that_waits,
    finds(
        WRITE_WAITS,
        "`write` waited for % us: hand the bytes to an interrupt, to DMA or to a transmit buffer, and return the number that was taken."))
TEST_ROW(
    a_write_that_keeps_the_pointer,
    finds(
        WRITE_KEEPS,
        "The bytes on the line are those that were put into the buffer after `write` had returned: `write` keeps the pointer. Copy the bytes; mbm uses its buffer again."))
TEST_ROW(
    a_write_that_stays_busy,
    finds(
        WRITE_ONCE,
        "`write` took none of 256 bytes for a second, after a frame of 8: clear your mark of a transmission under way when it has ended, and take part of a frame that is longer than your buffer."))
TEST_ROW(
    a_write_that_refuses_a_long_frame,
    finds(
        WRITE_ALL_OR_NONE,
        "`write` took none of 256 bytes for a second, after a frame of 8: clear your mark of a transmission under way when it has ended, and take part of a frame that is longer than your buffer."))
TEST_ROW(
    a_write_that_claims_more_than_it_took,
    finds(
        WRITE_CLAIMS,
        "Only the first 64 of 256 bytes arrived: the receiver loses the others (let an interrupt or DMA fill a ring), or `write` returned more than it took."))
TEST_ROW(
    a_link_that_is_not_open,
    finds(
        WRITE_LOST,
        "`read` or `write` was negative, which means that the link is lost: open it, or return 0 while there is nothing to do."))
TEST_ROW(
    a_flush_that_never_ends,
    finds(
        FLUSH_NEVER,
        "`flush` returned 0 for a second: it must return 1 once the last bit has left. Start the interrupt or read the flag that says so."))
TEST_ROW(
    a_flush_that_is_always_1,
    finds(
        FLUSH_AT_ONCE,
        "`flush` returned 1 after % us, and 8 characters last 8333: it must wait for the last bit. Ask for transmission complete, not for an empty register, FIFO or DMA."))
TEST_ROW(
    a_flush_a_character_too_early,
    finds(
        FLUSH_EARLY,
        "`flush` returned 1 after % us, and 8 characters last 8333: it must wait for the last bit. Ask for transmission complete, not for an empty register, FIFO or DMA."))
TEST_ROW(
    a_flush_that_is_late,
    finds(
        FLUSH_LATE,
        "`flush` returned 1 % us after the last bit: a device may reply before, and the driver is still on. Ask for transmission complete."))
TEST_ROW(
    a_driver_without_a_flush,
    finds(
        NO_FLUSH,
        "The port switches a driver and has no `flush`: the driver goes off before the bytes have left. Set `flush` to a function that returns 1 after the last bit."))
TEST_ROW(
    a_driver_of_the_wrong_level,
    finds(DRIVER_INVERTED,
          "The driver is off during a frame and on otherwise: turn the level of its pin round."))
TEST_ROW(
    a_driver_pin_that_is_no_output,
    finds(
        DRIVER_DEAD,
        "The driver did not go on for a frame: make its pin an output, look at its number and its level, and at `preTransmission`."))
TEST_ROW(
    a_driver_that_stays_on,
    finds(
        DRIVER_STAYS,
        "The driver is still on after a frame: switch its pin off in `postTransmission`, or in the interrupt of transmission complete."))
TEST_ROW(
    a_driver_hook_that_waits,
    finds(
        DRIVER_WAITS,
        "`preTransmission` or `postTransmission` waited for % us: switch the pin and return; flush and mbm_line_setPostFlushHold wait for the last bit."))
TEST_ROW(
    a_driver_that_goes_off_with_the_last_dma_byte,
    finds(
        DRIVER_EARLY,
        "The driver went off after % us, before the last bit: switch it in the interrupt of transmission complete, or in `postTransmission`."))
TEST_ROW(
    a_receiver_that_is_off,
    finds(
        DEAF,
        "Nothing arrived: look at the wire, at the pins' function, whether the receiver is on while the port sends, and whether its interrupt reaches the ring."))
TEST_ROW(
    a_dma_without_the_idle_line,
    finds(
        FULL_BLOCKS,
        "Only 0 of 8 bytes arrived until more were sent: the receiver hands over full blocks alone. Add the idle-line event of the DMA, or the timeout of the FIFO."))
TEST_ROW(
    a_receiver_that_loses_a_byte,
    finds(
        LOSES,
        "After 91 of 256 bytes, 1 went missing: the receiver is read too late. Let an interrupt or DMA fill a ring."))
TEST_ROW(software_flow_control,
         finds(SWALLOWS_XON,
               "The byte 17 was swallowed: XON and XOFF are on. Switch software flow control off."))
TEST_ROW(
    seven_data_bits,
    finds(
        SEVEN_BITS,
        "A 226 arrived as 98: the upper bit is missing. Set eight data bits (with a parity, a word of nine on STM32)."))
TEST_ROW(a_console_that_translates,
         finds(TRANSLATES,
               "A 13 arrived as 10: a console translates line ends. Make the line raw."))
TEST_ROW(a_byte_that_comes_twice,
         finds(TWICE,
               "Byte 92 of 256, a 211, came twice: `read` must take a byte out of the ring, once."))
TEST_ROW(
    an_overrun_that_is_not_cleared,
    finds(
        OVERRUN_DEAF,
        "After an overrun of 556 bytes later ones do not arrive as they were sent: clear the overrun flag of the UART, and start reception again."))
TEST_ROW(
    an_overrun_that_is_not_counted,
    finds(
        OVERRUN_UNCOUNTED,
        "300 of 556 bytes were lost, and `lost` did not count them: count an overrun of the UART and a full ring."))
TEST_ROW(
    a_ring_that_is_smaller_than_promised,
    finds(
        HOLDS_LESS,
        "While the main loop was away, 100 of 256 bytes were held: `holds` is too high, or bytes are lost before the ring."))
TEST_ROW(
    an_idle_that_sleeps_too_long,
    finds(
        IDLE_TOO_LONG,
        "`idle` slept at least % us longer than mbm_node_pollDelay allowed: round ticks down, and do not sleep for less than one."))
TEST_ROW(
    an_idle_that_no_byte_ends,
    finds(
        IDLE_DEAF,
        "`idle` slept for % us while a byte lay there: let the receive interrupt end the sleep, or sleep for one tick at most."))
TEST_ROW(
    a_second_begin_that_fails,
    finds(
        BEGIN_FAILS,
        "`begin` failed the second time: stop the UART, its DMA and its interrupts before you start them, for a program that changes the rate."))
TEST_ROW(
    a_second_begin_that_leaves_reception_off,
    finds(
        BEGIN_DEAF,
        "After a second `begin` bytes do not arrive as they were sent: empty the ring, clear pending flags, and start reception again."))
TEST_ROW(
    an_error_on_the_line_that_is_not_cleared,
    finds(
        ERROR_DEAF,
        "After an error on the line bytes do not arrive as they were sent: clear the flags of framing, noise, parity and overrun, and start reception again in the error callback."))
TEST_ROW(
    an_error_on_the_line_that_is_a_lost_link,
    finds(
        ERROR_NEGATIVE,
        "`read` was negative after an error on the line: that means that the link is lost. Clear the error and return the bytes that have come, or 0."))

TEST_ROW(
    a_closed_connection_that_looks_like_a_silent_device,
    finds(
        CLOSED_SILENT,
        "`read` returned 0 for a second after the far end had closed the connection, as if the device were silent. Return a negative number at the end of the stream."))
TEST_ROW(
    a_closed_connection_that_no_second_begin_replaces,
    finds(
        CLOSED_FOR_EVER,
        "After the far end had closed the connection, `begin` did not make one that carries bytes: close the socket, and open a new one."))

TEST(a_hook_that_is_missing)
{
    prepare(with_interrupt(), 1);
    k.port.read = NULL;
    k.port.write = NULL;
    k.port.micros = NULL;
    k.port.postTransmission = NULL;
    assert_int_equal(mbm_portTest_run(&k.test), 4);
    says(MBM_PORT_WRONG,
         "The port has no `read`: set it to a function that returns 0 until bytes have come.");
    says(MBM_PORT_WRONG,
         "The port has no `write`: set it to a function that takes bytes and does not wait.");
    says(MBM_PORT_WRONG,
         "The port has no `micros`: set it to a clock; a millisecond tick times 1000 will do.");
    says(
        MBM_PORT_WRONG,
        "The port has `preTransmission` and no `postTransmission`: the driver stays on after the first "
        "frame. Set both.");
}

/* A clock of milliseconds is found by the reference before anything is sent. */
TEST(a_clock_in_milliseconds_beside_a_reference)
{
    prepare(broken(CLOCK_IN_MILLIS), 0);
    k.test.reference = model_reference;
    assert_int_equal(mbm_portTest_run(&k.test), 1);
    says(
        MBM_PORT_WRONG,
        "`micros` counted 100 while % us passed: return microseconds (a tick times its length in us, a cycle counter divided by its cycles in a us).");
}

/* At 72 MHz a counter of 32 bits wraps after 59.7 s. A run is shorter. */
TEST(a_clock_that_wraps_early)
{
    prepare(broken(CLOCK_WRAPS), 0);
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    assert_int_equal(mbm_portTest_watchClock(&k.test, 61000), 1);
    says(
        MBM_PORT_WRONG,
        "`micros` jumped back by % us: it must count up to 2^32 and wrap only there. Do not divide a counter that wraps; add up its differences.");
}

TEST(a_clock_that_wraps_at_2_to_the_32_is_right)
{
    prepare(with_interrupt(), 0);
    k.uart.now = 4290000000000u;
    model_begin(&k.uart);
    assert_int_equal(mbm_portTest_watchClock(&k.test, 10000), 0);
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    assert_true(k.uart.now > 4294967296000u);
}

/* mbm stands a step back of up to 65 ms. */
TEST(a_clock_that_sometimes_steps_back_is_advice)
{
    run_right(broken(CLOCK_TEARS), 0);
    says(
        MBM_PORT_ADVICE,
        "`micros` stepped back by % us, which mbm stands up to 65 ms: a tick was read beside its interrupt. Read the tick again after the counter, and take both anew if it has changed.");
}

TEST(no_port_is_refused)
{
    static mbm_portTest none;

    assert_int_equal(mbm_portTest_run(NULL), 1);
    assert_int_equal(mbm_portTest_run(&none), 1);
    assert_int_equal(mbm_portTest_watchClock(NULL, 1), 1);
    assert_int_equal(mbm_portTest_watchClock(&none, 1), 1);
}

/* --- right ports */

TEST(a_port_with_an_interrupt_passes)
{
    run_right(with_interrupt(), 1);
    assert_int_equal(k.test.advice, 0);
    assert_int_equal(k.test.leftOut, 0);
    assert_int_equal(k.test.checks, 13);
    assert_int_equal(k.test.longestBlock, 1);
    says(MBM_PORT_FACT, "300 of 556 bytes were lost, and `lost` counted 300.");
}

TEST(a_port_passes_at_any_rate)
{
    static const uint32_t rates[] = {300, 1200, 19200, 115200};

    for (unsigned i = 0; i < COUNT(rates); i++) {
        model_uart uart = with_interrupt();

        uart.baud = rates[i];
        uart.callNs = rates[i] > 19200 ? 2000 : 20000;
        run_right(uart, 1);
        uart.fault = FLUSH_EARLY;
        prepare(uart, 1);
        assert_int_equal(mbm_portTest_run(&k.test), 1);
    }
}

TEST(a_port_with_a_fifo_passes)
{
    run_right(with_fifo(), 1);
    says(
        MBM_PORT_ADVICE,
        "`write` takes at most 16 of 256 bytes at once: a frame gets a pause if the main loop is away for longer than they last. A transmit buffer of 256 bytes prevents that.");
}

/* It says how much it holds of a frame. */
TEST(a_port_that_promises_nothing_gets_advice)
{
    prepare(with_fifo(), 1);
    k.test.holds = 0;
    k.test.lost = NULL;
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    says(
        MBM_PORT_ADVICE,
        "While the main loop is away the receiver holds 16 of 256 bytes: poll at least every % us, or let an interrupt or DMA fill a ring of 257 bytes.");
    says(
        MBM_PORT_ADVICE,
        "540 of 556 bytes were lost, and no counter said so: count them (mbm_ring_lost does), and set `lost`.");
}

TEST(a_port_with_dma_and_the_idle_line_passes)
{
    run_right(with_dma(), 1);
    assert_int_equal(k.test.longestBlock, 64);
    says(
        MBM_PORT_FACT,
        "Bytes arrive in blocks of up to 64, at most % us late: no setting of mbm needs a change.");
}

TEST(a_port_over_usb_passes)
{
    run_right(over_usb(), 0);
    says(MBM_PORT_FACT, "Bytes arrive in blocks of up to 64.");
    says(MBM_PORT_LEFT_OUT,
         "Whether `flush` is exact was not measured: set `baud`, if the line has a rate.");
}

/* It needs no flush, and the test says which checks it left out. */
TEST(a_port_over_a_socket_passes)
{
    run_right(over_socket(), 0);
    assert_int_equal(k.test.advice, 0);
    says(
        MBM_PORT_LEFT_OUT,
        "Whether `flush` is missing was not judged: a socket or USB needs none. Set `baud`, if the line has a rate.");
    says(MBM_PORT_LEFT_OUT,
         "The pin of a driver was not looked at: set `driver`, if there is one.");
    says(
        MBM_PORT_LEFT_OUT,
        "No error on the line was tried: set `disturb` to a function that makes one, such as a break, if the line can have one.");
    assert_int_equal(k.test.leftOut, 3);
    prepare(over_socket(), 0);
    k.test.hangUp = NULL;
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    says(
        MBM_PORT_LEFT_OUT,
        "No connection was closed: set `hangUp` to a function that closes one at its far end, if the line is a connection.");
}

TEST(a_uart_without_a_flush_gets_advice)
{
    run_right(broken(NO_FLUSH), 0);
    says(
        MBM_PORT_ADVICE,
        "The port has no `flush`: a response timeout gets the time of the request's characters on top.");
}

TEST(a_line_that_holds_the_sender_back_loses_nothing)
{
    model_uart uart = over_usb();

    uart.ring = 100;
    uart.holdsBack = 1;
    run_right(uart, 0);
    says(MBM_PORT_FACT, "400 bytes at once were all held, or the line held the sender back.");
}

/* The driver is switched by the UART, which holds it for no longer than the last bit. */
TEST(a_uart_that_switches_the_driver_itself_passes)
{
    model_uart uart = with_interrupt();

    uart.ownDriver = 1;
    run_right(uart, 0);
}

/* The interrupt of transmission complete switches it off, between any two calls of the test. */
TEST(a_driver_that_an_interrupt_switches_off_passes)
{
    model_uart uart = with_interrupt();

    uart.ownDriver = 1;
    for (uart.callNs = 5000; uart.callNs < 40000; uart.callNs += 500)
        run_right(uart, 1);
}

/* --- a processor that other tasks use too */

/* The task of the test is away now and then, at another moment in each run. */
static void run_beside_tasks(model_uart uart, int driver, void (*run)(model_uart uart, int driver))
{
    static const uint32_t milliseconds[] = {1, 4, 15, 60};

    for (unsigned i = 0; i < COUNT(milliseconds); i++) {
        uart.awayNs = milliseconds[i] * 1000000u;
        for (uart.awayCalls = 401; uart.awayCalls < 6000; uart.awayCalls += 433)
            run(uart, driver);
    }
}

TEST(a_port_with_an_interrupt_passes_beside_other_tasks)
{
    run_beside_tasks(with_interrupt(), 1, run_right);
}

TEST(a_port_with_dma_passes_beside_other_tasks)
{
    run_beside_tasks(with_dma(), 1, run_right);
}

TEST(a_port_over_usb_passes_beside_other_tasks)
{
    run_beside_tasks(over_usb(), 0, run_right);
}

TEST(a_driver_that_an_interrupt_switches_off_passes_beside_other_tasks)
{
    model_uart uart = with_interrupt();

    uart.ownDriver = 1;
    run_beside_tasks(uart, 1, run_right);
}

TEST(a_uart_that_switches_the_driver_itself_passes_beside_other_tasks)
{
    model_uart uart = with_interrupt();

    uart.ownDriver = 1;
    run_beside_tasks(uart, 0, run_right);
}

/* Whenever the task wakes, another one runs first. */
TEST(no_sleep_is_judged_where_other_tasks_always_delay_it)
{
    model_uart uart = with_interrupt();

    uart.flushWaits = 1;
    run_right(uart, 1);
    uart.awayCalls = 301;
    uart.awayNs = uart.wakesNs = 4000000;
    run_right(uart, 1);
    says(
        MBM_PORT_LEFT_OUT,
        "Whether `flush` is late was not measured: other tasks take the processor for % us at a time.");
    says(
        MBM_PORT_LEFT_OUT,
        "Whether `idle` sleeps too long was not measured: other tasks take the processor for % us at a time.");
}

/* Nothing else runs: the port itself sleeps too long. */
TEST(a_sleep_that_is_always_too_long_is_wrong)
{
    model_uart uart = with_interrupt();

    uart.flushWaits = 1;
    uart.wakesNs = 4000000;
    prepare(uart, 1);
    assert_int_equal(mbm_portTest_run(&k.test), 2);
    says(
        MBM_PORT_WRONG,
        "`flush` returned 1 % us after the last bit: a device may reply before, and the driver is still on. Ask for transmission complete.");
    says(
        MBM_PORT_WRONG,
        "`idle` slept at least % us longer than mbm_node_pollDelay allowed: round ticks down, and do not sleep for less than one.");
}

/* Half a character is shorter than its tick. */
TEST(a_port_with_a_tick_of_a_millisecond_passes)
{
    model_uart uart = with_interrupt();

    uart.stepUs = 1000;
    run_right(uart, 1);
    says(
        MBM_PORT_LEFT_OUT,
        "Whether `flush` is exact was not measured: half a character lasts % us, and the clock moves in steps of 1000. Set `reference`, or test at a lower rate.");
    prepare(uart, 1);
    k.test.reference = model_reference;
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    assert_int_equal(k.test.leftOut, 0);
}

/* As an Arduino core's Stream does. */
TEST(a_write_that_may_wait_passes)
{
    prepare(broken(WRITE_WAITS), 1);
    k.test.mayWait = 1;
    assert_int_equal(mbm_portTest_run(&k.test), 0);
}

TEST(without_a_wire_the_hooks_are_tested)
{
    prepare(with_interrupt(), 1);
    k.test.isLooped = 0;
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    assert_int_equal(k.test.checks, 8);
    says(
        MBM_PORT_LEFT_OUT,
        "Nothing was received: lead a wire from TX to RX and set `isLooped`, or set `other`, a second port on the line.");
    prepare(broken(FLUSH_EARLY), 1);
    k.test.isLooped = 0;
    assert_int_equal(mbm_portTest_run(&k.test), 1);
}

/* Joins a second port. */
static void join(void)
{
    k.far = with_interrupt();
    k.far.wire = &k.uart;
    k.uart.wire = &k.far;
    k.far.now = k.uart.now;
    model_begin(&k.far);
    k.other = model_port(&k.far, 0);
    k.test.isLooped = 0;
    k.test.other = &k.other;
}

TEST(a_second_port_takes_the_place_of_the_wire)
{
    prepare(with_interrupt(), 1);
    join();
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    assert_int_equal(k.test.leftOut, 0);
    assert_int_equal(k.test.checks, 13);
}

TEST(a_second_port_finds_a_receiver_that_is_off)
{
    prepare(broken(DEAF), 0);
    join();
    assert_int_equal(mbm_portTest_run(&k.test), 1);
    says(
        MBM_PORT_WRONG,
        "Nothing arrived: look at the wire, at the pins' function, whether the receiver is on while the port sends, and whether its interrupt reaches the ring.");
}

/* A test that names no function of its own says nothing, and counts. */
TEST(the_least_that_a_test_needs_is_a_port)
{
    static mbm_portTest least;

    prepare(broken(READ_WAITS), 0);
    least.port = &k.port;
    assert_int_equal(mbm_portTest_run(&least), 1);
    assert_int_equal(least.wrong, 1);
}

static unsigned yields;

static void count_yields(void *context)
{
    yields++;
    (void)model_reference(context);
}

TEST(a_test_yields_while_it_waits)
{
    prepare(with_interrupt(), 1);
    k.test.yield = count_yields;
    assert_int_equal(mbm_portTest_run(&k.test), 0);
    assert_true(yields > 1000);
}

TEST(a_kind_of_finding_has_a_name)
{
    assert_string_equal(mbm_portFinding_name(MBM_PORT_WRONG), "wrong");
    assert_string_equal(mbm_portFinding_name(MBM_PORT_ADVICE), "advice");
    assert_string_equal(mbm_portFinding_name(MBM_PORT_FACT), "fact");
    assert_string_equal(mbm_portFinding_name(MBM_PORT_LEFT_OUT), "left out");
}

/* docs/port.md shows this output, with times of one run. */
TEST(the_output_on_the_page)
{
    static const char *const lines[] = {
        "fact: `micros` moves in steps of % us.",
        "wrong: `flush` returned 1 after % us, and 8 characters last 8333: it must wait for the last bit. Ask for transmission complete, not for an empty register, FIFO or DMA.",
        "left out: The pin of a driver was not looked at: set `driver`, if there is one.",
        "fact: Bytes arrive in blocks of up to 1, at most % us late: no setting of mbm needs a change.",
        "advice: 299 of 556 bytes were lost, and no counter said so: count them (mbm_ring_lost does), and set `lost`.",
        "left out: The port was not begun a second time: set `begin`.",
        "left out: No error on the line was tried: set `disturb` to a function that makes one, such as a break, if the line can have one.",
    };

    prepare(broken(FLUSH_EARLY), 0);
    k.test.lost = NULL;
    k.test.begin = NULL;
    k.test.disturb = NULL;
    assert_int_equal(mbm_portTest_run(&k.test), 1);
    assert_int_equal(heard.count, COUNT(lines));
    for (unsigned i = 0; i < heard.count; i++) {
        char line[300];

        snprintf(line, sizeof line, "%s: %s", mbm_portFinding_name(heard.kinds[i]),
                 heard.sentences[i]);
        if (!is_like(line, lines[i]))
            assert_string_equal(line, lines[i]);
    }
}
