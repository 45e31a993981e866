"""A stand-in for the base image, made of Debian's packages: for computers that reach no image registry."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from bare_system import CERTIFICATES, BareSystem, debian_mirror
from engine import Engine

NOT_NEEDED = ("/var/cache/apt", "/var/lib/apt/lists", "/usr/share/doc", "/usr/share/man", "/var/log")


def make_base(engine: Engine, base: str, folder: Path) -> None:
    """An image called ``base``, a name that ends with a Debian, such as ``localhost/python:bookworm``.

    Its Python is Debian's. It trusts whom this computer trusts: its packages come the same way. Raises
    Unavailable without root or debootstrap.
    """
    system = BareSystem(folder, base.rpartition(":")[2])
    system.make(debian_mirror(Path("/etc/apt")), engine.architecture)
    system.take_network_settings()
    system.inside("/usr/bin/python").symlink_to("python3")
    for file in system.inside("/usr/lib").glob(
        "python3*/EXTERNALLY-MANAGED"
    ):  # pip installs, as in the image
        file.unlink()
    for place in NOT_NEEDED:
        shutil.rmtree(system.inside(place))
        system.inside(place).mkdir()
    archive = folder / "base.tar"
    subprocess.run(["tar", "-C", str(system.root), "-cf", str(archive), "."], check=True)
    trust = [f"--change=ENV {name}={CERTIFICATES}" for name in ("SSL_CERT_FILE", "PIP_CERT")]
    processor = [f"--arch={engine.architecture}"] if engine.architecture else []
    engine("import", *processor, *trust, str(archive), base)
    archive.unlink()
    shutil.rmtree(system.root)
