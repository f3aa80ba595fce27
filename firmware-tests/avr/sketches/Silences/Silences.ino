// Requests over a UART and over two pins, before and after the sketch has set the silence. The
// simulated device notes how long each silence was.
#include <ModbusMaster.h>
#include <SoftwareSerial.h>

SoftwareSerial pins(10, 11);
ModbusMaster node, other, soft;
volatile uint8_t done, failed;

void read(ModbusMaster &from) {
  failed |= from.readHoldingRegisters(0, 3);
}

void setup() {
  Serial.begin(115200);
  pins.begin(19200);
  node.begin(1, Serial);
  other.begin(2, Serial);
  soft.begin(1, pins);
  read(node);
  read(node);
  read(soft); // the rate of two pins is not known
  read(soft);
  read(node);
  read(other);
  read(node);
  Stream &stream = Serial;
  node.begin(1, stream); // nor that of a Stream
  read(node);
  node.begin(1, Serial);
  read(node);
  node.setGap(9000);
  read(node);
  node.begin(1, Serial);
  read(node);
  read(other);
  other.setBaudRate(9600);
  read(other);
  done = 1;
}

void loop() {}
