"""Builds firmware with Debian's gcc-arm-none-eabi. Licence: MIT OR Apache-2.0."""
from SCons.Script import AlwaysBuild, Default, DefaultEnvironment

env = DefaultEnvironment()
# The flags of the processor go to the compiler only, as on some platforms: the assembler does not
# get them from here.
processor = env.BoardConfig().get("build.processor").split()
env.Replace(
    AR="arm-none-eabi-gcc-ar", AS="arm-none-eabi-as", CC="arm-none-eabi-gcc", CXX="arm-none-eabi-g++",
    RANLIB="arm-none-eabi-gcc-ranlib", PROGNAME="firmware", PROGSUFFIX=".elf",
    ASFLAGS=["-x", "assembler-with-cpp"], CCFLAGS=[*processor, "-Os", "-ffunction-sections", "-fdata-sections"],
    LINKFLAGS=[*processor, "-Os", "--specs=nano.specs", "-nostartfiles", "-Wl,--gc-sections"])
firmware = env.BuildProgram()
AlwaysBuild(env.Alias("buildprog", firmware, firmware))
Default([firmware])
