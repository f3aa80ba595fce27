/* Plays Zephyr's flags for pins, which an overlay has to include. Licence: MIT OR Apache-2.0. */
#define GPIO_ACTIVE_HIGH 0
