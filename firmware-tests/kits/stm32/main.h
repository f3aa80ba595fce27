/* The header that CubeMX makes, for four chips of different families. */
#ifndef MAIN_H
#define MAIN_H

#if defined(STM32F103xB)
#include "stm32f1xx_hal.h"
#elif defined(STM32F405xx)
#include "stm32f4xx_hal.h"
#elif defined(STM32G071xx)
#include "stm32g0xx_hal.h"
#elif defined(STM32H743xx)
#include "stm32h7xx_hal.h"
#endif

/* QEMU plays no GPIO, and the port would say so. */
#ifndef WITHOUT_DMA
#define DRIVER_GPIO_Port GPIOA
#define DRIVER_Pin GPIO_PIN_8
#else
#define MBM_STM32_BY_DMA 0
#endif

extern UART_HandleTypeDef huart1;

void Error_Handler(void);

#endif
