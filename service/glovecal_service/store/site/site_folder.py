"""The folder ``site`` of a data folder: the authority, the service's own file, and who the members are.

Private keys of members are not kept: each is in its member's file alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, get_args

from glovecal_client.errors import reason_of
from glovecal_client.keys import did_you_mean
from glovecal_client.operating_system import lock_file
from glovecal_client.private_files import PRIVATE_FOLDER, open_private
from glovecal_client.site.member import BadSiteFile, Kind, Member, read_member
from glovecal_client.site.roles import Role
from glovecal_client.site.rules import Admitted, common_name
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier
from glovecal_service.store.blobs import write_durably
from glovecal_service.store.site.authority import MEMBER_DAYS, Authority, Issued, general_name

FOLDER = "site"
AUTHORITY, AUTHORITY_KEY, SERVICE_FILE = "authority.pem", "authority.key", "service.glovecal"
MEMBERS, LOCK = "members.json", "lock"
FORMAT = "glovecal-members-1"
LOOPBACK = ("localhost", "127.0.0.1", "::1")


@dataclass(frozen=True)
class Row:
    """A member as the site knows it."""

    name: str
    kind: Kind
    number: int
    """Of its kind at this site, never given twice: what makes its common name."""
    expires: str
    """ISO 8601, UTC."""
    gloves: tuple[str, ...] = ()
    role: Role | None = None
    revoked: str | None = None
    """When, ISO 8601; None while it belongs to the site."""

    @property
    def common_name(self) -> str:
        """In its certificate."""
        return common_name(self.kind, self.number, bound=bool(self.gloves))


@dataclass(frozen=True)
class Register:
    """Who belongs to the site, and where its service is reached."""

    site: str
    hosts: tuple[str, ...]
    zenoh: tuple[str, ...]
    rest: str
    members: tuple[Row, ...] = ()

    @property
    def admitted(self) -> tuple[Admitted, ...]:
        """Who the router lets in: all but the revoked. A worker has nothing to do there."""
        return tuple(
            Admitted(row.kind, row.number, row.gloves, row.revoked is None)
            for row in self.members
            if row.kind != "worker"
        )

    def workers(self, now: datetime) -> dict[str, Row]:
        """Who may train at that time, by common name."""
        return {
            row.common_name: row
            for row in self.members
            if row.kind == "worker" and row.revoked is None and datetime.fromisoformat(row.expires) > now
        }

    @property
    def host(self) -> str:
        """By which members call the service."""
        return self.rest.removeprefix("https://").rpartition(":")[0]

    def living(self, name: str) -> Row | None:
        """The member of that name that is not revoked."""
        return next((row for row in self.members if row.name == name and row.revoked is None), None)


class SiteFolder:
    """What ``glovecal site`` works on. Errors are BadInput, or those of the file system."""

    def __init__(self, data: Path, worker_port: int | None = None) -> None:
        """``worker_port``: where the service lets workers in, for files of these."""
        self.folder = data / FOLDER
        self._worker_port = worker_port

    @property
    def members_file(self) -> Path:
        return self.folder / MEMBERS

    @property
    def service_file(self) -> Path:
        return self.folder / SERVICE_FILE

    @property
    def authority_key(self) -> Path:
        return self.folder / AUTHORITY_KEY

    def begin(self, site: str, hosts: Sequence[str], *, zenoh_port: int, rest_port: int) -> Register:
        """Make the authority and the service's own file. Raises BadInput where there is a site already."""
        if self.members_file.exists():
            raise BadInput(
                f"there is a site in {self.folder} already; add members with "
                "`glovecal site add NAME --as viewer`, or move the folder away to begin anew"
            )
        for host in hosts:
            general_name(host)
        called = tuple(dict.fromkeys((*hosts, *LOOPBACK)))
        reached = hosts or LOOPBACK[1:2]
        register = Register(
            check_identifier(site, "site"),
            called,
            tuple(f"tls/{_in_address(host)}:{zenoh_port}" for host in reached),
            f"https://{_in_address(reached[0])}:{rest_port}",
        )
        self.folder.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        with self._alone():
            authority, kept = Authority.make(site)
            self._write(AUTHORITY_KEY, kept.private_key)
            self._write(AUTHORITY, kept.certificate)
            return self._issue_service(register, authority, MEMBER_DAYS)

    def register(self) -> Register:
        """Raises BadInput where there is no site, or its list of members cannot be read."""
        try:
            document = json.loads(self.members_file.read_bytes())
            return _register(document)
        except FileNotFoundError as error:
            raise BadInput(
                f"there is no site in {self.folder}; make one with `glovecal site init`"
            ) from error
        except OSError as error:
            raise BadInput(
                f"{self.members_file} cannot be read: {reason_of(error)}; it must be yours"
            ) from error
        except (ValueError, KeyError, TypeError) as error:
            raise BadInput(
                f"{self.members_file} is damaged: put it back from the backup of the data folder"
            ) from error

    def add(
        self,
        name: str,
        kind: Kind,
        *,
        gloves: Sequence[str] = (),
        role: Role | None = None,
        key: Path | None = None,
        days: int = MEMBER_DAYS,
        now: datetime | None = None,
    ) -> Member:
        """A new member; its file is for the caller to write. ``key``: where the authority's key was moved."""
        check_identifier(name, "member")
        for glove in gloves:
            check_identifier(glove, "glove")
        if gloves and kind != "capture":
            raise BadInput(f"gloves are for a capture: a {kind} has none; leave --glove out")
        with self._alone():
            register = self.register()
            if register.living(name) is not None:
                raise BadInput(
                    f"{name!r} is a member already; choose another name, or revoke it first: "
                    f"glovecal site revoke {name}"
                )
            alike = [
                row.number
                for row in register.members
                if row.kind == kind and bool(row.gloves) == bool(gloves)
            ]
            row = Row(name, kind, 1 + max(alike, default=0), "", tuple(dict.fromkeys(gloves)), role)
            hosts = register.hosts if kind == "service" else ()
            issued = self._authority(key).issue(
                row.common_name, name=name, kind=kind, hosts=hosts, days=days, now=now
            )
            row = replace(row, expires=issued.expires.isoformat())
            self._keep(replace(register, members=(*register.members, row)))
            return self._member(register, row, issued)

    def renew(
        self,
        name: str,
        *,
        hosts: Sequence[str] = (),
        key: Path | None = None,
        days: int = MEMBER_DAYS,
        now: datetime | None = None,
    ) -> Member:
        """A new certificate and private key for a member, with the rights it has. Of the service, its file is
        written; it answers to ``hosts`` too from now on."""
        for host in hosts:
            general_name(host)
        with self._alone():
            register = self.register()
            register = replace(register, hosts=tuple(dict.fromkeys((*hosts, *register.hosts))))
            row = register.living(name)
            if row is None:
                names = [each.name for each in register.members if each.revoked is None]
                raise BadInput(f"{name!r} is no member; {did_you_mean(name, names)}")
            issued = self._authority(key).issue(
                row.common_name,
                name=name,
                kind=row.kind,
                hosts=register.hosts if row.kind == "service" else (),
                days=days,
                now=now,
            )
            kept = replace(row, expires=issued.expires.isoformat())
            members = tuple(kept if each is row else each for each in register.members)
            self._keep(replace(register, members=members))
            member = self._member(register, kept, issued)
            if row.common_name == _SERVICE:
                member = replace(member, api_key=self._kept_api_key())
                self._write(SERVICE_FILE, member.document())
            return member

    def revoke(self, name: str) -> Row:
        """From now on the router and the service let this member do nothing. Raises BadInput."""
        with self._alone():
            register = self.register()
            row = register.living(name)
            if row is None:
                names = [each.name for each in register.members if each.revoked is None]
                raise BadInput(f"{name!r} is no member; {did_you_mean(name, names)}")
            if row.common_name == _SERVICE:
                raise BadInput(
                    "the service itself cannot be revoked; if its key was stolen, move the folder "
                    f"{self.folder} away and begin a new site with `glovecal site init`"
                )
            gone = replace(row, revoked=datetime.now(UTC).isoformat(timespec="seconds"))
            self._keep(
                replace(register, members=tuple(gone if each is row else each for each in register.members))
            )
            return gone

    def _issue_service(self, register: Register, authority: Authority, days: int) -> Register:
        issued = authority.issue(_SERVICE, name="service", kind="service", hosts=register.hosts, days=days)
        row = Row("service", "service", 1, issued.expires.isoformat())
        register = replace(register, members=(row,))
        self._write(SERVICE_FILE, self._member(register, row, issued).document())
        self._keep(register)
        return register

    def _member(self, register: Register, row: Row, issued: Issued) -> Member:
        return Member(
            register.site,
            row.name,
            row.kind,
            register.zenoh,
            register.rest,
            (self.folder / AUTHORITY).read_text(encoding="ascii"),
            issued.certificate,
            issued.private_key,
            row.gloves,
            row.role,
            training=f"tls/{register.host}:{self._worker_port}" if row.kind == "worker" else None,
        )

    def _authority(self, key: Path | None) -> Authority:
        file = key or self.authority_key
        try:
            return Authority(
                (self.folder / AUTHORITY).read_text(encoding="ascii"), file.read_text(encoding="ascii")
            )
        except OSError as error:
            raise BadInput(
                f"the authority's private key {file} cannot be read ({reason_of(error)}); if it was "
                "moved away, say where it is with --authority-key"
            ) from error
        except UnicodeDecodeError as error:
            raise BadInput(f"{file} is no private key of glovecal site; give its authority.key") from error

    def _kept_api_key(self) -> str | None:
        try:
            return read_member(self.service_file).api_key
        except BadSiteFile:
            return None

    def _keep(self, register: Register) -> None:
        self._write(MEMBERS, json.dumps({"format": FORMAT, **asdict(register)}, indent=1) + "\n")

    def _write(self, name: str, content: str) -> None:
        place = self.folder / name
        write_durably(place, content.encode())
        place.chmod(0o600)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """One change at a time: a number given twice would be revoked twice."""
        if not self.folder.is_dir():
            raise BadInput(f"there is no site in {self.folder}; make one with `glovecal site init`")
        with open(self.folder / LOCK, "ab", opener=open_private) as file:
            try:
                lock_file(file)
            except OSError as error:
                raise BadInput(
                    f"another command changes the site in {self.folder} just now; try again"
                ) from error
            yield


_SERVICE = common_name("service", 1)


def _in_address(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _register(document: Any) -> Register:
    """Raises ValueError, KeyError or TypeError."""
    if document["format"] != FORMAT:
        raise ValueError(document["format"])
    return Register(
        str(document["site"]),
        tuple(map(str, document["hosts"])),
        tuple(map(str, document["zenoh"])),
        str(document["rest"]),
        tuple(_row(each) for each in document["members"]),
    )


def _row(document: dict[str, Any]) -> Row:
    given: dict[str, Any] = document | {"gloves": tuple(document["gloves"])}
    row = Row(**given)
    if row.kind not in get_args(Kind) or not isinstance(row.number, int):
        raise ValueError(row.kind)
    return row
