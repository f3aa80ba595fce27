/* The names of lines on the command line: the settings that a name leaves out. */
#include "place.h"
#include "test.h"

static place read_place(const char *text, int is_server)
{
    place p;

    assert_null(place_read(&p, text, is_server));
    return p;
}

/* Serial line guide V1.02, 2.5.1, 2.5.2 and 3.2. */
TEST(a_serial_line_has_the_settings_of_the_standard)
{
    const place rtu = read_place("rtu:/dev/ttyUSB0", 0),
                ascii = read_place("ascii:/dev/ttyUSB0", 0);

    assert_int_equal(rtu.tty.baud, 19200);
    assert_int_equal(rtu.tty.parity, 'E');
    assert_int_equal(rtu.tty.stop, 1);
    assert_int_equal(rtu.tty.data, 8);
    assert_int_equal(ascii.tty.baud, 19200);
    assert_int_equal(ascii.tty.parity, 'E');
    assert_int_equal(ascii.tty.stop, 1);
    assert_int_equal(ascii.tty.data, 7);
}

/* TCP guide V1.0b, 4.1 and 4.2.1.2. */
TEST(a_host_has_port_502_unless_another_is_named)
{
    assert_string_equal(read_place("tcp://192.168.0.7", 0).service, "502");
    assert_string_equal(read_place("tcp://192.168.0.7:1502", 0).service, "1502");
    assert_string_equal(read_place("tcp://192.168.0.7", 1).service, "502");
    assert_string_equal(read_place("tcp://:1502", 1).service, "1502");
    assert_string_equal(MBM_TCP_SERVICE, "502");
}
