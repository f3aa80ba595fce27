// Many energy meters hold their readings as 32-bit floats, two input registers
// each, the high word first; others put the low word first. This one reads
// voltage, current and power, and switches a load off above 1000 W.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266)
#define BUS Serial // the only UART: take the bus off it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#define MESSAGES
#endif

const uint8_t load = 4;       // a relay
const uint16_t voltageAt = 0; // from your meter's manual, counted from 0
const uint16_t currentAt = 6;
const uint16_t powerAt = 12;

ModbusMaster meter;

// False, with the value untouched, if the meter does not answer properly.
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
  // meter.setWordOrder(meter.orderCDAB); // low word first? Then this.
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
