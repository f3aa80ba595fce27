// Prints what others say on a bus, one line for each frame. Connect the receiver of a
// transceiver, with its driver off: nothing is ever sent. The messages are faster than the
// bus, so that none of its bytes is lost meanwhile.
#include <ModbusSniffer.h>

const uint32_t baud = 9600; // of the bus
const uint8_t led = 13;     // on from a request that was not answered to the next reply

ModbusSniffer sniffer;

void setup() {
  pinMode(led, OUTPUT);
#if defined(HAVE_HWSERIAL1) || defined(ESP32)
  Serial1.begin(baud);
  sniffer.begin(Serial1, baud);
  Serial.begin(115200);
#else
  // One UART: it receives the bus, and prints at the same speed. A busy bus is too fast.
  Serial.begin(baud);
  sniffer.begin(Serial, baud);
#endif
  sniffer.printTo(Serial);
  sniffer.onEvent([](const mbm_event &event) {
    if (event.kind == MBM_EVENT_TIMEOUT)
      digitalWrite(led, HIGH);
    else if (event.kind == MBM_EVENT_REPLY)
      digitalWrite(led, LOW);
  });
}

void loop() { sniffer.poll(); }
