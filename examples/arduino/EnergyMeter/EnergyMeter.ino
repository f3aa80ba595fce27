// Prints voltage, current and power of an energy meter once a second, or why there is no value.
// Many meters hold each value as a 32-bit float in two input registers, the high word first.
#include <ModbusMaster.h>

// The RS-485 module: DE and /RE at pin 2; RO (receives) and DI (sends) as below. Serial stays
// free for messages.
#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ARDUINO_ARCH_STM32)
#include <SoftwareSerial.h>
SoftwareSerial bus(10, 11); // RO, DI
#elif defined(ESP8266)
#include <SoftwareSerial.h>
SoftwareSerial bus(14, 12); // RO at D5, DI at D6
#else
#define bus Serial1 // RO at RX1, DI at TX1
#endif

const uint8_t driverEnable = 2;
const uint16_t voltageAt = 0; // the addresses are in your meter's manual; count from 0
const uint16_t currentAt = 6;
const uint16_t powerAt = 12;

ModbusMaster first;

void begin(ModbusMaster &meter, uint8_t unit) {
  meter.begin(unit, bus);
  meter.setBaudRate(9600);
  meter.setResponseTimeout(300); // milliseconds
  meter.setRetries(1);
  meter.setDriverPin(driverEnable); // high while a request leaves
  // meter.setWordOrder(meter.orderCDAB); // if your meter has the low word first
}

// Returns false if the meter sends no correct reply.
bool readFloat(ModbusMaster &meter, uint16_t address, float &value) {
  return meter.readInputRegisters(address, 2) == meter.ku8MBSuccess &&
         meter.getResponseFloat(0, value);
}

void print(ModbusMaster &meter) {
  float voltage, current, power;
  Serial.print(F("unit "));
  Serial.print(meter.getSlaveID());
  Serial.print(F(": "));
  if (readFloat(meter, voltageAt, voltage) && readFloat(meter, currentAt, current) &&
      readFloat(meter, powerAt, power)) {
    Serial.print(voltage);
    Serial.print(F(" V "));
    Serial.print(current);
    Serial.print(F(" A "));
    Serial.print(power);
    Serial.println(F(" W"));
  } else {
    Serial.println(modbusStatusText(meter.status()));
  }
}

void setup() {
  Serial.begin(9600); // the rate to choose in the serial monitor
  bus.begin(9600);    // the rate of the meter, 8N1
  begin(first, 1);
}

void loop() {
  static unsigned long last = 0;
  if (millis() - last < 1000)
    return;
  last = millis();
  print(first);
}
