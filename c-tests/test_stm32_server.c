/* A server over the port for STM32, on a chip that is played. scripts/check/real_stm32.py runs the
 * tests with ST's HAL. */
#include "crc.h"
#include "machine.h"
#include "served_unit.h"
#include "test.h"

TEST(a_server_answers_at_every_position_and_from_a_main_loop_that_is_late)
{
    for (uint8_t byDma = 0; byDma < 2; byDma++) {
        served_unit_start(byDma, 100);
        for (unsigned round = 0; round < 200; round++) {
            uint8_t request[8] = {UNIT, 6, 0, 105, (uint8_t)(round >> 8), (uint8_t)round};
            unsigned sent = m.sentCount;

            seal(request, 6);
            machine_receive(request, 8, 0);
            served_unit_sends(8, 40, round % 2 ? 100 : 3000);
            assert_memory_equal(m.sent + sent, request, 8);
            assert_int_equal(cells[5], round);
            machine_run(3000);
            mbm_server_poll(&server);
        }
        uart_is_quiet();
        assert_int_equal(mbm_stm32_lost(&uart), 0);
    }
}

TEST(a_server_answers_a_request_that_follows_disturbed_characters)
{
    static const unsigned kinds[] = {FRAMING, NOISE, PARITY};

    for (uint8_t byDma = 0; byDma < 2; byDma++) {
        served_unit_start(byDma, 100);
        for (unsigned round = 0; round < 60; round++) {
            uint8_t request[8] = {UNIT, 6, 0, 105, 0, (uint8_t)round};

            seal(request, 6);
            /* The master's driver goes on, and disturbs the line. */
            machine_receive_faulty(0, kinds[round % 3]);
            machine_receive(request, 8, 0);
            served_unit_sends(8, 20, 2500);
            machine_run(5000);
            mbm_server_poll(&server);
        }
    }
}
