/* The callbacks of the HAL for all UARTs, for a program that has none of its own. See mbm_stm32.h.
 * Licence: MIT OR Apache-2.0. */
#include "mbm_stm32.h"

#if !defined(USE_HAL_UART_REGISTER_CALLBACKS) || !USE_HAL_UART_REGISTER_CALLBACKS

void HAL_UART_TxCpltCallback(UART_HandleTypeDef *huart)
{
    mbm_stm32_noteTransmitted(huart);
}

void HAL_UART_RxCpltCallback(UART_HandleTypeDef *huart)
{
    mbm_stm32_noteReceived(huart);
}

void HAL_UARTEx_RxEventCallback(UART_HandleTypeDef *huart, uint16_t Size)
{
    (void)Size;
    mbm_stm32_noteReceived(huart);
}

void HAL_UART_ErrorCallback(UART_HandleTypeDef *huart)
{
    mbm_stm32_noteError(huart);
}

#endif
