// The calls of ModbusMaster's manual for a bus coupler of Phoenix Contact. The coupler
// refuses reads of more than 64 registers with exception 02.
// If Serial is the USB port of your board, use Serial1 for the bus.
#include <ModbusMaster.h>

ModbusMaster node;

void setup() {
  Serial.begin(19200);
  node.begin(1, Serial);
}

void loop() {
  // Each request returns a status, which this sketch looks at where it matters.

  // One request writes one word to the outputs and reads two words of the inputs.
  node.setTransmitBuffer(0, 0xABCD);
  node.readWriteMultipleRegisters(8, 2, 4, 1);

  // Two commands of one register each.
  node.writeSingleRegister(2006, 0);
  node.writeSingleRegister(2006, 1);

  // Writes the words that it has read.
  if (node.readHoldingRegisters(8, 2) == node.ku8MBSuccess) {
    node.setTransmitBuffer(0, node.getResponseBuffer(0));
    node.setTransmitBuffer(1, node.getResponseBuffer(1));
    node.writeMultipleRegisters(4, 2);
  }

  // Reads 17 coils. The last is the lowest bit of the second word.
  node.readCoils(0, 17);

  // The device refuses 66 registers, and returns 64.
  if (node.readHoldingRegisters(0, 66) == node.ku8MBIllegalDataAddress)
    node.readHoldingRegisters(0, 64);

  node.readHoldingRegisters(0, 8);
  node.readHoldingRegisters(8, 64);
  node.readHoldingRegisters(72, 8);
  node.readInputRegisters(0, 8);
  delay(100);
}
