/* EspSoftwareSerial, as declarations for firmware-tests/avr/check-sketches. */
#ifndef ESP_SOFTWARE_SERIAL_H
#define ESP_SOFTWARE_SERIAL_H

#include "Arduino.h"

#define SWSERIAL_8N1 0
#define SWSERIAL_8N2 1

class SoftwareSerial : public Stream {
public:
    SoftwareSerial();
    SoftwareSerial(int8_t rx, int8_t tx = -1, bool invert = false);
    using Print::write;
    void begin(uint32_t baud, int config = SWSERIAL_8N1);
    void begin(uint32_t baud, int config, int8_t rx, int8_t tx = -1, bool invert = false);
    int available() override;
    int read() override;
    int peek() override;
    void flush() override;
    size_t write(uint8_t value) override;
    operator bool() const;
};

#endif
