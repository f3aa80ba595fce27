// A gateway on an ESP8266: Modbus TCP comes in over WiFi, RTU goes out to the devices of a
// serial line, and their replies go back. DE and /RE of the transceiver are tied together
// on pin 4. On an ESP32, include <WiFi.h> and put the line on Serial1.
#include <ESP8266WiFi.h>
#include <ModbusTcpGateway.h>

const char name[] = "your network";
const char password[] = "its password";
const uint8_t driverEnable = 4;
const uint32_t baud = 19200;

WiFiServer wifi(502);
ModbusSerialClient line;
ModbusTcpGateway<WiFiServer> gateway; // for four clients

void driverOn() { digitalWrite(driverEnable, HIGH); }
void driverOff() { digitalWrite(driverEnable, LOW); }

void setup() {
  driverOff();
  pinMode(driverEnable, OUTPUT);
  Serial.begin(baud);
  line.begin(Serial, baud);
  line.preTransmission(driverOn);
  line.postTransmission(driverOff); // the last bit has left by then
  line.setResponseTimeout(500);
  WiFi.begin(name, password);
  wifi.begin();
  gateway.begin(wifi, line, 1, 31); // the unit ids of the line
}

void loop() { gateway.poll(); } // connections and line; nothing waits
