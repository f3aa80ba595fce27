// Reads ten registers again and again, as fast as the line allows. Port B, bit 0, is high
// while the call runs. The library ModbusMaster, which is timed with this sketch too, does
// not have the two setters.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  DDRB |= 1;
  Serial.begin(115200);
  node.begin(1, Serial);
#if defined(MBM_VERSION)
  node.setBaudRate(115200);
  node.setGap(0);
#endif
}

void loop() {
  PORTB |= 1;
  node.readHoldingRegisters(0, 10);
  PORTB &= ~1;
}
