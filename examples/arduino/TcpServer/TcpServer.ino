// A Modbus TCP server on an Ethernet shield: the voltage at A0 is input register 0, and a
// relay at pin 4 is coil 0. Several clients may be connected at once. For WiFi, replace
// EthernetServer by WiFiServer.
#include <Ethernet.h>
#include <ModbusTcpServer.h>

uint8_t mac[] = {0x02, 0xAB, 0xCD, 0x12, 0x34, 0x57};
const IPAddress own(192, 168, 1, 51);
const uint8_t relayPin = 4;

EthernetServer ethernet(502);
ModbusRegisterArray<1> sensor;
ModbusBitArray<1> relay;
ModbusHooks relayHooks;
ModbusTcpServer<EthernetServer> server; // two clients at once on an Uno, four on larger boards

void relayWritten(const mbm_access &) { digitalWrite(relayPin, relay[0] ? HIGH : LOW); }

void setup() {
  digitalWrite(relayPin, LOW);
  pinMode(relayPin, OUTPUT);
  server.inputRegisters(sensor);
  server.coils(relay);
  relayHooks.afterWrite(relayWritten);
  relay.setHooks(relayHooks);
  Ethernet.begin(mac, own);
  ethernet.begin();
  server.begin(1, ethernet);
}

void loop() {
  static unsigned long lastMeasurement = 0;
  if (millis() - lastMeasurement >= 100) {
    lastMeasurement = millis();
    sensor[0] = analogRead(A0);
  }
  server.poll();
}
