"""A site with a running router, and members of every kind, shared by tests that change nobody's rights."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from site_support import Site, tell_everybody


@pytest.fixture(scope="module", params=["as served", "told of everything"])
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """As served, and as a hostile program would see it: zenoh's own clients send nothing where they were not
    told that somebody listens, which must not be what keeps a forgery out."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "told of everything":
            tell_everybody(patch)
        with Site(tmp_path_factory.mktemp("site")) as site:
            yield site
