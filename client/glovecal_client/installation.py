"""How this copy of Glovecal was installed, and the command that adds a package to it.

This file is in ``glovecal_client`` and in ``glovecal_models``, which know nothing of each other; a test keeps
both the same. Sentences about a package that is missing come from here:

    wheels installed by pip or pipx   /opt/gloves/bin/python -m pip install pandas
    a checkout, an environment of uv  uv pip install --python /opt/gloves pandas
    a container image                 the line that a Dockerfile made from the image needs

The image says that it is one: its Dockerfile sets ``GLOVECAL_INSTALLED_BY=image``.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
from importlib.metadata import PackageNotFoundError, distribution, requires
from importlib.util import find_spec
from pathlib import Path

INSTALLED_BY = "GLOVECAL_INSTALLED_BY"
IMAGE = "image"


def not_installed(what: str, *packages: str) -> str:
    """The sentence that ``what`` needs those of ``packages`` (names on the package index) that are not here,
    with the command that installs them."""
    packages = tuple(name for name in packages if not _is_installed(name)) or packages
    *others, last = packages
    names, verb = (f"{', '.join(others)} and {last}", "are") if others else (last, "is")
    return f"{what} needs {names}, which {verb} not installed: {install_command(*packages)}"


def install_command(*packages: str) -> str:
    """The command that adds ``packages`` to the environment this process runs in, for its user's shell."""
    environment = sys.prefix
    if os.environ.get(INSTALLED_BY) == IMAGE:
        command = _quoted(("pip", "--python", environment, "install", *packages))
        return f"in a Dockerfile FROM this image, as USER root: RUN {command}"
    if find_spec("pip") is not None:
        return _quoted((sys.executable, "-m", "pip", "install", *packages))
    return _quoted((_uv(Path(environment)), "pip", "install", "--python", environment, *packages))


def packages_of(distribution: str, extra: str) -> list[str]:
    """Names of what ``distribution[extra]`` adds, without our own. Raises PackageNotFoundError."""
    added = [line for line in requires(distribution) or () if re.search(rf"extra == ['\"]{extra}['\"]", line)]
    names = [re.match(r"[\w.-]+", line) for line in added]
    return [name[0] for name in names if name and not name[0].startswith("glovecal")]


def _is_installed(package: str) -> bool:
    try:
        distribution(package.partition("[")[0])
    except PackageNotFoundError:
        return False
    return True


def _uv(environment: Path) -> str:
    """uv made an environment without pip: the one on the path, or that of the checkout, which do.py got."""
    own = environment.parent / ".tools" / "bin" / ("uv.exe" if os.name == "nt" else "uv")
    return str(own) if own.is_file() else "uv"


def _quoted(words: tuple[str, ...]) -> str:
    if os.name != "nt":
        return shlex.join(words)
    return " ".join(f'"{word}"' if re.search(r"[\s<>&|^]", word) else word for word in words)
