// The calls of the example Basic, without a gap between them. The library
// ModbusMaster, which is timed with this sketch too, keeps none.
#include <ModbusMaster.h>

ModbusMaster node;
volatile uint16_t data[6];

void setup() {
  Serial.begin(19200);
  node.begin(2, Serial);
#if defined(MBM_VERSION)
  node.setGap(0);
#endif
}

void loop() {
  static uint32_t counter;
  counter++;
  node.setTransmitBuffer(0, lowWord(counter));
  node.setTransmitBuffer(1, highWord(counter));
  node.writeMultipleRegisters(0, 2);
  if (node.readHoldingRegisters(2, 6) == node.ku8MBSuccess)
    for (uint8_t i = 0; i < 6; i++)
      data[i] = node.getResponseBuffer(i);
}
