#include "ESP8266WiFi.h"

/* Not in the header, which is also compiled for boards without Serial1; on those no sketch uses it. */
#if defined(HAVE_HWSERIAL1)
HardwareSerial &WiFiClass::uart()
{
    return Serial1;
}
#endif
