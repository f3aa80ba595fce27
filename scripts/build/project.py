"""Facts about the project, for the scripts that write packages and pages: its version, its licence,
and the entries of packaging/project.toml."""

import pathlib
import subprocess
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]


def version() -> str:
    return subprocess.run([ROOT / "scripts/version"], check=True, text=True, stdout=subprocess.PIPE).stdout.strip()


def fact(key: str) -> str:
    """An entry of packaging/project.toml."""
    return tomllib.loads((ROOT / "packaging/project.toml").read_text(encoding="utf-8"))[key]


def licence() -> str:
    """Both licences in one text."""
    mit, apache = ((ROOT / f"LICENSE-{name}").read_text(encoding="utf-8") for name in ("MIT", "APACHE"))
    return ("mbm is licensed under either of the two licences below, at your choice.\n\n"
            f"{mit}\n{'-' * 78}\n\n{apache}")
