// A gateway on an ESP8266: it receives Modbus TCP over WiFi, sends the requests as RTU to
// the devices of a serial line, and returns their replies. Connect DE and /RE of the
// transceiver to pin 4. On an ESP32, include <WiFi.h> and use Serial1 for the line.
#include <ESP8266WiFi.h>
#include <ModbusTcpGateway.h>

const char name[] = "your network";
const char password[] = "its password";
const uint8_t driverEnable = 4;
const uint32_t baud = 19200;

WiFiServer wifi(502);
ModbusSerialClient line;
ModbusTcpGateway<WiFiServer> gateway; // up to four clients at once

void setup() {
  Serial.begin(baud);
  line.begin(Serial, baud);
  line.setDriverPin(driverEnable); // high while a request leaves
  line.setResponseTimeout(500);
  WiFi.begin(name, password);
  wifi.begin();
  gateway.begin(wifi, line, 1, 31); // units 1 to 31 are on the line
}

void loop() { gateway.poll(); } // serves the connections and the line without waiting
