// Logs a sensor without delay: reads it ten times a second, and once a second stores the
// mean of the values. RAM holds the last 30 means. On a board with a second UART the sketch
// also prints each entry: seconds, mean, number of replies, number of failures.
#include <ModbusClient.h>

#if defined(__AVR_ATmega328P__) || defined(__AVR_ATmega168__) || defined(ESP8266) || \
    defined(ARDUINO_ARCH_STM32)
#define BUS Serial // there may be no other UART: disconnect the bus from it to upload
#else
#define BUS Serial1 // Serial stays free for messages
#define MESSAGES
#endif

const uint8_t led = 13; // on while the last mean is above the mean of all stored means
const uint16_t sensorAt = 2;

struct Entry {
  unsigned long seconds;
  uint16_t mean;
  uint8_t readings;
};

Entry entries[30];
uint8_t next, kept;
uint32_t sum;
uint8_t readings, failures;

ModbusSerialClient client;
ModbusRequestOf<1> sensor(1);

uint16_t meanOfAll() {
  uint32_t all = 0;
  for (uint8_t i = 0; i < kept; i++)
    all += entries[i].mean;
  return kept > 0 ? all / kept : 0;
}

void store(unsigned long now) {
  const uint8_t size = sizeof entries / sizeof entries[0];
  Entry &entry = entries[next];
  next = (next + 1) % size;
  if (kept < size)
    kept++;
  entry.seconds = now / 1000;
  entry.mean = readings > 0 ? sum / readings : 0;
  entry.readings = readings;
  digitalWrite(led, entry.mean > meanOfAll());
#if defined(MESSAGES)
  Serial.print(entry.seconds);
  Serial.print(',');
  Serial.print(entry.mean);
  Serial.print(',');
  Serial.print(entry.readings);
  Serial.print(',');
  Serial.println(failures);
#endif
  sum = 0;
  readings = failures = 0;
}

void setup() {
  pinMode(led, OUTPUT);
#if defined(MESSAGES)
  Serial.begin(115200);
#endif
  BUS.begin(19200);
  client.begin(BUS, 19200);
  client.setResponseTimeout(80);
  sensor.onDone([](ModbusRequest &reply) {
    if (reply.status() == MBM_OK) {
      sum += reply[0];
      readings++;
    } else {
      failures++;
    }
  });
}

void loop() {
  static unsigned long lastRequest = 0, lastStore = 0;
  const unsigned long now = millis();
  if (now - lastRequest >= 100) {
    lastRequest += 100;
    client.readInputRegisters(sensor, sensorAt, 1); // refused while the last request is pending
  }
  if (now - lastStore >= 1000) {
    lastStore += 1000;
    store(now);
  }
  client.poll();
}
