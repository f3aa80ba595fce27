// RS-485: a transceiver such as the MAX485, with DE and /RE tied together on
// pin 2, drives the line only while a request is being sent.
#include <ModbusMaster.h>

#if (defined(__AVR__) && !defined(UBRR1H) && !defined(USART1)) || defined(ESP8266)
#define BUS Serial // the only UART: take the bus off it to upload
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
  node.postTransmission(driverOff); // the last bit has left by then
  node.setRetries(1); // a request without a proper reply is sent once more

  // On cores whose Serial.flush() returns too early, hold the driver on:
  // node.setPostFlushHold(1);
  // Where the receiver stays on and hears the request itself:
  // node.setEchoDiscard(true);
}

void loop() {
  uint8_t result = node.readInputRegisters(0, 4);
  if (result == node.ku8MBSuccess)
    result = node.writeSingleRegister(30, node.getResponseBuffer(0));
  digitalWrite(led, result == node.ku8MBSuccess);
  delay(200);
}
