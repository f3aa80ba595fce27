// The longest reads that the default buffers allow, at the highest rate at which an Uno's
// UART has no error: the receive buffer of 64 bytes must not overflow.
#include <ModbusMaster.h>

ModbusMaster node;

struct Report {
  volatile uint8_t done;
  volatile uint8_t status[3];
  volatile uint8_t wrong;
} report;

void setup() {
  Serial.begin(115200);
  node.begin(1, Serial);
  node.setBaudRate(115200);
  node.setResponseTimeout(300);
  for (uint8_t n = 0; n < 3; n++) {
    report.status[n] = node.readHoldingRegisters(0, 64);
    for (uint8_t i = 0; i < 64; i++)
      if (node.getResponseBuffer(i) != uint16_t(i * 7919u + 1u))
        report.wrong++;
  }
  report.done = 1;
}

void loop() {}
