// What a sketch costs that only uses the serial port: the size of others is
// counted from here.
void setup() { Serial.begin(19200); }

void loop() {
  if (Serial.available())
    Serial.write(Serial.read());
}
