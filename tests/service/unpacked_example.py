"""The stored data folder, unpacked for one test or several."""

from __future__ import annotations

import tarfile
from pathlib import Path

PACKED = Path(__file__).parent / "stored_example" / "data.tar.xz"


def unpacked_example(into: Path) -> Path:
    """The data folder in ``into``. Python before 3.11.4 has no filter; the archive is our own."""
    with tarfile.open(PACKED) as packed:
        packed.extraction_filter = getattr(tarfile, "data_filter", lambda member, path: member)
        packed.extractall(into)
    return into / "data"
