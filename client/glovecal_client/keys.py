"""Where things are on the wire: ``glovecal/<site>/<glove>/<plane>``, built and taken apart in one place.

And which names are allowed in keys and paths (sites, gloves, subjects) and for channels (sensors, context).
The rule is the same as in glovecal_models, which the client must not import; a test holds the two together.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass

from glovecal_client.errors import BadName

IDENTIFIER = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}\Z")
CHANNEL = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}\Z")
DEVICES = {"con", "prn", "aux", "nul"} | {f"{port}{n}" for port in ("com", "lpt") for n in range(10)}
"""Identifiers that no file can have on Windows; a data folder may be moved there."""
MOST_LISTED = 24
"""Names in a sentence; an unknown one is mostly a slip of the finger, and the nearest comes first."""


def check_identifier(name: str, what: str) -> str:
    """Return ``name`` or raise BadName; identifiers go into keys, paths and URLs."""
    if not IDENTIFIER.match(name):
        raise BadName(
            f"{what}: {name!r} is not allowed; use a-z, 0-9, _ and -, at most 64, not starting with _ or -"
        )
    if name in DEVICES:
        raise BadName(f"{what}: {name!r} is not allowed: Windows keeps it for a device; add a word to it")
    return name


def check_channel_name(name: str, what: str) -> str:
    """Return ``name`` or raise BadName; channels are letters, digits and underscores."""
    if not CHANNEL.match(name):
        raise BadName(
            f"{what}: {name!r} is not a channel name (a letter, then letters, digits, _; at most 64)"
        )
    return name


def subject_name(name: str) -> str:
    """A subject's name as it is stored, which is in lower case: ``Anna`` is ``anna``. Raises BadName."""
    return check_identifier(name.lower() if name.isascii() else name, "subject")


def did_you_mean(name: str, known: Iterable[str], *, there: str = "there are") -> str:
    """What follows an unknown ``name`` in a sentence: the nearest of ``known``, and which there are."""
    names = list(dict.fromkeys(known))
    if not names:
        return f"{there} none"
    shown = ", ".join(names[:MOST_LISTED])
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    listed = f"{there} {shown}{more}"
    plain = {each.casefold(): each for each in reversed(names)}
    near = difflib.get_close_matches(name.casefold(), plain, n=1)
    return f"did you mean {plain[near[0]]!r}? {listed[:1].upper()}{listed[1:]}" if near else listed


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


def parse_service_key(key: str) -> str:
    """The instance of a key that ``service_alive_key`` gave. Raises BadName."""
    parts = key.split("/")
    if len(parts) != 5 or (parts[0], parts[2], parts[4]) != (ROOT, "service", "alive"):
        raise BadName(f"key: {key!r} is not {ROOT}/<site>/service/<instance>/alive")
    return check_identifier(parts[3], "service instance")


LAST_TERM = (1 << 32) - 1
"""A pose has room for 32 bits."""


def term_key(site: str, instance: str, glove: str, term: int) -> str:
    """Liveliness token of a service process that has a glove."""
    return service_alive_key(site, instance).removesuffix("alive") + f"has/{glove}/{term}"


def all_terms(site: str) -> str:
    """Key expression for these tokens of all gloves of a site."""
    return all_services(site).removesuffix("alive") + "has/*/*"


def parse_term_key(key: str) -> tuple[str, str, int]:
    """Instance, glove and term of a key that ``term_key`` gave. Raises BadName."""
    parts = key.split("/")
    if len(parts) != 7 or (parts[0], parts[2], parts[4]) != (ROOT, "service", "has"):
        raise BadName(f"key: {key!r} is not {ROOT}/<site>/service/<instance>/has/<glove>/<term>")
    term = parts[6]
    if not (term.isascii() and term.isdigit() and len(term) <= 10 and int(term) <= LAST_TERM):
        raise BadName(f"key: the term of {key!r} is no number of 32 bits")
    return check_identifier(parts[3], "service instance"), GloveKeys(parts[1], parts[5]).glove, int(term)


def admission_key(site: str) -> str:
    """Liveliness token of the router of a site with certificates: who sees it is let in there."""
    return f"{ROOT}/{check_identifier(site, 'site')}/service/router/admits"
