/* Start-up of a RISC-V core whose image is loaded into RAM. Licence: MIT OR Apache-2.0. */
    .section .start, "ax"
    .globl start
start:
    .option push
    .option norelax
    la gp, __global_pointer$
    .option pop
    la sp, stack_top
    la t0, bss_start
    la t1, bss_end
1:  bgeu t0, t1, 2f
    sw zero, 0(t0)
    addi t0, t0, 4
    j 1b
2:  call main
    andi a0, a0, 0xff
    call console_exit
