"""Builds firmware with Debian's gcc-avr. Licence: MIT OR Apache-2.0."""
from SCons.Script import AlwaysBuild, Builder, Default, DefaultEnvironment

env = DefaultEnvironment()
env.Replace(
    AR="avr-gcc-ar", AS="avr-as", CC="avr-gcc", CXX="avr-g++", RANLIB="avr-gcc-ranlib", OBJCOPY="avr-objcopy",
    SIZETOOL="avr-size", SIZECHECKCMD="$SIZETOOL -A -d $SOURCES", SIZEPRINTCMD="$SIZETOOL -A -d $SOURCES",
    SIZEPROGREGEXP=r"^(?:\.text|\.data)\s+(\d+).*", SIZEDATAREGEXP=r"^(?:\.data|\.bss|\.noinit)\s+(\d+).*",
    PROGNAME="firmware", PROGSUFFIX=".elf")
env.Append(BUILDERS={"ElfToHex": Builder(
    action=env.VerboseAction("$OBJCOPY -O ihex -R .eeprom $SOURCES $TARGET", "Building $TARGET"), suffix=".hex")})
firmware = env.ElfToHex("$BUILD_DIR/${PROGNAME}", env.BuildProgram())
AlwaysBuild(env.Alias("buildprog", firmware, firmware))
Default([firmware])
