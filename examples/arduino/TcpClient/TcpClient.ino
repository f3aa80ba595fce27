// A Modbus TCP client on an Ethernet shield: reads two registers of a device at
// 192.168.1.20 every 100 ms, and writes their sum to another. The connection is made anew
// where it was lost. With WiFi, put WiFiClient in the place of EthernetClient.
#include <Ethernet.h>
#include <ModbusClient.h>

uint8_t mac[] = {0x02, 0xAB, 0xCD, 0x12, 0x34, 0x56};
const IPAddress own(192, 168, 1, 50);
const IPAddress device(192, 168, 1, 20);
const uint8_t unit = 255; // the device itself, not one behind a gateway
const uint8_t led = 13;   // on while the device replies

EthernetClient ethernet;
ModbusTcpClient client;
ModbusRequestOf<2> readings(unit);
ModbusRequest sum(unit);

void connect() {
  static unsigned long tried = 0;
  static bool first = true;
  // The Ethernet library waits while it connects: not in every round.
  if (!first && millis() - tried < 5000)
    return;
  first = false;
  tried = millis();
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
  static unsigned long asked = 0;
  if (!client.isConnected())
    connect();
  if (millis() - asked >= 100 && client.pending() == 0) {
    asked = millis();
    client.readHoldingRegisters(readings, 10, 2);
  }
  client.poll();
}
