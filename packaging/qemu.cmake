# The toolchain of stand-ins that QEMU runs: Debian's compiler for the core STAND_IN_CORE, cortex-m or riscv, a C library
# that prints through a debugger, and the memory of the machine mps2-an385 or virt. STAND_IN_CPU has the options of the chip.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES STAND_IN_CORE STAND_IN_CPU)
if(STAND_IN_CORE STREQUAL "cortex-m")
    set(CMAKE_C_COMPILER arm-none-eabi-gcc)
    set(memory "__flash=0,--defsym=__ram=0x20000000")
else()
    set(CMAKE_C_COMPILER riscv64-unknown-elf-gcc)
    set(memory "__flash=0x80000000,--defsym=__ram=0x80400000")
endif()
set(CMAKE_C_FLAGS_INIT "${STAND_IN_CPU} --specs=picolibc.specs -Os -ffunction-sections")
set(CMAKE_ASM_FLAGS_INIT "${STAND_IN_CPU}")
set(CMAKE_EXE_LINKER_FLAGS_INIT "--crt0=hosted --oslib=semihost -Wl,--gc-sections \
-Wl,--defsym=${memory},--defsym=__flash_size=0x400000,--defsym=__ram_size=0x100000")
