/* What the host reads of the device. A product has numbers and names of its own. */
#include "tusb.h"

#include <string.h>

enum { NUMBER_OF_INTERFACES = 2, LENGTH = TUD_CONFIG_DESC_LEN + TUD_CDC_DESC_LEN };

/* The class of a device with several interfaces. 1209:0001 are pid.codes' numbers for tests. */
static const tusb_desc_device_t device = {.bLength = sizeof device,
                                          .bDescriptorType = TUSB_DESC_DEVICE,
                                          .bcdUSB = 0x0200,
                                          .bDeviceClass = TUSB_CLASS_MISC,
                                          .bDeviceSubClass = MISC_SUBCLASS_COMMON,
                                          .bDeviceProtocol = MISC_PROTOCOL_IAD,
                                          .bMaxPacketSize0 = CFG_TUD_ENDPOINT0_SIZE,
                                          .idVendor = 0x1209,
                                          .idProduct = 0x0001,
                                          .bcdDevice = 0x0100,
                                          .iProduct = 1,
                                          .bNumConfigurations = 1};

static const uint8_t configuration[] = {
    TUD_CONFIG_DESCRIPTOR(1, NUMBER_OF_INTERFACES, 0, LENGTH, 0, 100),
    TUD_CDC_DESCRIPTOR(0, 0, 0x81, 8, 0x02, 0x82, 64)};

const uint8_t *tud_descriptor_device_cb(void)
{
    return (const uint8_t *)&device;
}

const uint8_t *tud_descriptor_configuration_cb(uint8_t index)
{
    (void)index;
    return configuration;
}

const uint16_t *tud_descriptor_string_cb(uint8_t index, uint16_t language)
{
    static const char product[] = "Modbus server";
    static uint16_t text[sizeof product];
    uint8_t length = index == 0 ? 1 : sizeof product - 1;

    (void)language;
    if (index > 1)
        return NULL;
    for (uint8_t i = 0; i < length; i++)
        text[1 + i] = index == 0 ? 0x0409 : (uint8_t)product[i];
    text[0] = (uint16_t)(TUSB_DESC_STRING << 8 | (2 * length + 2));
    return text;
}
