"""Plays the module of RT-Thread's build that SConscript files import. `options` are the names that
rtconfig.h defines, set by SConstruct."""

import os

from SCons.Script import *  # noqa: F401, F403 the SConscript files rely on it
import SCons.Script

options = set()
env = None


def GetCurrentDir() -> str:
    return os.path.dirname(SCons.Script.File("SConscript").rfile().abspath)


def GetDepend(depend) -> bool:
    return all(name in options for name in ([depend] if isinstance(depend, str) else depend))


def DefineGroup(name: str, src: list, depend, **parameters) -> list:
    unknown = set(parameters) - {"CPPPATH", "CPPDEFINES", "CCFLAGS", "LOCAL_CCFLAGS", "LIBS", "LIBPATH"}
    if unknown:
        raise SystemExit(f"DefineGroup has no {unknown}")
    if not GetDepend(depend):
        return []
    env.AppendUnique(CPPPATH=parameters.get("CPPPATH", []))
    return [env.Object(source) for source in src]
