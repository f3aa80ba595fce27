/* How the options of a terminal become settings, without opening a terminal. */
#define _DEFAULT_SOURCE
#include "mbm_tty.h"
#include "test.h"

#include <string.h>

TEST(parity_stop_and_data_bits_become_settings)
{
    static const struct {
        char parity;
        uint8_t stop, data;
        tcflag_t flags;
    } rows[] = {
        {'N', 1, 8, CS8},          {'N', 2, 8, CS8 | CSTOPB},
        {'E', 1, 0, CS8 | PARENB}, {'O', 1, 8, CS8 | PARENB | PARODD},
        {'E', 1, 7, CS7 | PARENB}, {'O', 2, 7, CS7 | PARENB | PARODD | CSTOPB},
    };
    const tcflag_t all = CSIZE | PARENB | PARODD | CSTOPB | CRTSCTS | HUPCL | CLOCAL | CREAD;

    for (size_t i = 0; i < COUNT(rows); i++) {
        mbm_tty_options options = {.baud = 9600};
        struct termios settings;

        memset(&settings, 0xFF, sizeof settings);
        options.parity = rows[i].parity;
        options.stop = rows[i].stop;
        options.data = rows[i].data;
        assert_int_equal(mbm_tty_settings(&settings, &options), 0);
        assert_int_equal(settings.c_cflag & all, rows[i].flags | CLOCAL | CREAD);
        assert_int_equal(settings.c_iflag & (INPCK | IXON | IXOFF | ISTRIP | ICRNL), 0);
        assert_int_equal(settings.c_lflag & (ICANON | ECHO | ISIG), 0);
        assert_int_equal(settings.c_cc[VMIN], 1);
        assert_int_equal(cfgetospeed(&settings), B9600);
        assert_int_equal(cfgetispeed(&settings), B9600);
    }
}
