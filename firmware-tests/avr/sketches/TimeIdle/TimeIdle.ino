// Reads sixty registers again and again. Port B, bit 0, changes each time that the function
// which waits for the reply has looked for bytes.
#include <ModbusMaster.h>

ModbusMaster node;

void idle() {
  PINB = 1;
}

void setup() {
  DDRB |= 1;
  Serial.begin(115200);
  node.begin(1, Serial);
  node.idle(idle);
}

void loop() {
  node.readHoldingRegisters(0, 60);
}
