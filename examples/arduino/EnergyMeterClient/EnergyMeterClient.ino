// Reads two energy meters on one line without waiting: loop continues while a reply is
// pending. Each meter holds voltage, current and power as floats in input registers 0, 6
// and 12. The sketch switches a load off while both meters together measure more than
// 1000 W.
#include <ModbusClient.h>

#if defined(__AVR_ATmega328P__) || defined(__AVR_ATmega168__) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#define MESSAGES
#endif

const uint8_t load = 4; // a relay
const uint8_t led = 13;
const uint16_t voltageAt = 0; // the addresses are in your meter's manual; count from 0
const uint16_t currentAt = 6;
const uint16_t powerAt = 12;

ModbusSerialClient client;
ModbusRequestOf<14> first(1), second(2); // unit id; registers 0 to 13
float power[2];

// client.poll() calls this when a request has ended, with or without a reply.
void store(const ModbusRequest &meter, float &watts) {
  if (meter.status() != MBM_OK)
    return; // the last value remains
  watts = meter.getFloat(powerAt);
  digitalWrite(load, power[0] + power[1] <= 1000.0f);
#if defined(MESSAGES)
  Serial.print(meter.getUnitID());
  Serial.print(F(": "));
  Serial.print(meter.getFloat(voltageAt));
  Serial.print(F(" V "));
  Serial.print(meter.getFloat(currentAt));
  Serial.print(F(" A "));
  Serial.print(watts);
  Serial.println(F(" W"));
#endif
}

void setup() {
  pinMode(led, OUTPUT);
  pinMode(load, OUTPUT);
  digitalWrite(load, HIGH);
#if defined(MESSAGES)
  Serial.begin(9600);
#endif
  BUS.begin(9600);
  client.begin(BUS, 9600);
  client.setResponseTimeout(300);
  client.setRetries(2);
  first.onDone([](ModbusRequest &meter) { store(meter, power[0]); });
  second.onDone([](ModbusRequest &meter) { store(meter, power[1]); });
  // first.setWordOrder(first.orderCDAB); // if your meters have the low word first
}

void loop() {
  static unsigned long lastRequest = 0, lastBlink = 0;
  if (millis() - lastRequest >= 500 && client.pending() == 0) {
    lastRequest = millis();
    client.readInputRegisters(first, 0, 14);
    client.readInputRegisters(second, 0, 14);
  }
  client.poll(); // never waits for a meter
  if (millis() - lastBlink >= 50) {
    lastBlink += 50;
    digitalWrite(led, !digitalRead(led));
  }
}
