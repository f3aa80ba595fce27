// Reads six holding registers of slave 1 once a second. The LED is on if the last
// read succeeded. On a board with a second UART the sketch prints the values. The example
// EnergyMeter prints on an Uno too.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#define MESSAGES
#endif

const uint8_t led = 13; // the built-in one of many boards

ModbusMaster node;

void setup() {
  pinMode(led, OUTPUT);
#if defined(MESSAGES)
  Serial.begin(19200);
#endif
  BUS.begin(19200);
  node.begin(1, BUS);
  node.setBaudRate(19200); // sets the silence before each request
}

void loop() {
  // Addresses are those on the wire. Some manuals call address 2 register 40003.
  uint8_t result = node.readHoldingRegisters(2, 6);
  digitalWrite(led, result == node.ku8MBSuccess);
#if defined(MESSAGES)
  if (result == node.ku8MBSuccess) {
    for (uint8_t i = 0; i < 6; i++) {
      Serial.print(node.getResponseBuffer(i));
      Serial.print(' ');
    }
    Serial.println();
  } else {
    Serial.println(modbusStatusText(result));
  }
#endif
  delay(1000);
}
