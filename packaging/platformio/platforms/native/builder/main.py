"""Builds a program with gcc of this machine. Licence: MIT OR Apache-2.0."""
from SCons.Script import AlwaysBuild, Default, DefaultEnvironment

env = DefaultEnvironment()
program = env.BuildProgram()
AlwaysBuild(env.Alias("buildprog", program, program))
Default([program])
