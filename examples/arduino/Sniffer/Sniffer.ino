// Prints each frame of a bus on one line. Connect the receiver of a transceiver and keep its
// driver off, since the sketch never sends. Messages are printed at a higher speed than that
// bits per second on the bus, so that no byte of the bus is lost meanwhile.
#include <ModbusSniffer.h>

const uint32_t baud = 9600; // bits per second on the bus
const uint8_t led = 13;     // on after a request without a reply, until the next reply

ModbusSniffer sniffer;

void setup() {
  pinMode(led, OUTPUT);
#if defined(HAVE_HWSERIAL1) || defined(ESP32)
  Serial1.begin(baud);
  sniffer.begin(Serial1, baud);
  Serial.begin(115200);
#else
  // A board with one UART prints at the speed of the bus. On a busy bus it loses bytes.
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
