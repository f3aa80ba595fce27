/* Names the target that a compiler builds for, from the compiler's own macros: the folder of
 * lib/ with its archive, "assembler" if only asm/ serves it, or "unknown". mbmConfig.cmake and
 * mbm.mk run the preprocessor over this file.
 *
 *     cc -mcpu=cortex-m4 -mthumb -E -P lib/target.h
 *
 * Licence: MIT OR Apache-2.0. */
#if defined(__AVR_ARCH__) && __AVR_ARCH__ == 5
MBM_TARGET "atmega328p"
#elif defined(__AVR_ARCH__) && __AVR_ARCH__ == 6
MBM_TARGET "atmega2560"
/* ATmega1284P, and the series 0, 1 and 2 from 16 KB. */
#elif defined(__AVR_ARCH__) &&                                                                     \
    (__AVR_ARCH__ == 51 || (__AVR_ARCH__ == 103 && defined(__AVR_HAVE_JMP_CALL__)))
MBM_TARGET "assembler"

#elif defined(__ARM_ARCH_6M__) || defined(__ARM_ARCH_8M_BASE__)
MBM_TARGET "cortex-m0"
#elif defined(__ARM_ARCH_7M__)
MBM_TARGET "cortex-m3"
#elif defined(__ARM_ARCH_7EM__)
MBM_TARGET "cortex-m4"
#elif defined(__ARM_ARCH_8M_MAIN__) || defined(__ARM_ARCH_8_1M_MAIN__)
MBM_TARGET "cortex-m33"

#elif defined(__riscv) && __riscv_xlen == 32 && defined(__riscv_mul) && !defined(__riscv_32e)
/* The linker accepts an archive for soft float only beside other objects for soft float. */
#if !defined(__riscv_float_abi_soft) || !defined(__riscv_compressed)
MBM_TARGET "assembler"
#elif defined(__riscv_atomic)
MBM_TARGET "riscv32imac"
#else
MBM_TARGET "riscv32imc"
#endif

#elif defined(__XTENSA_CALL0_ABI__)
MBM_TARGET "esp8266"
#elif defined(__XTENSA_WINDOWED_ABI__)
MBM_TARGET "esp32"

#elif defined(__linux__) && defined(__x86_64__) && !defined(__ILP32__)
MBM_TARGET "x86_64-linux-gnu"
#elif defined(__linux__) && defined(__aarch64__) && !defined(__ILP32__)
MBM_TARGET "aarch64-linux-gnu"
#else
MBM_TARGET "unknown"
#endif
