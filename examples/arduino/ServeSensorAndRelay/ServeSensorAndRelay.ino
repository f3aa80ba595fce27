// A server (slave) with unit id 17 on RS-485: a sensor at A0 is input register 0, and a
// relay at pin 4 is coil 0. Connect DE and /RE of the transceiver to pin 2: it drives the
// line only while the sketch sends a response.
#include <ModbusServer.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#endif

const uint8_t driverEnable = 2;
const uint8_t relayPin = 4;

ModbusRegisterArray<1> sensor;
ModbusBitArray<1> relay;
ModbusHooks relayHooks;
ModbusServer server;

void relayWritten(const mbm_access &) { digitalWrite(relayPin, relay[0] ? HIGH : LOW); }

void setup() {
  digitalWrite(relayPin, LOW);
  pinMode(relayPin, OUTPUT);

  server.inputRegisters(sensor);
  server.coils(relay);
  relayHooks.afterWrite(relayWritten);
  relay.setHooks(relayHooks);
  server.setDriverPin(driverEnable); // high while a response leaves

  BUS.begin(19200);
  server.begin(17, BUS, 19200);
}

void loop() {
  static unsigned long lastMeasurement = 0;
  // Ten times a second only, because a measurement delays the response.
  if (millis() - lastMeasurement >= 100) {
    lastMeasurement += 100;
    sensor[0] = analogRead(A0);
  }
  server.poll();
}
