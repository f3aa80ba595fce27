/* See mbm_pico.h. Licence: MIT OR Apache-2.0. */
#include "mbm_pico.h"

#include "pico/time.h"
#include "tusb.h"

/* Microseconds in which the host must take a byte of those that wait. */
enum { PATIENCE = 1000000 };

/* Drops the bytes that wait for the host. The next read or write reports it. */
static void fail(mbm_picoUsb *usb)
{
    tud_cdc_n_write_clear(usb->number);
    usb->hasFailed = true;
}

/* Lets TinyUSB work. */
static void work(mbm_picoUsb *usb)
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
        fail(usb);
    }
}

/* Drops a frame of which the host takes nothing. Returns how many bytes TinyUSB takes. */
static uint32_t space_of(mbm_picoUsb *usb)
{
    const uint32_t space = tud_cdc_n_write_available(usb->number), now = time_us_32();

    if (space != usb->space || space >= CFG_TUD_CDC_TX_BUFSIZE) {
        usb->space = space;
        usb->since = now;
    } else if (now - usb->since >= PATIENCE) {
        usb->stalled++;
        fail(usb);
    }
    return space;
}

static bool is_lost(mbm_picoUsb *usb)
{
    const bool hasFailed = usb->hasFailed;

    usb->hasFailed = false;
    return hasFailed || !tud_ready();
}

static int16_t usb_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_picoUsb *usb = context;

    work(usb);
    if (is_lost(usb))
        return -1;
    return (int16_t)tud_cdc_n_read(usb->number, bytes, capacity);
}

static int16_t usb_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_picoUsb *usb = context;
    uint32_t space;

    work(usb);
    /* While no program has opened the port, TinyUSB would overwrite older bytes. */
    space = space_of(usb);
    if (is_lost(usb))
        return -1;
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

    work(usb);
    tud_cdc_n_write_flush(usb->number);
    return space_of(usb) >= CFG_TUD_CDC_TX_BUFSIZE || usb->hasFailed || !tud_ready();
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
    usb->wasOpen = usb->hasFailed = false;
    usb->stalled = 0;
    usb->since = time_us_32();
    *port = hooks;
    port->context = usb;
    return MBM_OK;
}
