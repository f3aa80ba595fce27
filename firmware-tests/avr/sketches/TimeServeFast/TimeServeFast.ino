// Serves 64 registers at 115200 baud.
#include <ModbusServer.h>

ModbusRegisterArray<64> registers;
ModbusServer server;

void setup() {
  server.holdingRegisters(registers);
  Serial.begin(115200);
  server.begin(1, Serial, 115200);
}

void loop() {
  server.poll();
}
