// Five reads of different addresses. A test reads the report in RAM.
#include <ModbusMaster.h>

ModbusMaster node;

struct Report {
  volatile uint8_t done;
  volatile uint8_t status[5];
  volatile uint16_t words[5][10];
} report;

void setup() {
  Serial.begin(115200);
  node.begin(1, Serial);
  node.setBaudRate(115200);
  node.setResponseTimeout(400);
  for (uint8_t n = 0; n < 5; n++) {
    report.status[n] = node.readHoldingRegisters(100 * (n + 1), 10);
    for (uint8_t i = 0; i < 10; i++)
      report.words[n][i] = node.getResponseBuffer(i);
  }
  report.done = 1;
}

void loop() {}
