// Reads as TimeRead does, without waiting. Port B, bit 0, is high while poll runs.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  DDRB |= 1;
  Serial.begin(115200);
  node.begin(1, Serial);
  node.setBaudRate(115200);
  node.setGap(0);
  node.setBlocking(false);
}

void loop() {
  PORTB |= 1;
  uint8_t status = node.poll();
  PORTB &= ~1;
  if (status != node.ku8MBPending)
    node.readHoldingRegisters(0, 10);
}
