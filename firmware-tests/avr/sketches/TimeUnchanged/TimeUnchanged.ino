// Reads ten registers again and again, as a sketch for the library ModbusMaster does, which
// is timed with this sketch too. Nothing tells the baud rate.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  Serial.begin(115200);
  node.begin(1, Serial);
}

void loop() {
  node.readHoldingRegisters(0, 10);
}
