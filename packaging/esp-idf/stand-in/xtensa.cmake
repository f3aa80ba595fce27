# Debian's compiler for the ESP8266, with the macros of the compiler for ESP32, S2 and S3.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_C_COMPILER xtensa-lx106-elf-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(windowed "-mlongcalls -U__XTENSA_CALL0_ABI__ -D__XTENSA_WINDOWED_ABI__")
set(CMAKE_C_FLAGS_INIT "${windowed} -ffreestanding -Os -ffunction-sections")
set(CMAKE_ASM_FLAGS_INIT "${windowed}")
