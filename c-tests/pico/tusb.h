/* What the port for the Pico uses of TinyUSB, played by pico_model.c. */
#ifndef PICO_MODEL_TUSB_H
#define PICO_MODEL_TUSB_H

#include <stdbool.h>
#include <stdint.h>

#define CFG_TUD_CDC 1
#define CFG_TUD_CDC_TX_BUFSIZE 64

bool tusb_init(void);
void tud_task_ext(uint32_t most, bool inInterrupt);
bool tud_ready(void);
bool tud_cdc_n_connected(uint8_t number);
uint32_t tud_cdc_n_read(uint8_t number, void *bytes, uint32_t capacity);
void tud_cdc_n_read_flush(uint8_t number);
uint32_t tud_cdc_n_write(uint8_t number, const void *bytes, uint32_t length);
uint32_t tud_cdc_n_write_available(uint8_t number);
uint32_t tud_cdc_n_write_flush(uint8_t number);
bool tud_cdc_n_write_clear(uint8_t number);

#endif
