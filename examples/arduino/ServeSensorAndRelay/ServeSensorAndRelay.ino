// A server (slave), unit 17, on RS-485: a sensor at A0 is input register 0, a
// relay at pin 4 is coil 0. DE and /RE of the transceiver are tied together on
// pin 2; it drives the line only while a response is being sent.
#include <ModbusServer.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266)
#define BUS Serial // the only UART: take the bus off it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#endif

const uint8_t driverEnable = 2;
const uint8_t relayPin = 4;

ModbusRegisterArray<1> sensor;
ModbusBitArray<1> relay;
ModbusHooks relayHooks;
ModbusServer server;

void driverOn() { digitalWrite(driverEnable, HIGH); }
void driverOff() { digitalWrite(driverEnable, LOW); }

void relayWritten(const mbm_access &) { digitalWrite(relayPin, relay[0] ? HIGH : LOW); }

void setup() {
  digitalWrite(relayPin, LOW);
  pinMode(relayPin, OUTPUT);
  driverOff();
  pinMode(driverEnable, OUTPUT);

  server.inputRegisters(sensor);
  server.coils(relay);
  relayHooks.afterWrite(relayWritten);
  relay.setHooks(relayHooks);
  server.preTransmission(driverOn);
  server.postTransmission(driverOff); // the last bit has left by then

  BUS.begin(19200);
  server.begin(17, BUS, 19200);
}

void loop() {
  static unsigned long measured = 0;
  // Not in every round: a measurement would hold the response up.
  if (millis() - measured >= 100) {
    measured += 100;
    sensor[0] = analogRead(A0);
  }
  server.poll();
}
