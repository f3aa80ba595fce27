// Two slaves on two ports, with requests at the same time. The sketch counts how often both
// requests were pending together.
#include <ModbusMaster.h>

ModbusMaster left, right;

struct Report {
  volatile uint8_t done;
  volatile uint8_t good[2];
  volatile uint8_t bad[2];
  volatile uint16_t words[2];
  volatile uint16_t together;
} report;

void prepare(ModbusMaster &node, uint8_t slave, HardwareSerial &port) {
  port.begin(38400);
  node.begin(slave, port);
  node.setBaudRate(38400);
  node.setBlocking(false);
}

// True while the request is pending.
bool moveOn(ModbusMaster &node, uint8_t which) {
  uint8_t status = node.poll();
  if (status == node.ku8MBPending)
    return true;
  if (node.available() > 0) {
    report.words[which] = node.receive();
    report.good[which]++;
  } else if (status != node.ku8MBSuccess) {
    report.bad[which]++;
  }
  node.readHoldingRegisters(7 + which, 4);
  return false;
}

void setup() {
  prepare(left, 1, Serial1);
  prepare(right, 2, Serial2);
}

void loop() {
  bool leftBusy = moveOn(left, 0);
  bool rightBusy = moveOn(right, 1);
  if (leftBusy && rightBusy)
    report.together++;
  if (report.good[0] >= 10 && report.good[1] >= 10)
    report.done = 1;
}
