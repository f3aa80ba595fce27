// A Modbus TCP client on an Ethernet shield: every 100 ms it reads two registers of the
// device at 192.168.1.20 and writes their sum to a third. If the connection is lost, it
// connects again. For WiFi, replace EthernetClient by WiFiClient.
#include <Ethernet.h>
#include <ModbusClient.h>

uint8_t mac[] = {0x02, 0xAB, 0xCD, 0x12, 0x34, 0x56};
const IPAddress own(192, 168, 1, 50);
const IPAddress device(192, 168, 1, 20);
const uint8_t unit = 255; // the device itself; a device behind a gateway has another id
const uint8_t led = 13;   // on while the device replies

EthernetClient ethernet;
ModbusTcpClient client;
ModbusRequestOf<2> readings(unit);
ModbusRequest sum(unit);

void connect() {
  static unsigned long lastTry = 0;
  static bool first = true;
  // Every five seconds only, because the Ethernet library waits while it connects.
  if (!first && millis() - lastTry < 5000)
    return;
  first = false;
  lastTry = millis();
  client.connect(device);
}

void setup() {
  pinMode(led, OUTPUT);
  Ethernet.begin(mac, own);
  client.begin(ethernet);
  client.setResponseTimeout(1000);
  readings.onDone([](ModbusRequest &reply) {
    digitalWrite(led, reply.status() == MBM_OK);
    if (reply.status() == MBM_OK)
      client.writeSingleRegister(sum, 20, reply[0] + reply[1]);
  });
}

void loop() {
  static unsigned long lastRequest = 0;
  if (!client.isConnected())
    connect();
  if (millis() - lastRequest >= 100 && client.pending() == 0) {
    lastRequest = millis();
    client.readHoldingRegisters(readings, 10, 2);
  }
  client.poll();
}
