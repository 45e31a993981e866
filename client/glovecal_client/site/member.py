"""The file with which a member of a site proves who it is: names, addresses, certificate and private key.

One file to copy, one setting to name (``GLOVECAL_SITE_FILE``). It is read whole, bounded and checked; its
certificate is tried on its own authority without a network (``certificates.py``).
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from glovecal_client.errors import BadName, reason_of
from glovecal_client.keys import check_identifier
from glovecal_client.site.roles import ROLES, Role

SITE_FILE = "GLOVECAL_SITE_FILE"
"""The environment variable with the path of this computer's file."""
FORMAT = "glovecal-site-1"
LARGEST_FILE = 65536
MOST_ADDRESSES = 32
ENDPOINT = re.compile(r"tls/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})\Z")
REST_ADDRESS = re.compile(r"https://(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})\Z")
_PEM = re.compile(r"(-----BEGIN ([A-Z ]+)-----\n[A-Za-z0-9+/=\n]+-----END \2-----\n)+\Z")

Kind = Literal["service", "capture", "viewer", "worker"]
"""A service makes poses; a capture sends what gloves measure; a viewer uses poses; a worker trains."""
KINDS: tuple[Kind, ...] = get_args(Kind)


class BadSiteFile(BadName):
    """A site's file that cannot be used; the sentence says which and why."""


@dataclass(frozen=True)
class Member:
    """Who this computer is at a site. ``repr`` shows no secret."""

    site: str
    name: str
    kind: Kind
    zenoh: tuple[str, ...]
    """Endpoints of the service's router, such as ``tls/lab.example:7447``."""
    rest: str
    """Address of the service, such as ``https://lab.example:8600``."""
    authority: str = field(repr=False)
    """Certificate of the site's authority (PEM); whoever it signed belongs to the site."""
    certificate: str = field(repr=False)
    """This member's own (PEM)."""
    private_key: str = field(repr=False)
    """PEM."""
    gloves: tuple[str, ...] = ()
    """Of a capture: the gloves that it may publish; none: any."""
    role: Role | None = None
    api_key: str | None = field(default=None, repr=False)
    """For REST."""
    training: str | None = None
    """Of a worker: where the service lets it in, such as ``tls/lab.example:8601``."""

    def document(self) -> str:
        """The file's content."""
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=1) + "\n"


def site_file() -> Path | None:
    """The file that ``GLOVECAL_SITE_FILE`` names, None where nothing is set."""
    named = os.environ.get(SITE_FILE)
    return Path(named) if named else None


def member_of_environment() -> Member | None:
    """Who this computer is, None without ``GLOVECAL_SITE_FILE``. Raises BadSiteFile."""
    file = site_file()
    return None if file is None else read_member(file)


def settle_environment() -> None:
    """Set ``GLOVECAL_SITE``, ``GLOVECAL_ZENOH`` and ``GLOVECAL_URL``, where they are not, to what the file
    says. A file that cannot be used is left to those who use it."""
    try:
        member = member_of_environment()
    except BadSiteFile:
        return
    if member is not None:
        os.environ.setdefault("GLOVECAL_SITE", member.site)
        if member.kind != "service":
            os.environ.setdefault("GLOVECAL_ZENOH", ",".join(member.zenoh))
            os.environ.setdefault("GLOVECAL_URL", member.rest)


def read_member(file: Path) -> Member:
    """What is in ``file``. Raises BadSiteFile where it is not a site's file; certificates are not tried."""
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise BadSiteFile(f"the site's file {file} cannot be read: {reason_of(error)}") from error
    try:
        if len(content) > LARGEST_FILE:
            raise _Wrong(f"it is larger than {LARGEST_FILE // 1024} kB")
        return _member(json.loads(content))
    except RecursionError as error:
        raise BadSiteFile(_not_usable(file, "it is nested too deeply")) from error
    except (BadName, _Wrong) as error:
        raise BadSiteFile(_not_usable(file, str(error))) from error
    except ValueError as error:
        raise BadSiteFile(_not_usable(file, "it is not JSON")) from error


def _not_usable(file: Path, problem: str) -> str:
    make = "make one at the service with `glovecal site add NAME --as viewer`"
    return f"{file} is not a site's file: {problem}; {make}"


class _Wrong(Exception):
    """What is wrong with a field."""


def _member(document: Any) -> Member:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise _Wrong(f"there is no field 'format' with {FORMAT!r}")
    kind, role = document.get("kind"), document.get("role")
    if kind not in KINDS:
        raise _Wrong(f"its kind is {_shown(kind)}, not one of {', '.join(KINDS)}")
    if role is not None and role not in ROLES:
        raise _Wrong(f"its role is {_shown(role)}, not one of {', '.join(ROLES)}")
    return Member(
        site=check_identifier(_text(document, "site"), "site"),
        name=check_identifier(_text(document, "name"), "member"),
        kind=kind,
        zenoh=tuple(_matching(each, ENDPOINT, "zenoh") for each in _texts(document, "zenoh")),
        rest=_matching(_text(document, "rest"), REST_ADDRESS, "rest"),
        authority=_matching(_text(document, "authority"), _PEM, "authority"),
        certificate=_matching(_text(document, "certificate"), _PEM, "certificate"),
        private_key=_matching(_text(document, "private_key"), _PEM, "private_key"),
        gloves=tuple(check_identifier(each, "glove") for each in _texts(document, "gloves", fewest=0)),
        role=role,
        api_key=None if document.get("api_key") is None else _text(document, "api_key"),
        training=_matching(_text(document, "training"), ENDPOINT, "training") if kind == "worker" else None,
    )


def _text(document: dict[str, Any], name: str) -> str:
    value = document.get(name)
    if not isinstance(value, str):
        raise _Wrong(f"its field {name!r} is no text")
    return value


def _texts(document: dict[str, Any], name: str, *, fewest: int = 1) -> list[str]:
    values = document.get(name)
    if not isinstance(values, list) or not fewest <= len(values) <= MOST_ADDRESSES:
        raise _Wrong(f"its field {name!r} is no list of {fewest} to {MOST_ADDRESSES} texts")
    if not all(isinstance(value, str) for value in values):
        raise _Wrong(f"its field {name!r} holds something that is no text")
    return values


def _matching(value: str, pattern: re.Pattern[str], name: str) -> str:
    if not pattern.match(value):
        raise _Wrong(f"its field {name!r} is not as written by glovecal site")
    return value


def _shown(value: Any) -> str:
    return repr(value)[:40]
