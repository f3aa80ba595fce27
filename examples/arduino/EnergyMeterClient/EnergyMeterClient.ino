// Two energy meters on one line, read without waiting: loop goes on while a meter is
// asked. Each holds voltage, current and power as floats in input registers 0, 6 and 12.
// A load is switched off while both meters together measure more than 1000 W.
#include <ModbusClient.h>

#if defined(__AVR_ATmega328P__) || defined(__AVR_ATmega168__) || defined(ESP8266)
#define BUS Serial // the only UART: take the bus off it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#define MESSAGES
#endif

const uint8_t load = 4; // a relay
const uint8_t led = 13;
const uint16_t voltageAt = 0; // from your meter's manual, counted from 0
const uint16_t currentAt = 6;
const uint16_t powerAt = 12;

ModbusSerialClient client;
ModbusRequestOf<14> first(1), second(2); // unit id; registers 0 to 13
float power[2];

// Called from client.poll() when a meter has replied, or has not.
void keep(const ModbusRequest &meter, float &watts) {
  if (meter.status() != MBM_OK)
    return; // the last value stays
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
  first.onDone([](ModbusRequest &meter) { keep(meter, power[0]); });
  second.onDone([](ModbusRequest &meter) { keep(meter, power[1]); });
  // first.setWordOrder(first.orderCDAB); // low word first? Then this.
}

void loop() {
  static unsigned long asked = 0, blinked = 0;
  if (millis() - asked >= 500 && client.pending() == 0) {
    asked = millis();
    client.readInputRegisters(first, 0, 14);
    client.readInputRegisters(second, 0, 14);
  }
  client.poll(); // never waits for a meter
  if (millis() - blinked >= 50) {
    blinked += 50;
    digitalWrite(led, !digitalRead(led));
  }
}
