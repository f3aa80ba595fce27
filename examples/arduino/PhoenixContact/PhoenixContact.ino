// The calls that the ModbusMaster manual makes to a Phoenix Contact bus
// coupler. It refuses reads of more than 64 registers with exception 02.
// Boards whose Serial is their USB port have the bus on Serial1.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  Serial.begin(19200);
  node.begin(1, Serial);
}

void loop() {
  // In one request: write one word to the outputs, read one from the inputs.
  node.setTransmitBuffer(0, 0xABCD);
  uint8_t result = node.readWriteMultipleRegisters(8, 2, 4, 1);

  // Commands, one register each.
  result = node.writeSingleRegister(2006, 0);
  result = node.writeSingleRegister(2006, 1);

  // What was read goes back out.
  if (node.readHoldingRegisters(8, 2) == node.ku8MBSuccess) {
    node.setTransmitBuffer(0, node.getResponseBuffer(0));
    node.setTransmitBuffer(1, node.getResponseBuffer(1));
    result = node.writeMultipleRegisters(4, 2);
  }

  // 17 coils: the seventeenth is the lowest bit of the second word.
  result = node.readCoils(0, 17);

  // One more than fits is refused by the device, 64 are what it gives.
  if (node.readHoldingRegisters(0, 66) == node.ku8MBIllegalDataAddress)
    result = node.readHoldingRegisters(0, 64);

  result = node.readHoldingRegisters(0, 8);
  result = node.readHoldingRegisters(8, 64);
  result = node.readHoldingRegisters(72, 8);
  result = node.readInputRegisters(0, 8);
  (void)result; // yours to use
  delay(100);
}
