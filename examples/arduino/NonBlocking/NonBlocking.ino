// Requests without waiting: the functions return at once, and poll does the rest.
// The LED blinks evenly, whether the slave replies or not.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#endif

const uint8_t led = 13; // the built-in one of many boards

ModbusMaster node;
uint16_t replies;

void setup() {
  pinMode(led, OUTPUT);
  BUS.begin(19200);
  node.begin(1, BUS);
  node.setBaudRate(19200);
  node.setBlocking(false);
  node.setResponseTimeout(500);
}

void blink() {
  static uint32_t last;
  if (millis() - last < 50)
    return;
  last += 50;
  digitalWrite(led, !digitalRead(led));
}

// Reads a register, writes its value to another one, and starts again.
void copyRegister() {
  static bool reading = false;
  uint8_t result = node.poll();
  if (result == node.ku8MBPending)
    return;
  if (reading && result == node.ku8MBSuccess) {
    replies++;
    node.setTransmitBuffer(0, node.getResponseBuffer(0));
    node.setTransmitBuffer(1, replies);
    node.writeMultipleRegisters(40, 2);
    reading = false;
  } else {
    node.readHoldingRegisters(3, 1);
    reading = true;
  }
}

void loop() {
  blink();
  copyRegister();
}
