/**
 * @file ModbusUsb.h
 * @brief Which classes of ports are serial ports over USB.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h, ModbusServer.h and ModbusClient.h.
 */

#ifndef MODBUSUSB_H
#define MODBUSUSB_H

#include <stdint.h>

/** @cond a port is on a wire, unless its class is one of those that follow */
struct ModbusOverWire {};
struct ModbusOverUsb {};
template <typename Port> struct ModbusPort {
    typedef ModbusOverWire Kind;
    typedef uint8_t Wire;
};
#define MODBUS_USB_PORT(Class)                                                                     \
    template <> struct ModbusPort<Class> {                                                         \
        typedef ModbusOverUsb Kind;                                                                \
        typedef uint8_t Usb;                                                                       \
    }

// The classes of the cores. A core whose object has the name of a class may define a macro for it.
#if defined(ARDUINO_ARCH_ESP32)
class HWCDC;
class USBCDC;
MODBUS_USB_PORT(HWCDC);
MODBUS_USB_PORT(USBCDC);
#elif defined(TEENSYDUINO)
class usb_serial_class;
class usb_serial2_class;
class usb_serial3_class;
MODBUS_USB_PORT(usb_serial_class);
MODBUS_USB_PORT(usb_serial2_class);
MODBUS_USB_PORT(usb_serial3_class);
#elif defined(ARDUINO_ARCH_STM32)
class USBSerial;
MODBUS_USB_PORT(USBSerial);
#elif defined(ARDUINO_ARCH_MBED)
namespace arduino {
class USBSerial;
}
MODBUS_USB_PORT(arduino::USBSerial);
#elif (defined(ARDUINO_ARCH_RP2040) || defined(ARDUINO_ARCH_RENESAS)) && !defined(SerialUSB)
class SerialUSB;
MODBUS_USB_PORT(SerialUSB);
#elif defined(ARDUINO_ARCH_AVR) || defined(ARDUINO_ARCH_SAMD) || defined(ARDUINO_ARCH_SAM)
class Serial_;
MODBUS_USB_PORT(Serial_);
#endif
// Adafruit's library for USB, which several cores have.
#if defined(USE_TINYUSB) || defined(ARDUINO_NRF52_ADAFRUIT)
class Adafruit_USBD_CDC;
MODBUS_USB_PORT(Adafruit_USBD_CDC);
#endif
/** @endcond */

#endif
