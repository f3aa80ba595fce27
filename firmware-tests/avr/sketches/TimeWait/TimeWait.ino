// Waits for as many registers of unit 17 as the response buffer holds. Port B, bit 0, is
// high while poll runs, and bit 1 while it runs and there are bytes to read. `taken` counts
// the bytes that polls have read, and `status` is the request's status.
#include <ModbusMaster.h>

ModbusMaster node;
volatile uint16_t taken;
volatile uint8_t status;

struct Port : HardwareSerial {
  // Where the next byte is read from the buffer of the core.
  static uint8_t tail() { return Serial.*(&Port::_rx_buffer_tail); }
};

void setup() {
  DDRB |= 3;
  Serial.begin(115200);
  node.begin(17, Serial);
  node.setBaudRate(115200);
  node.setBlocking(false);
  status = node.readHoldingRegisters(0, MODBUSMASTER_RESPONSE_WORDS);
}

void loop() {
  if (status != node.ku8MBPending)
    return;
  uint8_t before = Port::tail();
  PORTB = Serial.available() > 0 ? 3 : 1;
  uint8_t now = node.poll();
  PORTB = 0;
  taken += static_cast<uint8_t>(Port::tail() - before) % SERIAL_RX_BUFFER_SIZE;
  status = now;
}
