// Requests at seven rates. No object is told a rate, and begin is called before the port has one.
#include <ModbusMaster.h>

#if defined(HAVE_HWSERIAL1)
#define BUS Serial1
#else
#define BUS Serial
#endif

ModbusMaster first, second;
volatile uint8_t done, failed;

const unsigned long rates[] = {9600, 1200, 250000, 2400, 115200, 19200, 57600};

void setup() {
  first.begin(1, BUS);
  second.begin(2, BUS);
  for (unsigned long rate : rates) {
    BUS.begin(rate);
    failed |= first.readHoldingRegisters(0, 10);
    failed |= first.writeSingleRegister(7, 1);
    failed |= second.writeMultipleRegisters(20, 40); // longer than the core's buffer
    failed |= first.readHoldingRegisters(0, 1);
  }
  done = 1;
}

void loop() {}
