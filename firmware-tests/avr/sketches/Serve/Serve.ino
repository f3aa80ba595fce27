// Serves four arrays as unit 17, with hooks, a custom function, and functions 16 and 17.
// Serves holding registers alone as unit 18.
#include <ModbusServer.h>

uint16_t words[64];
uint8_t bits[8];
// 1 after the set-up; the last arguments of the hooks.
struct {
  uint8_t ready;
  uint8_t beforeCalls, afterCalls;
  uint16_t address, quantity;
} report;

ModbusRegisters holding(words, 100);
ModbusRegisterArray<64> readings(200);
ModbusBits coils(bits, 300);
ModbusBitArray<50> inputs(400);
ModbusRegisterArray<2> others;
ModbusUnit units[] = {{17}, {18}};
ModbusHooks hooks;
ModbusServer server;

uint8_t beforeWrite(const mbm_access &access) {
  report.beforeCalls++;
  return access.quantity == 1 && access.data[0] == 0xFF ? MBM_SERVER_DEVICE_BUSY : 0;
}

void afterWrite(const mbm_access &access) {
  report.afterCalls++;
  report.address = access.address;
  report.quantity = access.quantity;
}

// Function 65: the sum of the bytes, as a word.
uint16_t sum(const mbm_request &request, uint8_t *response, uint16_t capacity) {
  uint16_t all = 0;
  if (request.length == 0 || capacity < 2)
    return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
  for (uint16_t i = 0; i < request.length; i++)
    all += request.data[i];
  response[0] = all >> 8;
  response[1] = all;
  return 2;
}
ModbusFunction adder(65, sum);

void setup() {
  for (uint16_t i = 0; i < 64; i++)
    readings[i] = 1000 + i;
  for (uint16_t i = 0; i < 50; i += 3)
    inputs.set(i, true);
  hooks.beforeWrite(beforeWrite);
  hooks.afterWrite(afterWrite);
  holding.setHooks(hooks);
  units[0].holdingRegisters(holding);
  units[0].maskAndReadWrite(holding);
  units[0].inputRegisters(readings);
  units[0].coils(coils);
  units[0].discreteInputs(inputs);
  units[0].function(adder);
  units[1].holdingRegisters(others);
  Serial.begin(115200);
  server.begin(units, Serial, 115200);
  report.ready = 1;
}

void loop() {
  server.poll();
}
