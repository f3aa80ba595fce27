"""Chooses the code of mbm for the target of a PlatformIO project.

Firmware gets the assembler source, src/mbm_*.S. Each file tests the macros of the compiler, and
only the one for the processor has code. For a program that runs on Linux there is no assembler
source: it gets the archive in lib/, and the ports for sockets and serial lines in src/linux.

Licence: MIT OR Apache-2.0.
"""

import os
import shlex
import subprocess
import sys

Import("env", "pio_lib_builder")  # noqa: F821

LIBRARY = pio_lib_builder.path  # noqa: F821
# The macro of each processor for which a Linux archive may be in lib/.
PROCESSORS = {"__x86_64__": "x86_64", "__i386__": "i386", "__aarch64__": "aarch64", "__arm__": "arm",
              "__riscv": "riscv64", "__powerpc64__": "powerpc64le"}
SYSTEMS = {"__linux__": "Linux", "__APPLE__": "macOS", "_WIN32": "Windows"}


def flags(*names):
    return [flag for name in names for flag in env.subst(f"${name}").split()]  # noqa: F821


# The flags that select the processor.
machine = [flag for flag in flags("CCFLAGS", "CFLAGS") if flag.startswith(("-m", "--target="))]


def macros():
    """The compiler's macros. There are none if it does not run: then compiling says why."""
    # A path of Windows has backslashes, which shlex must keep.
    compiler = [word.strip('"') for word in shlex.split(env.subst("$CC"), posix=os.name != "nt")]  # noqa: F821
    command = [*compiler, *machine, "-dM", "-E", "-x", "c", "-"]
    variables = {name: str(value) for name, value in env["ENV"].items()}  # noqa: F821
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              text=True, env=variables, check=True)
    except (OSError, subprocess.CalledProcessError):
        return set()
    return {line.split()[1] for line in done.stdout.splitlines()}


def use_archive(system, processor):
    archives = os.path.join(LIBRARY, "lib")
    archive = os.path.join(archives, f"{processor}-linux-gnu", "libmbm.a")
    if system != "Linux" or not os.path.isfile(archive):
        known = ", ".join(name.split("-")[0] for name in sorted(os.listdir(archives)))
        sys.stderr.write(f"Error: mbm has no archive for programs on {system}, processor {processor}. "
                         f"Supported: Linux on {known}, and the boards in {os.path.join(LIBRARY, 'README.md')}.\n")
        env.Exit(1)  # noqa: F821
    ports = os.path.join(LIBRARY, "src", "linux")
    env.Replace(SRC_FILTER=["-<*>", "+<linux/*.c>"])  # noqa: F821
    env.Append(CPPPATH=[ports], LIBS=[env.File(archive)], LINKFLAGS=["-Wl,--gc-sections"])  # noqa: F821


defined = macros()
system = next((name for macro, name in SYSTEMS.items() if macro in defined), None)
if system:
    use_archive(system, next((name for macro, name in PROCESSORS.items() if macro in defined), "unknown"))
else:
    env.Replace(SRC_FILTER=["+<*>", "-<linux/>"])  # noqa: F821
    # Some platforms pass these flags to the compiler only.
    given = flags("ASPPFLAGS")
    env.Append(ASPPFLAGS=[flag for flag in machine if flag not in given])  # noqa: F821
    if "__AVR__" in defined:
        # The linker shortens calls and jumps, also those of the sketch and of its core.
        env.Append(LINKFLAGS=["-mrelax"])  # noqa: F821
