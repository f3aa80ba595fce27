/* The ports of the classes in the test kit for ports, on a simulated Mega whose TX1 is wired to
 * its RX1: the bytes take their time, and the driver's pin is read back. */
#include "sketch.h"
#include "test.h"

#include <stdio.h>

enum { LONGEST = 60000 /* ms */ };

TEST(the_ports_of_the_classes_pass)
{
    static printed_text printed;
    board *b = kind_start(&mega, "TestPorts");
    uint16_t ended = board_symbol(b, "ended");

    board_uart(b, '0', collect_text, &printed);
    board_loop(b, '1');
    for (unsigned ms = 0; ms < LONGEST && board_byte(b, ended) == 0; ms += 500)
        assert_true(board_run(b, 500ull * MS));
    /* print_message cuts a text of more than 1024 characters, and its last line with it. */
    puts(printed.text);
    assert_int_equal(board_byte(b, ended), 1);
    board_free(b);
}
