// RS-485 with a transceiver such as the MAX485 (5 V) or the MAX3485 (3.3 V). DE and /RE are joined at
// one pin: the transceiver drives the line only while the sketch sends a request.
#include <ModbusMaster.h>

// The pins RO, DI and driverPin of a board of each core.
#if defined(ARDUINO_ARCH_STM32) // Blue Pill, Nucleo F103RB
#if STM32_CORE_VERSION_MAJOR >= 3
Uart bus(PA10, PA9); // RO, DI
#else
HardwareSerial bus(PA10, PA9); // the same, up to version 2 of STM32duino
#endif
const uint8_t driverPin = PA8;
#elif defined(ESP32) // ESP32 DevKit: RO at GPIO16, DI at GPIO17
#define bus Serial1
const uint8_t driverPin = 4;
#elif defined(ARDUINO_ARCH_RP2040) // Pico: RO at GP9, DI at GP8
#if defined(ARDUINO_ARCH_MBED)
UART bus(8, 9); // DI, RO
#else
#define bus Serial2
#endif
const uint8_t driverPin = 10;
#elif defined(ESP8266) || (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1))
#define bus Serial // Uno, Nano: there is no other UART, so disconnect the bus from it to upload
const uint8_t driverPin = 2;
#else
#define bus Serial1 // Mega, Leonardo, Zero, Teensy: RO at RX1, DI at TX1. Serial is for messages
const uint8_t driverPin = 2;
#endif
const uint8_t led = 13; // the built-in one of many boards

ModbusMaster node;

void setup() {
  pinMode(led, OUTPUT);

#if defined(ESP32)
  bus.begin(9600, SERIAL_8N1, 16, 17); // its UARTs take any pins
#else
  bus.begin(9600); // 8N1
#endif
  node.begin(1, bus);
  node.setBaudRate(9600);
  node.setDriverPin(driverPin); // high while a request leaves; for the other level (driverPin, LOW)
  // If DE and /RE are at pins of their own, for example 3 and 2: node.setDriverPins(3, 2);
  node.setRetries(1); // repeats a request once if it gets no correct reply

  // If your core's Serial.flush() returns before the last bit, keep the driver on longer:
  // node.setPostFlushHold(1);
  // If the receiver stays on while the driver sends, discard the echo:
  // node.setEchoDiscard(true);
}

void loop() {
  uint8_t result = node.readInputRegisters(0, 4);
  if (result == node.ku8MBSuccess)
    result = node.writeSingleRegister(30, node.getResponseBuffer(0));
  digitalWrite(led, result == node.ku8MBSuccess);
  delay(200);
}
