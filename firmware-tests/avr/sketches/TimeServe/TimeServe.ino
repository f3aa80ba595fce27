// Serves 64 registers at 19200 baud.
#include <ModbusServer.h>

ModbusRegisterArray<64> registers;
ModbusServer server;

void setup() {
  server.holdingRegisters(registers);
  Serial.begin(19200);
  server.begin(1, Serial, 19200);
}

void loop() {
  server.poll();
}
