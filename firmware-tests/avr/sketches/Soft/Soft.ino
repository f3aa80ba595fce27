// A bus on two ordinary pins. SoftwareSerial receives nothing while it sends.
#include <ModbusMaster.h>
#include <SoftwareSerial.h>

SoftwareSerial bus(10, 11);
ModbusMaster node;

struct Report {
  volatile uint8_t done;
  volatile uint8_t status[3];
  volatile uint16_t words[6];
} report;

void setup() {
  bus.begin(9600);
  node.begin(1, bus);
  node.setBaudRate(9600);
  report.status[0] = node.readHoldingRegisters(2, 6);
  for (uint8_t i = 0; i < 6; i++) {
    report.words[i] = node.getResponseBuffer(i);
    node.setTransmitBuffer(i, ~node.getResponseBuffer(i));
  }
  report.status[1] = node.writeMultipleRegisters(20, 6);
  report.status[2] = node.writeSingleCoil(3, 1);
  report.done = 1;
}

void loop() {}
