/* The exchanges of support/exchanges.c, played by a node and by a client of a serial line. */
#include "exchanges.h"
#include "sim.h"
#include "test.h"

enum { UNTOUCHED = 0xEEEE };

static mbm_client client;
static mbm_clientRequest request;
static uint16_t sent[MBM_MAX_WRITE_REGISTERS], received[MBM_MAX_READ_REGISTERS];

static uint8_t node_calls(mbm_node *n, const exchange *e)
{
#define NODE(name, ...) mbm_node_##name(n, __VA_ARGS__)
    EXCHANGE_CALL(e, NODE);
}

static uint8_t client_calls(const exchange *e)
{
#define CLIENT(name, ...) mbm_client_##name(&client, &request, __VA_ARGS__)
    EXCHANGE_CALL(e, CLIENT);
}

static uint8_t client_ends(sim *s, const exchange *e)
{
    uint8_t status;

    request = (mbm_clientRequest){
        .unit = exchange_unit(e), .data = sent, .reply = received, .replyBytes = sizeof received};
    status = client_calls(e);
    while (status == MBM_PENDING && mbm_client_poll(&client) == MBM_PENDING)
        s->now += s->idle_step;
    return status == MBM_PENDING ? request.status : status;
}

/* Plays a row. `words` are what the call has read. */
static void play_row(sim *s, int has_client, const exchange *e, const uint16_t *words)
{
    uint16_t wanted[MBM_MAX_READ_REGISTERS];
    const uint16_t count = exchange_words(wanted, e->response);
    const unsigned before = s->sent;

    (void)exchange_words(sent, e->words);
    memset(received, UNTOUCHED & 0xFF, sizeof received);
    memset(s->response, UNTOUCHED & 0xFF, sizeof s->response);
    if (e->reply)
        sim_answer(s, 1, 500, e->reply);
    if (has_client) {
        IS(e->status, client_ends(s, e));
        assert_int_equal(request.exception, e->exception);
    } else {
        const uint16_t before_it = mbm_node_getResponseBuffer(&s->node, 0);

        OK(mbm_node_clearTransmitBuffer(&s->node));
        for (uint8_t i = 0; i < MBM_MAX_WRITE_REGISTERS; i++)
            OK(mbm_node_setTransmitBuffer(&s->node, i, sent[i]));
        OK(mbm_node_setSlaveID(&s->node, exchange_unit(e)));
        IS(e->status, node_calls(&s->node, e));
        IS(e->status, mbm_node_status(&s->node));
        assert_int_equal(mbm_node_getExceptionCode(&s->node), e->exception);
        if (e->response)
            assert_int_equal(mbm_node_available(&s->node), count);
        else
            assert_int_equal(mbm_node_getResponseBuffer(&s->node, 0), before_it);
        for (uint8_t i = 0; i < count; i++)
            assert_int_equal(mbm_node_getResponseBuffer(&s->node, i), wanted[i]);
    }
    if (e->request && !e->request[0])
        assert_int_equal(s->sent, before);
    else
        assert_int_equal(s->sent, before + 1);
    if (e->request && e->request[0])
        sim_assert_sent(s, before, e->request);
    for (uint16_t i = 0; i < count; i++) {
        const uint8_t *bytes = (const uint8_t *)(words + i);
        const unsigned last = e->function <= 0x02 ? (e->with[1] + 7u) / 8u : 2u * count;

        /* A client stores the bytes of bits. It leaves half of a word that they do not fill. */
        assert_int_equal(bytes[0] | (2u * i + 1 < last ? bytes[1] << 8 : wanted[i] & 0xFF00),
                         wanted[i]);
    }
    assert_int_equal(words[count], UNTOUCHED);
}

static void play(const exchange_group *group)
{
    static const exchange next = {3, {0, 1}, NULL, NULL, "11 03 02 00 2A +", MBM_OK, "002A", 0};
    sim *s = sim_of_test();

    OK(mbm_line_setQuietTime(&s->line, 0));
    OK(mbm_node_setResponseTimeout(&s->node, 100));
    memset(&client, 0, sizeof client);
    OK(mbm_client_beginRtu(&client, &s->port, s->buffer, sizeof s->buffer));
    OK(mbm_client_setQuietTime(&client, 0));
    OK(mbm_client_setResponseTimeout(&client, 100));
    for (int has_client = 0; has_client < 2; has_client++)
        for (size_t i = 0; i < group->count; i++) {
            s->answered = 0;
            play_row(s, has_client, &group->rows[i], has_client ? received : s->response);
            /* Nothing of it spoils the next request. */
            play_row(s, has_client, &next, has_client ? received : s->response);
        }
}

#define PLAYED(name) TEST_ROW_WITH(name, sim_setup, sim_teardown, play(&name##_rows))
PLAYED(frames_are_those_of_the_specification)
PLAYED(frames_are_those_of_the_documentation_of_another_library)
PLAYED(any_state_except_zero_is_on)
PLAYED(unused_bits_are_zero_in_both_directions)
PLAYED(units_248_to_255_are_accepted)
PLAYED(the_last_address_can_be_read_and_written)
PLAYED(reads_of_more_than_64_registers_are_sent)
PLAYED(only_writes_are_broadcast)
PLAYED(exceptions_are_returned_and_those_of_no_valid_code_are_malformed)
PLAYED(each_failure_has_its_status)
PLAYED(the_most_specific_failure_is_reported)
PLAYED(a_byte_count_that_does_not_suit_the_request_is_malformed)
PLAYED(an_echo_with_another_address_or_value_is_malformed)
PLAYED(a_reply_is_found_after_noise_and_after_frames_that_are_no_answer)
