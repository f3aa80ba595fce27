// The ports of the three classes with a serial line, in the test kit for ports: TX1 is wired to RX1, and the
// driver is at pin 2. The class has its port to itself, so that part of it is opened here.
#define private public
#define protected public
#include <ModbusClient.h>
#include <ModbusMaster.h>
#include <ModbusServer.h>
#undef private
#undef protected
#include <PortTest.h>

ModbusSerialClient client;
ModbusServer server;
ModbusMaster node;
mbm_portTest test;
volatile uint8_t ended; // 1 more than the faults of all ports, once the sketch has ended

void say(void *, mbm_portFinding kind, const char *sentence) {
  Serial.print(mbm_portFinding_name(kind));
  Serial.print(F(": "));
  Serial.println(sentence);
  Serial.flush();
}

uint8_t readDriver(void *) { return digitalRead(2); }

uint16_t run(const __FlashStringHelper *name, const mbm_port &port) {
  Serial.println(name);
  test.port = &port;
  return mbm_portTest_run(&test);
}

void setup() {
  Serial.begin(115200);
  Serial1.begin(9600);
  test.isLooped = 1;
  test.baud = 9600;
  test.mayWait = 1; // Stream.write waits while the core's buffer of 64 bytes is full
  test.holds = 63;
  test.say = say;
  test.driver = readDriver;

  client.begin(Serial1, 9600);
  client.setDriverPin(2);
  const mbm_port clients =
      modbusPort(&client, client.readHook, client.writeHook, client.clockHook, client.flushHook,
                 client.preHook, client.postHook);
  uint16_t faults = run(F("ModbusSerialClient"), clients);

  node.begin(1, Serial1);
  node.setDriverPin(2);
  faults += run(F("ModbusMaster"), node.state.own.port);

  server.begin(1, Serial1, 9600);
  server.setDriverPin(2);
  const mbm_port servers =
      modbusPort(&server.state, server.readHook, server.writeHook, server.clockHook,
                 server.flushHook, server.preHook, server.postHook);
  faults += run(F("ModbusServer"), servers);
  ended = faults + 1;
}

void loop() {}
