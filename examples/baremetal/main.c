/* A Modbus master on a board without an operating system. It sends each kind of request
 * once and reports how the requests ended.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm.h"
#include "report.h"

/* All storage is the program's own; mbm allocates nothing. */
static mbm_line line = MBM_INIT;
static mbm_node node = MBM_INIT;
static mbm_counters counters = MBM_INIT;
static uint16_t response[MBM_MAX_READ_REGISTERS];
static uint16_t transmit[REPORT_SIZE];
static uint8_t frame[MBM_FRAME_BYTES(MBM_MAX_READ_REGISTERS)];

static uint16_t report[REPORT_SIZE];

/* Notes the status of a request that has ended, and the sum of the words that it read. */
static void note(enum step step, const char *name, uint8_t status, uint8_t expected)
{
    uint16_t *words = report + REPORT_HEAD + STEP_SIZE * (unsigned)step;
    uint8_t i, count = mbm_node_available(&node);
    uint16_t sum = 0;

    /* Each word is weighted with its position, so that a wrong order changes the sum. */
    for (i = 0; i < count; i++) {
        sum = (uint16_t)(sum + (i + 1u) * mbm_node_receive(&node));
    }
    words[STEP_STATUS] = status;
    words[STEP_WORDS] = count;
    words[STEP_SUM] = sum;
    if (status != expected) {
        report[REPORT_UNEXPECTED]++;
    }
    console_print(name);
    console_print(": ");
    console_print(mbm_status_text(status));
    console_print("\n");
}

static void write(void)
{
    note(WRITE_REGISTER, "write a register", mbm_node_writeSingleRegister(&node, 100, 0xBEEF),
         MBM_OK);

    (void)mbm_node_beginTransmission(&node, 101);
    (void)mbm_node_send(&node, 0x1122);
    (void)mbm_node_send(&node, 0x5566);
    (void)mbm_node_send(&node, 0x3344);
    note(WRITE_REGISTERS, "write registers", mbm_node_writeQueuedRegisters(&node), MBM_OK);

    note(WRITE_COIL, "write a coil", mbm_node_writeSingleCoil(&node, 40, 1), MBM_OK);

    transmit[0] = 0xA5C3;
    transmit[1] = 0x0005;
    note(WRITE_COILS, "write 19 coils", mbm_node_writeMultipleCoils(&node, 50, 19), MBM_OK);
}

static void read(void)
{
    note(READ_HOLDING, "read holding registers", mbm_node_readHoldingRegisters(&node, 20, 10),
         MBM_OK);
    note(READ_INPUT_REGISTERS, "read input registers", mbm_node_readInputRegisters(&node, 30, 10),
         MBM_OK);
    note(READ_COILS, "read 37 coils", mbm_node_readCoils(&node, 45, 37), MBM_OK);
    note(READ_INPUTS, "read 21 discrete inputs", mbm_node_readDiscreteInputs(&node, 70, 21),
         MBM_OK);
}

static void write_and_read(void)
{
    note(MASK_WRITE, "mask a register", mbm_node_maskWriteRegister(&node, 102, 0x00FF, 0x3400),
         MBM_OK);

    transmit[0] = 0xCAFE;
    transmit[1] = 0xF00D;
    note(READ_WRITE, "write 2 registers and read 6",
         mbm_node_readWriteMultipleRegisters(&node, 100, 6, 104, 2), MBM_OK);

    note(READ_LONGEST, "read 125 registers", mbm_node_readHoldingRegisters(&node, 0, 125), MBM_OK);
}

static void failing_requests(void)
{
    uint32_t start;

    note(READ_ABSENT_REGISTER, "read an absent register",
         mbm_node_readHoldingRegisters(&node, 60000, 1), MBM_ILLEGAL_DATA_ADDRESS);

    (void)mbm_node_setSlaveID(&node, 0);
    note(BROADCAST, "write a register in every unit",
         mbm_node_writeSingleRegister(&node, 130, 0x5A5A), MBM_OK);
    (void)mbm_node_setSlaveID(&node, UNIT);
    note(READ_WHAT_WAS_BROADCAST, "read it", mbm_node_readHoldingRegisters(&node, 130, 1), MBM_OK);

    (void)mbm_node_setSlaveID(&node, ABSENT_UNIT);
    (void)mbm_node_setResponseTimeout(&node, ABSENT_TIMEOUT);
    start = clock_micros(0);
    note(ASK_ABSENT_UNIT, "read from a unit that is absent",
         mbm_node_readHoldingRegisters(&node, 0, 1), MBM_RESPONSE_TIMED_OUT);
    report[REPORT_ABSENT_MILLIS] = (uint16_t)((clock_micros(0) - start) / 1000u);
    (void)mbm_node_setResponseTimeout(&node, PRESENT_TIMEOUT);
    (void)mbm_node_setSlaveID(&node, UNIT);
    note(READ_AGAIN, "read again", mbm_node_readHoldingRegisters(&node, 100, 2), MBM_OK);
}

static uint8_t send_report(void)
{
    uint8_t i;

    report[REPORT_MAGIC] = REPORT_IS_HERE;
    report[REPORT_STEPS] = STEPS;
    report[REPORT_REQUESTS] = (uint16_t)counters.requests;
    report[REPORT_REPLIES] = (uint16_t)counters.replies;
    report[REPORT_EXCEPTIONS] = (uint16_t)counters.exceptions;
    report[REPORT_BAD_CRC] = (uint16_t)counters.badCrc;
    report[REPORT_TIMEOUTS] = (uint16_t)counters.timeouts;
    report[REPORT_FOREIGN_FRAMES] = (uint16_t)counters.foreignFrames;
    report[REPORT_RESYNCHRONISATIONS] = (uint16_t)counters.resynchronisations;
    for (i = 0; i < REPORT_SIZE; i++) {
        transmit[i] = report[i];
    }
    return mbm_node_writeMultipleRegisters(&node, REPORT_ADDRESS, REPORT_SIZE);
}

int main(void)
{
    static const mbm_port port = {
        .read = uart_read, .write = uart_write, .micros = clock_micros, .flush = uart_flush};

    uart_start();
    clock_start();

    (void)mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    (void)mbm_line_setBaudRate(&line, BAUD);
    (void)mbm_line_setCounters(&line, &counters);
    (void)mbm_node_begin(&node, &line, UNIT, response, MBM_MAX_READ_REGISTERS, transmit,
                         REPORT_SIZE);
    (void)mbm_node_setResponseTimeout(&node, PRESENT_TIMEOUT);

    write();
    read();
    write_and_read();
    failing_requests();
    if (send_report() != MBM_OK) {
        return 255;
    }
    return report[REPORT_UNEXPECTED];
}
