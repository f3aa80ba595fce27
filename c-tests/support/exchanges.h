/* Exchanges of a master with unit 17, 11 on the wire: a call, the bytes of the request, the bytes
 * that arrive, and what the call returns. A node, a client and the classes for sketches play them
 * all. */
#ifndef EXCHANGES_H
#define EXCHANGES_H

#include "mbm.h"

#include <stddef.h>

typedef struct exchange {
    uint8_t function;
    uint16_t with[4];     /* the arguments of the call */
    const char *words;    /* what the call writes, as "000A 0102"; NULL: nothing */
    const char *request;  /* as sim_bytes takes it; NULL: any, "": nothing is sent */
    const char *reply;    /* the same for what arrives; NULL: nothing */
    uint8_t status;       /* what the call returns */
    const char *response; /* the words that it reads; NULL: none, and they stay as they were */
    uint8_t exception;    /* the exception code of the reply */
} exchange;

typedef struct exchange_group {
    const exchange *rows;
    size_t count;
} exchange_group;

/* Each group is a test of each program that plays it. */
#define EXCHANGE_GROUPS(GROUP)                                                                     \
    GROUP(frames_are_those_of_the_specification)                                                   \
    GROUP(frames_are_those_of_the_documentation_of_another_library)                                \
    GROUP(any_state_except_zero_is_on)                                                             \
    GROUP(unused_bits_are_zero_in_both_directions)                                                 \
    GROUP(units_248_to_255_are_accepted)                                                           \
    GROUP(the_last_address_can_be_read_and_written)                                                \
    GROUP(reads_of_more_than_64_registers_are_sent)                                                \
    GROUP(only_writes_are_broadcast)                                                               \
    GROUP(exceptions_are_returned_and_those_of_no_valid_code_are_malformed)                        \
    GROUP(each_failure_has_its_status)                                                             \
    GROUP(the_most_specific_failure_is_reported)                                                   \
    GROUP(a_byte_count_that_does_not_suit_the_request_is_malformed)                                \
    GROUP(an_echo_with_another_address_or_value_is_malformed)                                      \
    GROUP(a_reply_is_found_after_noise_and_after_frames_that_are_no_answer)

#define DECLARE_GROUP(name) extern const exchange_group name##_rows;
EXCHANGE_GROUPS(DECLARE_GROUP)
#undef DECLARE_GROUP

/* The unit that the exchange is with. */
uint8_t exchange_unit(const exchange *e);

/* Converts a text such as "000A 0102" to words. Returns how many. */
uint16_t exchange_words(uint16_t *words, const char *text);

/* Calls the function of an exchange: CALL(name, arguments) calls the one of the object. */
#define EXCHANGE_CALL(e, CALL)                                                                     \
    do {                                                                                           \
        const uint16_t *w = (e)->with;                                                             \
        switch ((e)->function) {                                                                   \
        case 0x01: return CALL(readCoils, w[0], w[1]);                                             \
        case 0x02: return CALL(readDiscreteInputs, w[0], w[1]);                                    \
        case 0x03: return CALL(readHoldingRegisters, w[0], w[1]);                                  \
        case 0x04: return CALL(readInputRegisters, w[0], w[1]);                                    \
        case 0x05: return CALL(writeSingleCoil, w[0], (uint8_t)w[1]);                              \
        case 0x06: return CALL(writeSingleRegister, w[0], w[1]);                                   \
        case 0x0F: return CALL(writeMultipleCoils, w[0], w[1]);                                    \
        case 0x10: return CALL(writeMultipleRegisters, w[0], w[1]);                                \
        case 0x16: return CALL(maskWriteRegister, w[0], w[1], w[2]);                               \
        default: return CALL(readWriteMultipleRegisters, w[0], w[1], w[2], w[3]);                  \
        }                                                                                          \
    } while (0)

/* The functions whose data are bits. */
static inline int exchange_has_bits(const exchange *e)
{
    return e->function <= 0x02 || e->function == 0x0F;
}

#endif
