/* Start-up of an Xtensa core without register windows, whose image is loaded into RAM.
 * Licence: MIT OR Apache-2.0. */
    .section .start, "ax"
    .literal_position
    .globl start
    .align 4
start:
    movi a1, stack_top
    movi a2, bss_start
    movi a3, bss_end
    movi a4, 0
1:  bgeu a2, a3, 2f
    s32i a4, a2, 0
    addi a2, a2, 4
    j 1b
2:  call0 main
    extui a2, a2, 0, 8
    call0 console_exit

    .text
    .globl simcall
    .align 4
simcall:
    simcall
    ret
