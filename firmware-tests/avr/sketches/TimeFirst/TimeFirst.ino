// Two objects on one line. The sketch sets no baud rate. Port B, bit 0, is high while a
// call runs.
#include <ModbusMaster.h>

ModbusMaster first, second;

void read(ModbusMaster &node) {
  PORTB |= 1;
  node.readHoldingRegisters(0, 10);
  PORTB &= ~1;
}

void setup() {
  DDRB |= 1;
  Serial.begin(115200);
  delay(50);
  first.begin(1, Serial);
  second.begin(2, Serial);
  read(first); // the line has been silent for 50 ms
  delay(50);
  read(second); // the line was silent for 50 ms
  read(first); // immediately after: here the gap is kept
  delay(50);
  read(first);
}

void loop() {}
