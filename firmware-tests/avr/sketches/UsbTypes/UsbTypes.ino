// A Leonardo's Serial is over USB, and its Serial1 is not. Compiled, not run.
#include <ModbusClient.h>
#include <ModbusMaster.h>
#include <ModbusServer.h>


#if defined(USBCON)
static_assert(sizeof(ModbusPort<decltype(Serial)>::Usb) == 1, "Serial is over USB");
static_assert(sizeof(ModbusPort<decltype(Serial1)>::Wire) == 1, "Serial1 is not");
#else
static_assert(sizeof(ModbusPort<decltype(Serial)>::Wire) == 1, "Serial is not over USB");
#endif

ModbusRegisterArray<4> registers;
ModbusServer server;
ModbusSerialClient client;
ModbusMaster node;

void setup() {
  Serial.begin(9600);
  server.holdingRegisters(registers);
  server.begin(1, Serial, 9600);
  client.begin(Serial, 9600);
  node.begin(1, Serial);
}

void loop() {
  server.poll();
  client.poll();
}
