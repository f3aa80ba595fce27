/* See mbm_pico.h. Licence: MIT OR Apache-2.0. */
#include "mbm_pico.h"

#include "pico/time.h"
#include "tusb.h"

/* Lets TinyUSB work. Returns false if the link is lost. */
static bool is_up(mbm_picoUsb *usb)
{
    bool isOpen, wasOpen = usb->wasOpen;

    /* tud_task would wait for an event on an operating system. */
    if (!usb->hasOwnTask)
        tud_task_ext(0, false);
    isOpen = tud_cdc_n_connected(usb->number);
    usb->wasOpen = isOpen;
    if (wasOpen && !isOpen) {
        /* The next program on the host must not get what this one did not read. */
        tud_cdc_n_read_flush(usb->number);
        tud_cdc_n_write_clear(usb->number);
        return false;
    }
    return tud_ready();
}

static int16_t usb_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_picoUsb *usb = context;

    if (!is_up(usb))
        return -1;
    return (int16_t)tud_cdc_n_read(usb->number, bytes, capacity);
}

static int16_t usb_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_picoUsb *usb = context;
    uint32_t space;

    if (!is_up(usb))
        return -1;
    /* While no program has opened the port, TinyUSB would overwrite older bytes. */
    space = tud_cdc_n_write_available(usb->number);
    if (length > space)
        length = (uint16_t)space;
    length = (uint16_t)tud_cdc_n_write(usb->number, bytes, length);
    tud_cdc_n_write_flush(usb->number);
    return (int16_t)length;
}

/* A packet that is full is followed by an empty one: TinyUSB sends it. */
static uint8_t usb_flush(void *context)
{
    mbm_picoUsb *usb = context;

    if (!is_up(usb))
        return 1;
    tud_cdc_n_write_flush(usb->number);
    return tud_cdc_n_write_available(usb->number) >= CFG_TUD_CDC_TX_BUFSIZE;
}

static uint32_t usb_micros(void *context)
{
    (void)context;
    return time_us_32();
}

uint8_t mbm_picoUsb_open(mbm_picoUsb *usb, mbm_port *port)
{
    static const mbm_port hooks = {
        .read = usb_read, .write = usb_write, .micros = usb_micros, .flush = usb_flush};

    if (usb == NULL || port == NULL || usb->number >= CFG_TUD_CDC)
        return MBM_INVALID_ARGUMENT;
    usb->wasOpen = false;
    *port = hooks;
    port->context = usb;
    return MBM_OK;
}
