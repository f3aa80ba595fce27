// Reads six holding registers of slave 1, once a second. The LED is on while
// that works. Where the board has a second UART, the values are printed.
#include <ModbusMaster.h>

#if defined(HAVE_HWSERIAL1)
#define BUS Serial1 // Serial stays free for messages
#else
#define BUS Serial // the only UART of an Uno: take the bus off it to upload
#endif

ModbusMaster node;

void setup() {
  pinMode(LED_BUILTIN, OUTPUT);
  Serial.begin(19200);
  BUS.begin(19200);
  node.begin(1, BUS);
  node.setBaudRate(19200); // the silence before each request follows from it
}

void loop() {
  // Addresses are those on the wire: 2 is what manuals may call 40003.
  uint8_t result = node.readHoldingRegisters(2, 6);
  digitalWrite(LED_BUILTIN, result == node.ku8MBSuccess);
#if defined(HAVE_HWSERIAL1)
  if (result == node.ku8MBSuccess) {
    for (uint8_t i = 0; i < 6; i++) {
      Serial.print(node.getResponseBuffer(i));
      Serial.print(' ');
    }
    Serial.println();
  } else {
    Serial.println(mbm_statusText(result));
  }
#endif
  delay(1000);
}
