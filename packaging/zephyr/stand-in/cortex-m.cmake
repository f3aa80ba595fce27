# Debian's compiler for Arm, a C library that prints through a debugger, and the memory of QEMU's
# machine "mps2-an385", a Cortex-M3.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_C_FLAGS_INIT "-mthumb -mcpu=cortex-m3 --specs=picolibc.specs -Os -ffunction-sections")
set(CMAKE_ASM_FLAGS_INIT "-mthumb -mcpu=cortex-m3")
set(CMAKE_EXE_LINKER_FLAGS_INIT "--crt0=hosted --oslib=semihost -Wl,--gc-sections \
-Wl,--defsym=__flash=0,--defsym=__flash_size=0x400000 \
-Wl,--defsym=__ram=0x20000000,--defsym=__ram_size=0x100000")
