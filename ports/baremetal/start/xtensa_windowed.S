/* Start-up of an Xtensa core with register windows, whose image is loaded into RAM. On an
 * ESP32 the ROM and the system have all this.
 * Licence: MIT OR Apache-2.0. */

/* The assembler does not know the simulator's instruction. */
    .macro SIMCALL
    .byte 0x00, 0x51, 0x00
    .endm

/* Register windows that do not fit are saved below the stacks of the callers: the first
 * four registers directly below, the others further down. The core defines the addresses of
 * these handlers. */
    .section .vectors, "ax"
    .balign 1024
vectors:
    s32e a0, a5, -16
    s32e a1, a5, -12
    s32e a2, a5, -8
    s32e a3, a5, -4
    rfwo

    .org 0x40
refill4:
    l32e a0, a5, -16
    l32e a1, a5, -12
    l32e a2, a5, -8
    l32e a3, a5, -4
    rfwu

    .org 0x80
    s32e a0, a9, -16
    l32e a0, a1, -12
    s32e a1, a9, -12
    s32e a2, a9, -8
    s32e a3, a9, -4
    s32e a4, a0, -32
    s32e a5, a0, -28
    s32e a6, a0, -24
    s32e a7, a0, -20
    rfwo

    .org 0xC0
refill8:
    l32e a0, a9, -16
    l32e a1, a9, -12
    l32e a2, a9, -8
    l32e a7, a1, -12
    l32e a3, a9, -4
    l32e a4, a7, -32
    l32e a5, a7, -28
    l32e a6, a7, -24
    l32e a7, a7, -20
    rfwu

    .org 0x100
    s32e a0, a13, -16
    l32e a0, a1, -12
    s32e a1, a13, -12
    s32e a2, a13, -8
    s32e a3, a13, -4
    s32e a4, a0, -48
    s32e a5, a0, -44
    s32e a6, a0, -40
    s32e a7, a0, -36
    s32e a8, a0, -32
    s32e a9, a0, -28
    s32e a10, a0, -24
    s32e a11, a0, -20
    rfwo

    .org 0x140
refill12:
    l32e a0, a13, -16
    l32e a1, a13, -12
    l32e a2, a13, -8
    l32e a11, a1, -12
    l32e a3, a13, -4
    l32e a4, a11, -48
    l32e a5, a11, -44
    l32e a6, a11, -40
    l32e a7, a11, -36
    l32e a8, a11, -32
    l32e a9, a11, -28
    l32e a10, a11, -24
    l32e a11, a11, -20
    rfwu

/* movsp moves the stack while the caller's window may be saved below it. The window is
 * restored as if we returned to the caller; then movsp is executed again. */
    .org 0x180
refill:
    wsr a2, excsave2
    wsr a3, excsave3
    rsr a2, ps
    extui a3, a2, 8, 4
    slli a3, a3, 8
    xor a2, a2, a3
    rsr a3, windowbase
    slli a3, a3, 8
    or a2, a2, a3
    wsr a2, ps
    rsync
    rsr a3, excsave3
    rsr a2, excsave2
    rsr a0, excsave1
    bbci a0, 31, 1f
    bbci a0, 30, 2f
    rotw -3
    j refill12
1:  rotw -1
    j refill4
2:  rotw -2
    j refill8

/* A fault ends the program with exit code 200 plus the cause. */
    .org 0x300
    wsr a0, excsave1
    rsr a0, exccause
    addi a0, a0, -5
    bnez a0, 3f
    j refill
3:  movi a3, 205
    add a3, a3, a0
    movi a2, 1
    SIMCALL

    .org 0x3C0
    movi a3, 254
    movi a2, 1
    SIMCALL

    .section .start, "ax"
    .balign 4
address_of_vectors: .long vectors
address_of_stack: .long stack_top
address_of_bss: .long bss_start
address_of_bss_end: .long bss_end
address_of_main: .long main
address_of_exit: .long console_exit
enable_windows: .long 1 << 18
    .globl start
    .balign 4
start:
    movi a2, 0
    wsr a2, windowbase
    rsync
    movi a2, 1
    wsr a2, windowstart
    rsync
    l32r a2, address_of_vectors
    wsr a2, vecbase
    l32r a2, enable_windows
    wsr a2, ps
    rsync
    l32r a1, address_of_stack
    l32r a2, address_of_bss
    l32r a3, address_of_bss_end
    movi a4, 0
1:  bgeu a2, a3, 2f
    s32i a4, a2, 0
    addi a2, a2, 4
    j 1b
2:  movi a0, 0
    l32r a8, address_of_main
    callx8 a8
    extui a10, a10, 0, 8
    l32r a8, address_of_exit
    callx8 a8

    .text
    .globl simcall
    .balign 4
simcall:
    entry a1, 16
    SIMCALL
    retw
    .section .note.GNU-stack, "", @progbits
