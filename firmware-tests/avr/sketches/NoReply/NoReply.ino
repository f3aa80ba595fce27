// Requests that no device answers: how long each call takes, in milliseconds, if the
// sketch works between them for longer than the quiet time, for half of it, and not at all.
#include <ModbusMaster.h>

ModbusMaster node;

struct Report {
  volatile uint8_t done;
  volatile uint8_t status[4];
  volatile uint16_t took[4];
} report;

void setup() {
  const uint8_t pauses[] = {20, 150, 50, 0};
  Serial.begin(19200);
  node.begin(1, Serial);
  node.setBaudRate(19200);
  node.setResponseTimeout(200);
  for (uint8_t i = 0; i < 4; i++) {
    delay(pauses[i]);
    uint32_t began = millis();
    report.status[i] = node.readHoldingRegisters(2, 6);
    report.took[i] = millis() - began;
  }
  report.done = 1;
}

void loop() {}
