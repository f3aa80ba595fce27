/* Plays the parts of ESP-IDF that mbm's port and example use, with the signatures of ESP-IDF 5.
 * Licence: MIT OR Apache-2.0. */
#pragma once

void abort(void);

typedef int esp_err_t;

#define ESP_OK 0
#define ESP_FAIL (-1)
#define ESP_ERR_INVALID_ARG 0x102
#define ESP_ERR_INVALID_STATE 0x103
#define ESP_ERR_TIMEOUT 0x107

#define ESP_ERROR_CHECK(call) ((call) == ESP_OK ? (void)0 : abort())
