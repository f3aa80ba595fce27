// Writes three registers and twelve coils of slave 1 and reads them back. The LED is on if
// the values read are the values written.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#endif

const uint8_t led = 13; // the built-in one of many boards

ModbusMaster node;

bool registersMatch(uint16_t seed) {
  node.beginTransmission(10); // the address of the words that send queues
  node.send(seed);
  node.send(seed + 1);
  node.send(seed + 2);
  if (node.writeMultipleRegisters() != node.ku8MBSuccess)
    return false;
  if (node.readHoldingRegisters(10, 3) != node.ku8MBSuccess)
    return false;
  for (uint8_t i = 0; i < 3; i++)
    if (node.getResponseBuffer(i) != uint16_t(seed + i))
      return false;
  return true;
}

bool coilsMatch(uint16_t pattern) {
  node.setTransmitBuffer(0, pattern); // the lowest bit is coil 20
  if (node.writeMultipleCoils(20, 11) != node.ku8MBSuccess)
    return false;
  if (node.writeSingleCoil(31, true) != node.ku8MBSuccess)
    return false;
  if (node.readCoils(20, 12) != node.ku8MBSuccess)
    return false;
  return node.getResponseBuffer(0) == ((pattern & 0x07FF) | 0x0800);
}

void setup() {
  pinMode(led, OUTPUT);
  BUS.begin(38400);
  node.begin(1, BUS);
  node.setBaudRate(38400);
}

void loop() {
  static uint16_t round = 1000;
  bool good = registersMatch(round) && coilsMatch(round);
  digitalWrite(led, good);
  round += 10;
  delay(500);
}
