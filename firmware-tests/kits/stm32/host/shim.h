/* What CMSIS takes from a compiler for Arm, for ST's HAL on this machine. Included before
 * everything else. */
#ifndef SHIM_H
#define SHIM_H

#define __CMSIS_COMPILER_H
#define __ASM __asm
#define __INLINE inline
#define __STATIC_INLINE static inline
#define __STATIC_FORCEINLINE static inline
#define __NO_RETURN __attribute__((noreturn))
#define __USED __attribute__((used))
#define __WEAK __attribute__((weak))
#define __PACKED __attribute__((packed))
#define __ALIGNED(x) __attribute__((aligned(x)))
#define __RESTRICT restrict
#define __COMPILER_BARRIER() ((void)0)

/* Interrupts come in only between calls of the program. */
#define __disable_irq() ((void)0)
#define __enable_irq() ((void)0)
#define __get_PRIMASK() 0u
#define __set_PRIMASK(x) ((void)(x))
#define __DSB() ((void)0)
#define __ISB() ((void)0)
#define __DMB() ((void)0)
#define __NOP() ((void)0)
#define __WFI() ((void)0)
#define __LDREXW(address) (*(volatile unsigned *)(address))
#define __STREXW(value, address) (*(volatile unsigned *)(address) = (value), 0u)
#define __CLREX() ((void)0)
#define __CLZ(x) ((unsigned char)((x) ? __builtin_clz(x) : 32))

#endif
