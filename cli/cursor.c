#include "cursor.h"

int cursor_is_digit(const cursor *in)
{
    return in->at < in->end && *in->at >= '0' && *in->at <= '9';
}

int cursor_skip_char(cursor *in, char one)
{
    if (in->at == in->end || *in->at != one)
        return 0;
    in->at++;
    return 1;
}

static int skip_digits(cursor *in)
{
    if (!cursor_is_digit(in))
        return 0;
    while (cursor_is_digit(in))
        in->at++;
    return 1;
}

int cursor_skip_number(cursor *in)
{
    (void)cursor_skip_char(in, '-');
    if (!cursor_skip_char(in, '0') && !skip_digits(in))
        return 0;
    if (cursor_skip_char(in, '.') && !skip_digits(in))
        return 0;
    if (!cursor_skip_char(in, 'e') && !cursor_skip_char(in, 'E'))
        return 1;
    if (!cursor_skip_char(in, '-'))
        (void)cursor_skip_char(in, '+');
    return skip_digits(in);
}
