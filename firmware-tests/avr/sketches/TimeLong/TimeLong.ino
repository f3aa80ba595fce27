// Reads sixty registers again and again, as a sketch for the library ModbusMaster does,
// which is measured with this sketch too.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  Serial.begin(115200);
  node.begin(1, Serial);
}

void loop() {
  node.readHoldingRegisters(0, 60);
}
