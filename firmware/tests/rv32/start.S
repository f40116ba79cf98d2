// From reset on QEMU's virt machine to main() and out again: stack, bss, constructors, exit with main's value.
    .section .init, "ax"
    .globl _start
_start:
    la sp, stack_top
    la t0, bss_begin
    la t1, bss_end
1:  bgeu t0, t1, 2f
    sw zero, 0(t0)
    addi t0, t0, 4
    j 1b
2:  la s0, constructors_begin
    la s1, constructors_end
3:  bgeu s0, s1, 4f
    lw t0, 0(s0)
    jalr t0
    addi s0, s0, 4
    j 3b
4:  call main
    call finish
