/* See esp_err.h. Licence: MIT OR Apache-2.0. */
#pragma once

#define UART_FRM_ERR_INT_ENA (1u << 3)
