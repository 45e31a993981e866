"""What the colour glove needs beyond the service: the extra ``camera``."""

from __future__ import annotations

from glovecal_client.installation import not_installed, packages_of


def camera_not_installed(what: str) -> str:
    """The sentence that packages are missing which ``what`` needs, with the command that installs them."""
    return not_installed(what, *packages_of("glovecal-models", "camera"))
