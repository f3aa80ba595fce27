// Waits for as many registers of unit 17 as the response buffer holds. Port B, bit 0, is
// high while poll runs, and bit 1 while it runs and there are bytes to read. `tail` is the
// address at which the core keeps the place of its next byte to read, and `status` is the
// request's status.
#include <ModbusMaster.h>

ModbusMaster node;
volatile rx_buffer_index_t *volatile tail;
volatile uint8_t status;

struct Port : HardwareSerial {
  // Where the next byte is read from the buffer of the core.
  static volatile rx_buffer_index_t *place() { return &(Serial.*(&Port::_rx_buffer_tail)); }
};

void setup() {
  DDRB |= 3;
  tail = Port::place();
  Serial.begin(115200);
  node.begin(17, Serial);
  node.setBaudRate(115200);
  node.setBlocking(false);
  status = node.readHoldingRegisters(0, MODBUSMASTER_RESPONSE_WORDS);
}

void loop() {
  if (status != node.ku8MBPending)
    return;
  PORTB = Serial.available() > 0 ? 3 : 1;
  uint8_t now = node.poll();
  PORTB = 0;
  status = now;
}
