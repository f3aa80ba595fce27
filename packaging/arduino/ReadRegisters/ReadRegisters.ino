#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  Serial.begin(19200);
  node.begin(17, Serial);        // the device's unit id
  node.setBaudRate(19200);       // the silence before each request follows from it
  node.setResponseTimeout(200);  // milliseconds; 2000 if you do not set it
}

void loop() {
  uint8_t status = node.readHoldingRegisters(2, 6); // six registers from address 2 on
  if (status == node.ku8MBSuccess)
    analogWrite(9, node.getResponseBuffer(0) / 4);
  delay(100);
}
