/* Which classes of each core are serial ports over USB. ModbusUsb.h is included once for each core,
 * in a namespace of its own. */
extern "C" {
#include "test.h"
}

class HardwareSerial;

#define IS_USB(Class) static_assert(sizeof(ModbusPort<Class>::Usb) == 1, "it is over USB")
#define IS_WIRE(Class) static_assert(sizeof(ModbusPort<Class>::Wire) == 1, "it is not over USB")

namespace esp32 {
#define ARDUINO_ARCH_ESP32
#include "ModbusUsb.h"
IS_USB(HWCDC);
IS_USB(USBCDC);
IS_WIRE(HardwareSerial);
#undef ARDUINO_ARCH_ESP32
#undef MODBUSUSB_H
#undef MODBUS_USB_PORT
} // namespace esp32

namespace teensy {
#define TEENSYDUINO
#include "ModbusUsb.h"
IS_USB(usb_serial_class);
IS_USB(usb_serial2_class);
IS_USB(usb_serial3_class);
IS_WIRE(HardwareSerial);
#undef TEENSYDUINO
#undef MODBUSUSB_H
#undef MODBUS_USB_PORT
} // namespace teensy

namespace mbed {
#define ARDUINO_ARCH_MBED
#define ARDUINO_ARCH_RP2040
#include "ModbusUsb.h"
IS_USB(arduino::USBSerial);
IS_WIRE(HardwareSerial);
#undef ARDUINO_ARCH_MBED
#undef ARDUINO_ARCH_RP2040
#undef MODBUSUSB_H
#undef MODBUS_USB_PORT
} // namespace mbed

namespace pico {
#define ARDUINO_ARCH_RP2040
#define USE_TINYUSB
#include "ModbusUsb.h"
IS_USB(SerialUSB);
IS_USB(Adafruit_USBD_CDC);
IS_WIRE(HardwareSerial);
#undef ARDUINO_ARCH_RP2040
#undef USE_TINYUSB
#undef MODBUSUSB_H
#undef MODBUS_USB_PORT
} // namespace pico

namespace uno_r4 {
#define ARDUINO_ARCH_RENESAS
#include "ModbusUsb.h"
IS_USB(SerialUSB);
IS_WIRE(HardwareSerial);
#undef ARDUINO_ARCH_RENESAS
#undef MODBUSUSB_H
#undef MODBUS_USB_PORT
} // namespace uno_r4

namespace samd {
#define ARDUINO_ARCH_SAMD
#include "ModbusUsb.h"
IS_USB(Serial_);
IS_WIRE(HardwareSerial);
#undef ARDUINO_ARCH_SAMD
#undef MODBUSUSB_H
#undef MODBUS_USB_PORT
} // namespace samd

/* A core of which the library knows nothing: no port is taken for one over USB. */
namespace other {
#include "ModbusUsb.h"
IS_WIRE(HardwareSerial);
} // namespace other

TEST(the_classes_of_each_core_are_known)
{
    assert_int_equal(sizeof(other::ModbusPort<HardwareSerial>::Wire), 1);
}
