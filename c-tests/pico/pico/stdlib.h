#include "pico/time.h"
