"""The files that characters are read from, by how they begin."""

from __future__ import annotations

from pathlib import Path

from glovecal_models.errors import BadInput
from glovecal_service.exports.character import Character
from glovecal_service.exports.fbx_character import FbxCharacter
from glovecal_service.exports.gltf_character import GltfCharacter

KINDS: dict[bytes, type[Character]] = {
    b"glTF": GltfCharacter, b"Kaydara FBX Binary": FbxCharacter, b"; FBX": FbxCharacter,
}  # fmt: skip
SUFFIXES = tuple(dict.fromkeys(kind.suffix for kind in KINDS.values()))


def read_character(path: Path, name: str) -> Character:
    """Raises BadInput for what begins as none of them, and as the kind's own ``read``."""
    with path.open("rb") as stream:
        begins = stream.read(max(map(len, KINDS)))
    for mark, kind in KINDS.items():
        if begins.startswith(mark):
            return kind.read(path, name)
    raise BadInput(
        f"{name} does not begin as glTF does, nor as FBX; export the character as a binary glTF file (.glb) "
        "or a binary FBX file (.fbx)"
    )
