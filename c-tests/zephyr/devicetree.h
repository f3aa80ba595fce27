/* The devicetree of the board of packaging/zephyr/stand-in, in tests on this machine. */
#ifndef DEVICETREE_H
#define DEVICETREE_H

#define STAND_IN_UART "/uart"
#define STAND_IN_GPIO "/gpio"
#define STAND_IN_CURRENT_SPEED 19200
#define STAND_IN_PIN 15
#define STAND_IN_FLAGS 0

#endif
