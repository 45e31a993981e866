"""A stand-in for the base image, made of Debian's packages: for computers that reach no image registry."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from engine import Engine

PACKAGES = "python3,python3-venv,python3-pip,python-is-python3,ca-certificates"
NOT_NEEDED = ("var/cache/apt", "var/lib/apt/lists", "usr/share/doc", "usr/share/man", "var/log")
CERTIFICATES = "etc/ssl/certs/ca-certificates.crt"


def suite_of(base: str) -> str:
    """The Debian that a name such as ``python:3.11-slim-bookworm`` ends with."""
    return base.rpartition("-")[2]


def make_base(engine: Engine, base: str, folder: Path) -> None:
    """An image called ``base``. Needs root and debootstrap.

    Its Python is Debian's. It trusts whom this computer trusts: its packages come the same way.
    """
    root = folder / "base"
    suite = suite_of(base)
    subprocess.run(
        ["debootstrap", "--variant=minbase", f"--include={PACKAGES}", suite, str(root)],
        check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    for file in root.glob("usr/lib/python3*/EXTERNALLY-MANAGED"):  # as in the image that it stands for
        file.unlink()
    for place in NOT_NEEDED:
        shutil.rmtree(root / place)
        (root / place).mkdir()
    shutil.copyfile(f"/{CERTIFICATES}", root / CERTIFICATES)
    archive = folder / "base.tar"
    subprocess.run(["tar", "-C", str(root), "-cf", str(archive), "."], check=True)
    trust = [f"--change=ENV {name}=/{CERTIFICATES}" for name in ("SSL_CERT_FILE", "PIP_CERT")]
    engine("import", *trust, str(archive), f"localhost/{base}")
    archive.unlink()
    shutil.rmtree(root)
