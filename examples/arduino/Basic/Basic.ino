// The calls of the first example in ModbusMaster's manual: writes a counter to
// slave 2 as two words, then reads six registers, again and again without a pause.
// If Serial is the USB port of your board, use Serial1 for the bus.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  Serial.begin(19200);
  node.begin(2, Serial);
}

void loop() {
  static uint32_t counter;
  uint16_t data[6];

  counter++;
  node.setTransmitBuffer(0, lowWord(counter));
  node.setTransmitBuffer(1, highWord(counter));
  node.writeMultipleRegisters(0, 2);

  uint8_t result = node.readHoldingRegisters(2, 6);
  if (result == node.ku8MBSuccess)
    for (uint8_t i = 0; i < 6; i++)
      data[i] = node.getResponseBuffer(i);
  (void)data; // use the values here
}
