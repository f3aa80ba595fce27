// Reads voltage, current and power of an energy meter, and switches a load off
// above 1000 W. Many meters hold each value as a 32-bit float in two input
// registers, the high word first. Others put the low word first.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266)
#define BUS Serial // the only UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#define MESSAGES
#endif

const uint8_t load = 4;       // a relay
const uint16_t voltageAt = 0; // the addresses are in your meter's manual; count from 0
const uint16_t currentAt = 6;
const uint16_t powerAt = 12;

ModbusMaster meter;

// Returns false and leaves `value` as it is if the meter sends no correct reply.
bool readFloat(uint16_t address, float &value) {
  return meter.readInputRegisters(address, 2) == meter.ku8MBSuccess &&
         meter.getResponseFloat(0, value);
}

void setup() {
  pinMode(load, OUTPUT);
  digitalWrite(load, HIGH);
#if defined(MESSAGES)
  Serial.begin(9600);
#endif
  BUS.begin(9600);
  meter.begin(1, BUS);
  meter.setBaudRate(9600);
  meter.setRetries(2);
  // meter.setWordOrder(meter.orderCDAB); // if your meter has the low word first
}

void loop() {
  float voltage, current, power;
  if (readFloat(voltageAt, voltage) && readFloat(currentAt, current) && readFloat(powerAt, power)) {
    digitalWrite(load, power <= 1000.0f);
#if defined(MESSAGES)
    Serial.print(voltage);
    Serial.print(" V ");
    Serial.print(current);
    Serial.print(" A ");
    Serial.print(power);
    Serial.println(" W");
#endif
  }
  delay(500);
}
