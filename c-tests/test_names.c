/* What the names of fields become in topics and identifiers, by the rule of docs/device-file.md. */
#include "names.h"
#include "test.h"

#include <stdlib.h>

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
