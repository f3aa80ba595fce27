// Reads ten registers again and again, as fast as the line allows. Port B, bit
// 0, is high while the call runs.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  DDRB |= 1;
  Serial.begin(115200);
  node.begin(1, Serial);
  node.setBaudRate(115200);
  node.setGap(0);
}

void loop() {
  PORTB |= 1;
  node.readHoldingRegisters(0, 10);
  PORTB &= ~1;
}
