/* What CubeMX's main.c calls. Licence: MIT OR Apache-2.0. */
#ifndef APP_H
#define APP_H

void app_setup(void); /* once, in USER CODE 2: after the UART is initialised */
void app_loop(void);  /* again and again, in USER CODE 3 */

#endif
