/* The payloads of writes that `mbm bridge` takes: the whole payload is the number that the
 * registers then hold, or nothing is written. */
#include "payload.h"
#include "test.h"
#include "names.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>

/* Each text of a list, in which bars are between them. */
#define EACH(text, list)                                                                           \
    for (const char *rest_ = (list), *text; (text = next_text(&rest_)) != NULL;)

static const char *next_text(const char **rest)
{
    static char text[100];
    size_t length;

    if (*rest == NULL)
        return NULL;
    length = strcspn(*rest, "|");
    assert_true(length < sizeof text);
    memcpy(text, *rest, length);
    text[length] = '\0';
    *rest = (*rest)[length] == '|' ? *rest + length + 1 : NULL;
    return text;
}

static uint16_t words[VALUE_WORDS];
static const char *wrong;

static uint16_t parse_bytes(uint8_t type, const char *scale, const char *payload, size_t length)
{
    value_form form = {.type = type, .order = MBM_ORDER_ABCD};
    /* Memory that ends with the payload, so that sanitizers see each byte read beyond it. */
    char *copy = malloc(length > 0 ? length : 1);

    assert_non_null(copy);
    memcpy(copy, payload, length);
    memset(words, 0, sizeof words);
    if (scale) {
        assert_int_equal(value_scale_read(scale, &form.scale), 1);
    }
    uint16_t count = payload_parse(&form, copy, length, words, &wrong);
    free(copy);
    return count;
}

static uint16_t parse(uint8_t type, const char *scale, const char *payload)
{
    return parse_bytes(type, scale, payload, strlen(payload));
}

/* The integer in the words of the last payload. */
static uint64_t written(uint16_t count)
{
    uint64_t value = 0;

    for (uint16_t at = 0; at < count; at++)
        value = value << 16 | words[at];
    return value;
}

static void expect(uint8_t type, const char *scale, const char *payload, uint64_t value)
{
    const uint16_t count = parse(type, scale, payload);

    if (count == 0)
        fail_msg("%s: %s", payload, wrong);
    assert_null(wrong);
    if (written(count) != value)
        fail_msg("%s: %" PRIx64 " is written, not %" PRIx64, payload, written(count), value);
}

static void expect_refused(uint8_t type, const char *scale, const char *payload, const char *reason)
{
    if (parse(type, scale, payload) != 0)
        fail_msg("type %d: %s is taken", type, payload);
    assert_non_null(strstr(wrong, reason));
}

/* Every type refuses these; with a byte order mark, a space that does not break and a digit that is
 * not of ASCII among them. */
static const char NO_NUMBERS[] =
    "21,5|0x10|12abc|5 6 7|1x|x1|+5|.5|5.|05|-|--1|- 1|1e|1e+|1.e5|1e5.0|1_000|1,000|1'000|0b1|"
    "0o7|1f|1.0f|1L|NaN|nan|Inf|inf|-inf|Infinity|-Infinity|null|hot|\"5\"|[5]|[]|{}|5;|5\n6|"
    "\357\273\2775|\302\2405|\xd9\xa5|1\v|\f1| |\n|truetrue|ONOFF|ON 1|on,off|On|True|TRUE|"
    "truex|yes|{\"value\":9}}garbage|{\"value\":9}}|{\"value\":9} 9|{\"value\":9}{\"value\":9}|"
    "{\"value\":9|{\"value\":9,}|{,\"value\":9}|{\"value\":9 9}|{\"value\" 9}|{\"value\":}|"
    "{value:9}|{'value':9}|{\"Value\":9}|{\"values\":9}|{\"val\":9}|{\"value\":\"9\"}|"
    "{\"value\":null}|{\"value\":[9]}|{\"value\":{\"value\":9}}|{\"value\":0x9}|{\"value\":09}|"
    "{\"value\":+9}|{\"value\":9.}|{\"value\":9,5}|{\"value\":9x}|{\"value\":NaN}|"
    "{\"value\":ON}|{\"value\":9,\"value\":9}|{\"value\":9,\"value\":8}|{\"v\\u0061lue\":9}|"
    "{\"value\":9,\"v\\u0061lue\":8}|{\"a\":{\"value\":9}}|{\"a\":\"\\x\",\"value\":9}|"
    "{\"a\":\"\\u12g4\",\"value\":9}|{\"a\":\"\n\",\"value\":9}|{\"a\":truth,\"value\":9}|"
    "{\"a\":[1,],\"value\":9}|{\"a\":[1}],\"value\":9}|{\"a\":\"b,\"value\":9}|[{\"value\":9}]|"
    "{\"value\":9}\\|// 5|5 /* 5 */";

TEST(a_payload_that_is_no_number_as_a_whole_is_refused)
{
    EACH(payload, NO_NUMBERS)
    for (uint8_t type = MBM_TYPE_BIT; type <= MBM_TYPE_DOUBLE; type++)
        expect_refused(type, NULL, payload, "no number");
}

TEST(bytes_after_a_zero_byte_are_not_overlooked)
{
    static const struct {
        const char *payload;
        size_t length;
    } rows[] = {
        {"5\0", 2},
        {"5\0garbage", 9},
        {"\0", 1},
        {"\0005", 2},
        {"ON\0", 3},
        {"{\"value\":9}\0", 12},
        {"{\"value\":9\0}", 12},
        {"{\"value\0\":9}", 12},
        {"{\"a\":\"\\\0\",\"value\":9}", 20},
        {"{\"a\":\"\\u000\0\",\"value\":9}", 24},
    };

    for (unsigned i = 0; i < COUNT(rows); i++) {
        assert_int_equal(parse_bytes(MBM_TYPE_UINT16, NULL, rows[i].payload, rows[i].length), 0);
        assert_int_equal(parse_bytes(MBM_TYPE_BIT, NULL, rows[i].payload, rows[i].length), 0);
    }
    assert_int_equal(parse_bytes(MBM_TYPE_UINT16, NULL, "", 0), 0);
}

TEST(a_payload_ends_where_its_length_says)
{
    assert_int_equal(parse_bytes(MBM_TYPE_UINT16, NULL, "1234", 2), 1);
    assert_int_equal(words[0], 12);
    assert_int_equal(parse_bytes(MBM_TYPE_UINT16, NULL, "{\"value\":12}", 11), 0);
}

TEST(json_may_have_space_and_other_members)
{
    static const char rows[] =
        "9| 9|9\n|\r\n9\t |{\"value\":9}| { \"value\" : 9 } \n|{\"unit\":\"V\",\"value\":9}|"
        "{\"value\":9,\"status\":\"success\",\"time\":null}|"
        "{\"a\":{\"value\":1,\"b\":[1,-2.5e3,{}]},\"value\":9}|"
        "{\"a\":\"\\\"}\\u00e9\",\"value\":9}|"
        "{\"a\":[],\"b\":[[],\"\"],\"c\":true,\"d\":false,\"value\":9}|9.0|0.9e1|90e-1|"
        "9.000000000000000000000000000000000000|0.00000000000000000000000000000009e32";

    EACH(payload, rows)
    expect(MBM_TYPE_UINT16, NULL, payload, 9);
}

TEST(integers_of_64_bits_are_exact)
{
    static const char *const forms[] = {"%s", "{\"value\":%s}", "%s.0", "%se0", "%s0e-1"};
    static const struct {
        uint8_t type;
        const char *text;
        uint64_t value;
    } rows[] = {
        {MBM_TYPE_UINT64, "9007199254740993", 9007199254740993u},
        {MBM_TYPE_INT64, "9007199254740993", 9007199254740993u},
        {MBM_TYPE_INT64, "-9007199254740993", 0 - (uint64_t)9007199254740993u},
        {MBM_TYPE_UINT64, "18446744073709551615", UINT64_MAX},
        {MBM_TYPE_INT64, "9223372036854775807", INT64_MAX},
        {MBM_TYPE_INT64, "-9223372036854775808", (uint64_t)INT64_MAX + 1},
    };
    char payload[64];

    for (unsigned i = 0; i < COUNT(rows); i++)
        for (unsigned form = 0; form < COUNT(forms); form++) {
            snprintf(payload, sizeof payload, forms[form], rows[i].text);
            expect(rows[i].type, NULL, payload, rows[i].value);
        }
}

TEST(every_integer_of_a_type_is_taken_and_none_beyond)
{
    static const struct {
        uint8_t type;
        const char *least, *below, *most, *above;
    } rows[] = {
        {MBM_TYPE_BIT, "0", "-1", "1", "2"},
        {MBM_TYPE_UINT16, "0", "-1", "65535", "65536"},
        {MBM_TYPE_INT16, "-32768", "-32769", "32767", "32768"},
        {MBM_TYPE_UINT32, "0", "-1", "4294967295", "4294967296"},
        {MBM_TYPE_INT32, "-2147483648", "-2147483649", "2147483647", "2147483648"},
        {MBM_TYPE_UINT64, "-0", "-1", "18446744073709551615", "18446744073709551616"},
        {MBM_TYPE_INT64, "-9223372036854775808", "-9223372036854775809", "9223372036854775807",
         "9223372036854775808"},
    };
    static const char far[] =
        "1e20|1e38|1e39|1e308|1e309|1e99999|1e2147483648|1e9223372036854775808|"
        "1e18446744073709551616|1e99999999999999999999999999999999999|"
        "99999999999999999999999999999999999999999999999999999999999999999999999999|"
        "18446744073709551617|36893488147419103233|340282366920938463463374607431768211457";
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const uint16_t count = parse(rows[i].type, NULL, rows[i].least);

        assert_int_equal(count, parse(rows[i].type, NULL, rows[i].most));
        assert_int_not_equal(count, 0);
        expect_refused(rows[i].type, NULL, rows[i].below, "out of range");
        expect_refused(rows[i].type, NULL, rows[i].above, "out of range");
        EACH(payload, far)
        expect_refused(rows[i].type, NULL, payload, "out of range");
    }
    expect(MBM_TYPE_INT16, NULL, "-1", 0xFFFF);
    expect(MBM_TYPE_INT16, NULL, "-32768", 0x8000);
    expect(MBM_TYPE_INT32, NULL, "-2", 0xFFFFFFFE);
    expect(MBM_TYPE_UINT16, NULL, "0e99999999999999999999", 0);
    expect(MBM_TYPE_UINT16, NULL, "-0.0", 0);
}

TEST(a_fraction_for_an_integer_is_refused_and_not_rounded)
{
    static const char rows[] =
        "0.5|1.5|-0.4|1.0000000000000000000000000000000000000000000000001|15e-1|"
        "0.99999999999999999999|1e-1|1e-99999|1e-99999999999999999999999999|{\"value\":1.5}|"
        "65535.5|18446744073709551615.5";

    EACH(payload, rows)
    for (uint8_t type = MBM_TYPE_BIT; type <= MBM_TYPE_INT64; type++)
        expect_refused(type, NULL, payload, "not a whole number");
}

TEST(a_scaled_number_is_a_multiple_of_the_scale_in_decimal)
{
    expect(MBM_TYPE_UINT16, "0.1", "12.3", 123);
    expect(MBM_TYPE_UINT16, "0.1", "{\"value\":6553.5}", 65535);
    expect(MBM_TYPE_UINT16, "0.1", "0.30", 3);
    expect(MBM_TYPE_INT16, "-0.1", "12.3", (uint16_t)-123);
    expect(MBM_TYPE_INT16, "-0.1", "-12.3", 123);
    expect(MBM_TYPE_UINT16, "0.25", "0.75", 3);
    expect(MBM_TYPE_UINT16, "0.25", "1.5", 6);
    expect(MBM_TYPE_UINT16, "25e-2", "1e1", 40);
    expect(MBM_TYPE_UINT16, "10", "120", 12);
    expect(MBM_TYPE_UINT16, "0.333333", "2.333331", 7);
    expect(MBM_TYPE_UINT64, "0.001", "18446744073709551.615", UINT64_MAX);
    expect(MBM_TYPE_INT64, "0.1", "-922337203685477580.8", (uint64_t)INT64_MAX + 1);
    expect(MBM_TYPE_UINT64, "0.123456789012345678", "0.370370367037037034", 3);
    expect(MBM_TYPE_UINT64, "0.999999999999999999", "18446744073709551596.553255926290448385",
           18446744073709551615u);
    expect_refused(MBM_TYPE_UINT16, "0.1", "12.34", "multiple of the scale");
    expect_refused(MBM_TYPE_UINT16, "0.1", "0.05", "multiple of the scale");
    expect_refused(MBM_TYPE_UINT16, "0.25", "0.3", "multiple of the scale");
    expect_refused(MBM_TYPE_UINT16, "10", "125", "multiple of the scale");
    expect_refused(MBM_TYPE_UINT16, "3", "10", "multiple of the scale");
    expect_refused(MBM_TYPE_UINT16, "0.1", "6553.6", "out of range");
    expect_refused(MBM_TYPE_UINT16, "0.1", "-0.1", "out of range");
    expect_refused(MBM_TYPE_UINT16, "-0.1", "0.1", "out of range");
    expect_refused(MBM_TYPE_UINT64, "0.001", "18446744073709551.616", "out of range");
    expect_refused(MBM_TYPE_UINT16, "1e-300", "1e300", "out of range");
    expect_refused(MBM_TYPE_UINT16, "1e300", "1e-300", "multiple of the scale");
}

TEST(what_a_scaled_integer_is_published_as_can_be_written_back)
{
    static const char *const scales[] = {"0.1",  "0.01", "0.001", "1e-4", "0.5",     "0.25",
                                         "-0.1", "7",    "10",    "1000", "0.333333"};
    char payload[64];

    for (unsigned i = 0; i < COUNT(scales); i++)
        for (unsigned raw = 0; raw <= UINT16_MAX; raw += 1 + raw % 7) {
            /* As a scaled value is published. */
            snprintf(payload, sizeof payload, "%.15g", (double)raw * strtod(scales[i], NULL));
            expect(MBM_TYPE_UINT16, scales[i], payload, raw);
        }
}

TEST(a_scale_is_a_decimal_number)
{
    static const char bad[] =
        "|0|-0.0|0x1|0x1p-3|nan|inf|1e400|1e-400|1,5|1 | 1|1x|+1|.1|1.|1234567890123456789|"
        "0.1234567890123456789";
    value_scale scale;

    EACH(text, bad)
    if (value_scale_read(text, &scale))
        fail_msg("%s is taken", text);
    assert_int_equal(value_scale_read("-12.50", &scale), 1);
    assert_int_equal(scale.digits, 125);
    assert_int_equal(scale.exponent, -1);
    assert_int_equal(scale.is_negative, 1);
    assert_true(scale.value == -12.5);
}

static float float_of_words(void)
{
    const uint32_t bits = (uint32_t)words[0] << 16 | words[1];
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

static double double_of_words(void)
{
    const uint64_t bits = written(4);
    double value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

TEST(a_float_gets_the_nearest_number_or_none)
{
    assert_int_equal(parse(MBM_TYPE_FLOAT, NULL, "21.5"), 2);
    assert_true(float_of_words() == 21.5f);
    assert_int_equal(parse(MBM_TYPE_FLOAT, NULL, "0.1"), 2);
    assert_true(float_of_words() == 0.1f);
    /* Just above the middle of two floats, but as a double exactly in the middle. */
    assert_int_equal(parse(MBM_TYPE_FLOAT, NULL, "1.00000017881393432617187500001"), 2);
    assert_true(float_of_words() == 1.00000023841857910156f);
    assert_int_equal(parse(MBM_TYPE_FLOAT, NULL, "3.4028234663852886e38"), 2);
    assert_true(float_of_words() == FLT_MAX);
    assert_int_equal(parse(MBM_TYPE_FLOAT, NULL, "-1e-45"), 2);
    assert_true(float_of_words() < 0);
    assert_int_equal(parse(MBM_TYPE_FLOAT, NULL, "0e5"), 2);
    assert_true(float_of_words() == 0);
    assert_int_equal(parse(MBM_TYPE_FLOAT, "0.1", "12.5"), 2);
    assert_true(float_of_words() == 125.0f);
    assert_int_equal(parse(MBM_TYPE_DOUBLE, NULL, "0.1"), 4);
    assert_true(double_of_words() == 0.1);
    assert_int_equal(parse(MBM_TYPE_DOUBLE, NULL, "9007199254740992"), 4);
    assert_true(double_of_words() == 9007199254740992.0);
    expect_refused(MBM_TYPE_FLOAT, NULL, "3.5e38", "out of range");
    expect_refused(MBM_TYPE_FLOAT, NULL, "-1e39", "out of range");
    expect_refused(MBM_TYPE_FLOAT, NULL, "1e-46", "out of range");
    expect_refused(MBM_TYPE_FLOAT, "0.001", "1e36", "out of range");
    expect_refused(MBM_TYPE_DOUBLE, NULL, "1e309", "out of range");
    expect_refused(MBM_TYPE_DOUBLE, NULL, "1e-400", "out of range");
    expect_refused(MBM_TYPE_DOUBLE, "1e-300", "1e300", "out of range");
}

TEST(only_a_bit_takes_a_truth_value)
{
    static const char *const on[] = {"true",  "on",           "ON", "1", "1.0", "{\"value\":true}",
                                     " ON\n", "{\"value\":1}"};
    static const char *const off[] = {
        "false", "off", "OFF", "0", "-0", "{\"value\":false}", "{\"value\":0.0}"};

    for (unsigned i = 0; i < COUNT(on); i++)
        expect(MBM_TYPE_BIT, NULL, on[i], 1);
    for (unsigned i = 0; i < COUNT(off); i++)
        expect(MBM_TYPE_BIT, NULL, off[i], 0);
    for (uint8_t type = MBM_TYPE_UINT16; type <= MBM_TYPE_DOUBLE; type++) {
        expect_refused(type, NULL, "true", "no number");
        expect_refused(type, NULL, "ON", "no number");
        expect_refused(type, NULL, "{\"value\":false}", "no number");
    }
}

TEST(the_longest_payload_is_read_and_a_longer_one_is_refused)
{
    char payload[PAYLOAD_BYTES + 2];

    memset(payload, '0', sizeof payload);
    payload[1] = '.';
    payload[sizeof payload - 1] = '\0';
    expect_refused(MBM_TYPE_UINT16, NULL, payload, "too long");
    payload[PAYLOAD_BYTES] = '\0';
    expect(MBM_TYPE_UINT16, NULL, payload, 0);
    memset(payload, '9', PAYLOAD_BYTES);
    expect_refused(MBM_TYPE_UINT64, NULL, payload, "out of range");
    payload[1] = '.';
    assert_int_equal(parse(MBM_TYPE_DOUBLE, NULL, payload), 4);
    memset(payload, '[', PAYLOAD_BYTES);
    memcpy(payload, "{\"a\":", 5);
    expect_refused(MBM_TYPE_UINT16, NULL, payload, "no number");
}

/* --- texts and several values --- */

static uint16_t all[PAYLOAD_WORDS];

static uint16_t parse_all(uint8_t type, uint16_t count, const char *payload, size_t length)
{
    const value_form form = {.type = type, .order = MBM_ORDER_ABCD};
    char *copy = malloc(length > 0 ? length : 1);

    assert_non_null(copy);
    memcpy(copy, payload, length);
    memset(all, 0xEE, sizeof all);
    uint16_t words_used = payload_parse_all(&form, count, copy, length, all, &wrong);
    free(copy);
    return words_used;
}

static void expect_text(const char *payload, const char *latin)
{
    char found[9] = "";

    if (parse_all(MBM_TYPE_TEXT, 8, payload, strlen(payload)) != 4)
        fail_msg("%s: %s", payload, wrong);
    for (int i = 0; i < 8; i++)
        found[i] = (char)(all[i / 2] >> (i % 2 ? 0 : 8));
    assert_string_equal(found, latin);
    assert_int_equal(all[4], 0xEEEE);
}

TEST(a_text_is_the_payload_or_a_json_string)
{
    expect_text("pump", "pump");
    expect_text("pump no1", "pump no1");
    expect_text(" a b ", " a b ");
    expect_text("12", "12");
    expect_text("citr\303\251", "citr\351");
    expect_text("\"\"", "");
    expect_text("\"pump\"", "pump");
    expect_text("\"a\\\"\\\\\\/\\n\"", "a\"\\/\n");
    expect_text("\"citr\\u00e9\"", "citr\351");
    expect_text("{\"value\":\"pump\"}", "pump");
    expect_text("{ \"by\": 1, \"value\" : \"\\u0041\" }", "A");
}

static void expect_wrong(uint8_t type, uint16_t count, const char *payload, const char *reason)
{
    if (parse_all(type, count, payload, strlen(payload)) != 0)
        fail_msg("%s is taken", payload);
    if (!strstr(wrong, reason))
        fail_msg("%s: %s, and not: %s", payload, wrong, reason);
}

TEST(a_text_that_does_not_fit_is_refused)
{
    static char longest[PAYLOAD_LONGEST + 2];

    expect_wrong(MBM_TYPE_TEXT, 8, "123456789", "longer than the field");
    expect_wrong(MBM_TYPE_TEXT, 8, "\342\202\254", "not in Latin-1");
    expect_wrong(MBM_TYPE_TEXT, 8, "\"\\u20ac\"", "not in Latin-1");
    expect_wrong(MBM_TYPE_TEXT, 8, "\"\\u0000\"", "NUL");
    expect_wrong(MBM_TYPE_TEXT, 8, "\303", "not in Latin-1");
    expect_wrong(MBM_TYPE_TEXT, 8, "\"pump", "no text");
    expect_wrong(MBM_TYPE_TEXT, 8, "\"pump\"x", "no text");
    expect_wrong(MBM_TYPE_TEXT, 8, "{\"value\":5}", "no text");
    expect_wrong(MBM_TYPE_TEXT, 8, "{\"other\":\"a\"}", "no text");
    assert_int_equal(parse_all(MBM_TYPE_TEXT, 8, "a\0b", 3), 0);
    assert_int_equal(parse_all(MBM_TYPE_TEXT, 8, "", 0), 0);
    memset(longest, 'a', sizeof longest - 1);
    expect_wrong(MBM_TYPE_TEXT, 8, longest, "too long");
}

TEST(several_values_are_all_written)
{
    static const char *const right[] = {"1,2,3", "[1,2,3]", " [ 1 , 2 ,3 ] ", "1, 2, 3\n",
                                        "{\"value\":[1,2,3]}"};
    static const char *const bits[] = {"1,0,1", "[true,false,true]", "ON,OFF,ON",
                                       "{\"value\":[1,false,1]}"};

    for (unsigned i = 0; i < COUNT(right); i++) {
        if (parse_all(MBM_TYPE_UINT16, 3, right[i], strlen(right[i])) != 3)
            fail_msg("%s: %s", right[i], wrong);
        assert_int_equal(all[0] * 100 + all[1] * 10 + all[2], 123);
        assert_int_equal(parse_all(MBM_TYPE_UINT32, 3, right[i], strlen(right[i])), 6);
        assert_int_equal(all[1] * 100 + all[3] * 10 + all[5], 123);
    }
    for (unsigned i = 0; i < COUNT(bits); i++) {
        if (parse_all(MBM_TYPE_BIT, 3, bits[i], strlen(bits[i])) != 3)
            fail_msg("%s: %s", bits[i], wrong);
        assert_int_equal(all[0] * 100 + all[1] * 10 + all[2], 101);
    }
}

TEST(a_list_with_one_wrong_value_is_refused)
{
    static const char wrongs[] =
        "|1|1,2|1,2,3,4|1,2,|1,,3|,1,2|[1,2,3|1,2,3]|[1,2,3],4|[[1,2,3]]|1 2 3|1;2;3|[1,2,3]x|"
        "{\"value\":1}|[]|{\"other\":[1,2,3]}|[{\"value\":1},2,3]";

    EACH(payload, wrongs)
    if (parse_all(MBM_TYPE_UINT16, 3, payload, strlen(payload)) != 0)
        fail_msg("%s is taken", payload);
    expect_wrong(MBM_TYPE_UINT16, 3, "1,65536,3", "value 2: the number is out of range");
    expect_wrong(MBM_TYPE_UINT16, 3, "1,2", "no list of 3 values");
    expect_wrong(MBM_TYPE_BIT, 3, "1,0,2", "value 3");
}

static uint64_t random_state = 0x9E3779B97F4A7C15u;

static uint64_t next_random(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

TEST(random_integers_are_written_exactly)
{
    char payload[80];

    for (unsigned i = 0; i < 20000; i++) {
        const uint64_t value = next_random() >> next_random() % 64;
        const unsigned decimals = (unsigned)(next_random() % 6);
        char digits[32], scale[16];

        snprintf(payload, sizeof payload, i % 2 ? "%" PRIu64 : "{\"value\":%" PRIu64 "}", value);
        expect(MBM_TYPE_UINT64, NULL, payload, value);
        snprintf(payload, sizeof payload, i % 2 ? "%" PRId64 : "{\"value\":%" PRId64 "}",
                 (int64_t)value);
        expect(MBM_TYPE_INT64, NULL, payload, value);
        /* The same digits with a point in front of the last ones. */
        snprintf(digits, sizeof digits, "%06" PRIu64, value);
        snprintf(scale, sizeof scale, "1e-%u", decimals);
        snprintf(payload, sizeof payload, "%" PRIu64 "%s%s",
                 decimals ? value / (uint64_t)llround(pow(10, decimals)) : value,
                 decimals ? "." : "", digits + strlen(digits) - decimals);
        expect(MBM_TYPE_UINT64, scale, payload, value);
    }
}

/* Any bytes: if the payload is taken as a number, strtod takes all of it too, and the same number
 * is written. */
TEST(random_bytes_are_numbers_or_refused)
{
    static const char BYTES[] = "0123456789.-+eE {}[]\":,valuex\\\n\0truefsON";
    char payload[24];
    unsigned i, taken = 0;

    for (i = 0; i < 400000; i++) {
        const size_t length = next_random() % 7;
        char *end;
        size_t at;

        for (at = 0; at < length; at++)
            payload[at] = BYTES[next_random() % (next_random() % 2 ? 15 : sizeof BYTES)];
        payload[length] = '\0';
        if (parse_bytes(MBM_TYPE_INT16, NULL, payload, length) == 0)
            continue;
        taken++;
        assert_true(strtod(payload, &end) == (double)(int16_t)words[0]);
        while (end < payload + length && strchr(" \n", *end))
            end++;
        assert_ptr_equal(end, payload + length);
        assert_null(strpbrk(payload, "xX,"));
    }
    assert_true(taken > 1000);
}

/* --- what the names of fields become in topics and identifiers, by the rule of docs/device-file.md
 * --- */

static void expect_topic(const char *name, const char *wanted)
{
    char *topic = names_topic(name);

    assert_string_equal(topic, wanted);
    free(topic);
}

static void expect_identifier(const char *name, const char *wanted)
{
    char *identifier = names_identifier(name);

    assert_string_equal(identifier, wanted);
    free(identifier);
}

TEST(a_name_without_signs_of_topics_is_its_topic)
{
    expect_topic("voltage", "voltage");
    expect_topic("Pump-1/runs", "Pump-1/runs");
    expect_topic("a//b/", "a//b/");
    expect_topic("Zähler", "Zähler");
    expect_topic("unit/status", "unit/status");
    expect_topic("status/unit", "status/unit");
    expect_topic("reset", "reset");
}

TEST(a_run_of_spaces_and_signs_of_topics_becomes_one_underscore)
{
    expect_topic("voltage L1", "voltage_L1");
    expect_topic("energy +", "energy_");
    expect_topic(" a  # b", "_a_b");
    expect_topic("pump / runs", "pump_/_runs");
    expect_topic("/a", "_a");
    expect_topic("//a", "_/a");
    expect_topic(" /a", "_/a");
}

TEST(a_name_that_is_a_topic_of_the_bridge_gets_an_underscore_more)
{
    expect_topic("status", "status_");
    expect_topic("set", "set_");
    expect_topic("pump/set", "pump/set_");
    expect_topic("pump/result", "pump/result_");
    expect_topic("unit/17/status", "unit/17/status_");
    expect_topic("pump/status", "pump/status");
}

TEST(an_identifier_has_small_letters_digits_and_single_underscores)
{
    expect_identifier("voltage", "voltage");
    expect_identifier("Voltage L1-N", "voltage_l1_n");
    expect_identifier("pump/runs", "pump_runs");
    expect_identifier("__a__b__", "a_b");
    expect_identifier("CO2 (ppm)", "co2_ppm");
    expect_identifier("2nd", "2nd");
    expect_identifier("%", "");
    expect_identifier("°", "");
}

TEST(letters_beyond_ascii_lose_their_accents_or_become_their_numbers)
{
    expect_identifier("Zähler Außen", "zahler_ausen");
    expect_identifier("Za\xCC\x88hler", "zahler");
    expect_identifier("Napětí fáze", "napeti_faze");
    expect_identifier("a×b÷c", "a_b_c");
    expect_identifier("温度 1", "u6e29u5ea6_1");
    expect_identifier("T²–Ω₂", "t_u3a9");
    expect_identifier("\xF0\x9F\x94\x8B", "u1f50b");
}
