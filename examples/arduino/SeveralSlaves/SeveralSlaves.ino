// Three slaves on one bus. Each slave has an object of its own, with its own words. All
// objects share the port. The buffers of this sketch are smaller than usual, to leave RAM
// for other things.
#define MODBUSMASTER_RESPONSE_WORDS 16
#define MODBUSMASTER_TRANSMIT_WORDS 8
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#endif

const uint8_t led = 13; // the built-in one of many boards

const uint8_t sensors = 3;
ModbusMaster sensor[sensors] = {1, 2, 3}; // their unit ids

void setup() {
  pinMode(led, OUTPUT);
  BUS.begin(19200);
  for (uint8_t i = 0; i < sensors; i++) {
    sensor[i].begin(sensor[i].getSlaveID(), BUS);
    sensor[i].setBaudRate(19200);
    sensor[i].setResponseTimeout(200); // a missing slave delays the others for 200 ms
  }
}

void loop() {
  uint8_t present = 0;
  for (uint8_t i = 0; i < sensors; i++) {
    if (sensor[i].readHoldingRegisters(5, 1) != ModbusMaster::ku8MBSuccess)
      continue;
    present++;
    // Writes the value that it has read to the next register.
    sensor[i].writeSingleRegister(6, sensor[i].getResponseBuffer(0));
  }
  digitalWrite(led, present == sensors);
  delay(100);
}
