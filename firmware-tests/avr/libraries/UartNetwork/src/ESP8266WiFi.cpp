#include "ESP8266WiFi.h"

/* Not in the header, which is also compiled for boards without Serial1. */
HardwareSerial &WiFiClass::uart()
{
    return Serial1;
}
