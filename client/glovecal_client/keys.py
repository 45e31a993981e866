"""Where things are on the wire: ``glovecal/<site>/<glove>/<plane>``, built and taken apart in one place."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_client.errors import BadName
from glovecal_client.names import check_identifier, did_you_mean

ROOT = "glovecal"
PLANES = ("raw", "pose", "pose/meta", "pose/explain", "status", "meta", "alive", "log", "control", "picture")
_RESERVED_GLOVES = frozenset({"service"})
JSON_ENCODING = "application/json"


@dataclass(frozen=True)
class GloveKeys:
    """All keys of one glove at one site. Raises BadName for names that cannot stand in a key."""

    site: str
    glove: str

    def __post_init__(self) -> None:
        check_identifier(self.site, "site")
        check_identifier(self.glove, "glove")
        if self.glove in _RESERVED_GLOVES:
            raise BadName(f"glove: {self.glove!r} is reserved; choose another name")

    def _key(self, plane: str) -> str:
        return f"{ROOT}/{self.site}/{self.glove}/{plane}"

    @property
    def raw(self) -> str:
        """Frames."""
        return self._key("raw")

    @property
    def pose(self) -> str:
        """Poses."""
        return self._key("pose")

    @property
    def pose_meta(self) -> str:
        """JSON by the service: model, subject, layout, rotations, state."""
        return self._key("pose/meta")

    @property
    def pose_explain(self) -> str:
        """Queryable by the service: what the angles of the newest pose are made of."""
        return self._key("pose/explain")

    @property
    def status(self) -> str:
        """JSON by the capture daemon, on change and once a second."""
        return self._key("status")

    @property
    def meta(self) -> str:
        """JSON by the capture daemon: what the frames hold."""
        return self._key("meta")

    @property
    def alive(self) -> str:
        """Liveliness token of the capture daemon."""
        return self._key("alive")

    @property
    def log(self) -> str:
        """Queryable for frames of the capture log."""
        return self._key("log")

    @property
    def control(self) -> str:
        """Queryable: what a glove can be asked beside its stream."""
        return self._key("control")

    @property
    def picture(self) -> str:
        """Queryable by a camera: the newest picture with what was found in it."""
        return self._key("picture")


def all_gloves(site: str, plane: str) -> str:
    """Key expression for one plane of every glove of a site, such as ``glovecal/lab/*/raw``."""
    check_identifier(site, "site")
    if plane not in PLANES:
        raise BadName(f"plane: {plane!r} does not exist; {did_you_mean(plane, PLANES)}")
    return f"{ROOT}/{site}/*/{plane}"


def parse_glove_key(key: str) -> tuple[GloveKeys, str]:
    """The glove and the plane of a key, such as (GloveKeys("lab", "g1"), "raw"). Raises BadName."""
    root, *rest = key.split("/", 3)
    if root != ROOT or len(rest) != 3 or rest[2] not in PLANES:
        raise BadName(f"key: {key!r} is not {ROOT}/<site>/<glove>/ and one of {', '.join(PLANES)}")
    return GloveKeys(rest[0], rest[1]), rest[2]


def service_alive_key(site: str, instance: str) -> str:
    """Liveliness token of one service process."""
    check_identifier(site, "site")
    return f"{ROOT}/{site}/service/{check_identifier(instance, 'service instance')}/alive"


def all_services(site: str) -> str:
    """Key expression for the liveliness tokens of every service process of a site."""
    return f"{ROOT}/{check_identifier(site, 'site')}/service/*/alive"
