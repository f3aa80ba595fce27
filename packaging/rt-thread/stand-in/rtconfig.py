"""Writes rtconfig.h from Kconfig files, without the prefix CONFIG_, as RT-Thread's tools do.

    rtconfig.py KCONFIG OPTIONS HEADER
"""

import os
import sys

os.environ["CONFIG_"] = ""
import kconfiglib  # noqa: E402

found = kconfiglib.Kconfig(sys.argv[1], warn_to_stderr=False)
found.warn_assign_undef = True
found.load_config(sys.argv[2])
wrong = list(found.warnings)
for symbol in found.unique_defined_syms:
    if symbol.user_value is not None and symbol.type in (kconfiglib.BOOL, kconfiglib.TRISTATE) \
            and symbol.user_value != symbol.tri_value:
        wrong.append(f"{symbol.name} lacks a dependency")
if wrong:
    sys.exit("rtconfig: " + "; ".join(wrong))
found.write_autoconf(sys.argv[3])
