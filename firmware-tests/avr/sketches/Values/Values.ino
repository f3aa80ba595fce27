// How this compiler passes values to the archive: by value, by pointer, and as a double of
// 32 bits. Prints which line is wrong, or that none is.
#include <ModbusMaster.h>
#include <string.h>

static bool wrong = false;

#define CHECK(condition)        \
  do {                          \
    if (!(condition)) {         \
      wrong = true;             \
      Serial.println(__LINE__); \
    }                           \
  } while (0)

static volatile uint32_t four = 2923517522; // volatile: not known at compile time

static void numbers() {
  uint16_t words[4];
  mbm_registers view;
  uint32_t number;
  uint64_t wide = 0x0102030405060708ULL;
  int16_t small;

  CHECK(mbm_registers_intoWords(&view, words, 4, 100) == MBM_OK);
  CHECK(mbm_registers_setUint32(&view, 100, MBM_ORDER_BADC, four) == MBM_OK);
  CHECK(words[0] == 0x41AE && words[1] == 0x5256);
  CHECK(mbm_registers_getUint32(&view, 100, MBM_ORDER_BADC, &number) == MBM_OK && number == four);
  CHECK(mbm_registers_setUint16(&view, 103, MBM_ORDER_DEFAULT, (uint16_t)-2) == MBM_OK && words[3] == 0xFFFE);
  CHECK(mbm_registers_getUint16(&view, 103, MBM_ORDER_DEFAULT, (uint16_t *)&small) == MBM_OK && small == -2);
  CHECK(mbm_registers_setUint64(&view, 100, MBM_ORDER_DCBA, &wide) == MBM_OK);
  CHECK(words[0] == 0x0807 && words[3] == 0x0201);
  CHECK(mbm_registers_getUint64(&view, 100, MBM_ORDER_ABCD, &wide) == MBM_OK);
  CHECK(wide == 0x0807060504030201ULL);
  CHECK(mbm_registers_getUint64(&view, 101, MBM_ORDER_ABCD, &wide) == MBM_ILLEGAL_DATA_ADDRESS);
}

static void floats() {
  uint16_t words[4] = {0x4009, 0x21FB, 0x5444, 0x2D18};
  mbm_registers view;
  double third = 1.0 / 3;
  double pi[3] = {7, 7, 7};
  float volts = 230.5;

  CHECK(mbm_registers_intoWords(&view, words, 4, 0) == MBM_OK);
  CHECK(mbm_registers_getDouble(&view, 0, MBM_ORDER_ABCD, &pi[1]) == MBM_OK);
  CHECK(pi[0] == 7 && pi[1] == 3.14159265358979 && pi[2] == 7); // and no other byte has changed
  CHECK(mbm_registers_setDouble(&view, 0, MBM_ORDER_ABCD, &third) == MBM_OK);
  CHECK(words[0] == 0x3FD5 && words[1] == 0x5555 && words[2] == 0x6000 && words[3] == 0);
  CHECK(mbm_registers_setFloat(&view, 2, MBM_ORDER_CDAB, &volts) == MBM_OK);
  CHECK(words[2] == 0x8000 && words[3] == 0x4366);
}

static void members() {
  ModbusMaster node;
  char text[5] = "";

  CHECK(node.getResponseFloat(0) == 0 && isnan(node.getResponseFloat(63)));
  CHECK(!node.getResponseString(62, 5, text, sizeof text));
  CHECK(node.setTransmitDouble(60, 1.5) == node.ku8MBSuccess);
  CHECK(node.setTransmitDouble(61, 1.5) == node.ku8MBIllegalDataAddress);
}

static void coils() {
  const uint8_t each[10] = {1, 0, 1, 1, 0, 0, 1, 1, 1, 0};
  uint16_t words[1] = {0};
  uint8_t on = 0;

  for (uint8_t i = 0; i < 10; i++) {
    CHECK(mbm_bits_setInWords(words, 0, 10, i, each[i]) == MBM_OK);
  }
  CHECK(words[0] == 0x01CD);
  CHECK(mbm_bits_isSetInWords(words, 19, 10, 27, &on) == MBM_OK && on == 1);
  CHECK(mbm_bits_isSetInWords(words, 19, 10, 29, &on) == MBM_ILLEGAL_DATA_ADDRESS);
}

void setup() {
  Serial.begin(115200);
  numbers();
  floats();
  members();
  coils();
  if (!wrong)
    Serial.println(F("none"));
}

void loop() {}
