// A sketch that only uses the serial port. The sizes of other sketches are counted above
// its size.
void setup() { Serial.begin(19200); }

void loop() {
  if (Serial.available())
    Serial.write(Serial.read());
}
