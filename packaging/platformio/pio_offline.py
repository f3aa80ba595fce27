"""Runs PlatformIO without its network: `pio pkg pack` asks for SPDX's list of licences, and gets the
copy of it that the PyPI package `packaging` has. Everything else is PlatformIO's own code.

Licence: MIT OR Apache-2.0.
"""

import sys

from packaging.licenses import _spdx
from platformio.__main__ import main
from platformio.package.manifest.schema import ManifestSchema

LICENCES = {"licenses": [{"licenseId": row["id"]} for row in _spdx.LICENSES.values()]}
ManifestSchema.load_spdx_licenses = staticmethod(lambda: LICENCES)
sys.exit(main())
