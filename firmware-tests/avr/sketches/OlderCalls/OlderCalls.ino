// The calls of version 0.9: port and slave are given to the constructor, begin opens the
// port, words are queued and received one by one.
#include <ModbusMaster.h>

ModbusMaster node(1, 2);

struct Report {
  volatile uint8_t done;
  volatile uint8_t status[2];
  volatile uint8_t count;
  volatile uint16_t words[3];
} report;

void setup() {
  node.begin(19200);
  node.beginTransmission(30);
  node.send(uint16_t(0x1234));
  node.send(LONG(0xDEAD, 0xBEEF));
  report.status[0] = node.writeMultipleRegisters();

  node.beginTransmission(50);
  for (uint8_t i = 0; i < 5; i++)
    node.sendBit(i % 2 == 0);
  report.status[1] = node.writeMultipleCoils();

  report.count = node.requestFrom(40, 3);
  for (uint8_t i = 0; node.available(); i++)
    report.words[i] = node.receive();
  report.done = 1;
}

void loop() {}
