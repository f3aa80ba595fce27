/* See kernel.h. Licence: MIT OR Apache-2.0. */
#ifndef PRINTK_H
#define PRINTK_H

#include <stdio.h>

#define printk printf

#endif
