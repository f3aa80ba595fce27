// One function and nothing else.
#include <ModbusMaster.h>

ModbusMaster node;
volatile uint16_t sink;

void setup() {
  Serial.begin(19200);
  node.begin(2, Serial);
}

void loop() {
  if (node.readHoldingRegisters(0, 10) == node.ku8MBSuccess)
    sink = node.getResponseBuffer(0);
}
