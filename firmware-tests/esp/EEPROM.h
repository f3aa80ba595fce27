/* The EEPROM that an ESP keeps in flash, as declarations for firmware-tests/avr/check-sketches. */
#ifndef ESP_EEPROM_H
#define ESP_EEPROM_H

#include "Arduino.h"

class EEPROMClass {
public:
    bool begin(size_t size);
    uint8_t read(int address);
    void write(int address, uint8_t value);
    bool commit();
};
extern EEPROMClass EEPROM;

#endif
