# An STM32F405 (Cortex-M4F) as on the Netduino Plus 2, which QEMU plays.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR cortex-m4)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_C_FLAGS_INIT "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -Os -ffreestanding \
-ffunction-sections -fdata-sections -fno-tree-loop-distribute-patterns")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-static -Wl,--gc-sections")

set(MACHINE netduinoplus2)
set(SCRIPT cortex-m.ld)
set(PIECES uart/stm32f4.c clock/systick.c start/cortex_m.c)
