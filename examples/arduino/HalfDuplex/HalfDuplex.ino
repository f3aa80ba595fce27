// RS-485 with a transceiver such as the MAX485. Connect DE and /RE to pin 2: the
// transceiver drives the line only while the sketch sends a request.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#endif

const uint8_t driverEnable = 2;
const uint8_t led = 13; // the built-in one of many boards

ModbusMaster node;

void driverOn() { digitalWrite(driverEnable, HIGH); }
void driverOff() { digitalWrite(driverEnable, LOW); }

void setup() {
  pinMode(led, OUTPUT);
  driverOff();
  pinMode(driverEnable, OUTPUT);

  BUS.begin(9600);
  node.begin(1, BUS);
  node.setBaudRate(9600);
  node.preTransmission(driverOn);
  node.postTransmission(driverOff); // called after the last bit
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
