"""The Arduino core of Debian's arduino-core-avr. Licence: MIT OR Apache-2.0."""
import os

from SCons.Script import DefaultEnvironment

CORE = "/usr/share/arduino/hardware/arduino/avr"
env = DefaultEnvironment()
board = env.BoardConfig()
env.Append(
    ASFLAGS=["-x", "assembler-with-cpp", "-mmcu=$BOARD_MCU"],
    CCFLAGS=["-mmcu=$BOARD_MCU", "-Os", "-flto", "-ffunction-sections", "-fdata-sections"],
    CFLAGS=["-std=gnu11"],
    CXXFLAGS=["-std=gnu++11", "-fno-exceptions", "-fno-threadsafe-statics", "-fpermissive"],
    # The core's strings need DECIMAL_DIG, which the compiler does not define.
    CPPDEFINES=[("F_CPU", "$BOARD_F_CPU"), ("ARDUINO", 10819), "ARDUINO_ARCH_AVR",
                ("DECIMAL_DIG", "__DECIMAL_DIG__")],
    CPPPATH=[os.path.join(CORE, "cores/arduino"), os.path.join(CORE, "variants", board.get("build.variant"))],
    # Libraries that come with the core, such as SoftwareSerial.
    LIBSOURCE_DIRS=[os.path.join(CORE, "libraries")],
    LINKFLAGS=["-mmcu=$BOARD_MCU", "-Os", "-flto", "-fuse-linker-plugin", "-Wl,--gc-sections"],
    LIBS=["m"])
env.Prepend(LIBS=[env.BuildLibrary("$BUILD_DIR/FrameworkArduino", os.path.join(CORE, "cores/arduino"))])
