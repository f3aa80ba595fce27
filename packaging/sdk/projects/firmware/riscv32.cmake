# QEMU's RISC-V machine "virt".
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv32)
set(CMAKE_C_COMPILER riscv64-unknown-elf-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_C_FLAGS_INIT "-march=rv32imac -mabi=ilp32 -mcmodel=medany -msmall-data-limit=0 -Os -ffreestanding \
-ffunction-sections -fdata-sections -fno-tree-loop-distribute-patterns")
set(CMAKE_ASM_FLAGS_INIT "-march=rv32imac -mabi=ilp32")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-static -Wl,--gc-sections")

set(MACHINE virt)
set(SCRIPT loaded.ld)
set(PIECES uart/16550.c clock/mtime.c start/riscv.S)
