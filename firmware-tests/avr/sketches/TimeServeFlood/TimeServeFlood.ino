// As TimeServeFast. Port B, bit 0, is high while poll runs, and bit 1 while it runs and
// there are bytes to read. `taken` counts the bytes that polls have read.
#include <ModbusServer.h>

ModbusRegisterArray<64> registers;
ModbusServer server;
volatile uint16_t taken;

struct Port : HardwareSerial {
  // Where the next byte is read from the buffer of the core.
  static uint8_t tail() { return Serial.*(&Port::_rx_buffer_tail); }
};

void setup() {
  DDRB |= 3;
  server.holdingRegisters(registers);
  Serial.begin(115200);
  server.begin(1, Serial, 115200);
}

void loop() {
  uint8_t before = Port::tail();
  PORTB = Serial.available() > 0 ? 3 : 1;
  server.poll();
  PORTB = 0;
  taken += static_cast<uint8_t>(Port::tail() - before) % SERIAL_RX_BUFFER_SIZE;
}
