"""Test support: a site on a free port, its members' sessions, and somebody from another site."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
import zenoh
from free_ports import free_port as free_port

from glovecal_client.session import client_config
from glovecal_client.site.member import Member, read_member
from glovecal_client.site.rules import Rules
from glovecal_service.settings import Settings
from glovecal_service.store.site.router import SiteRouter
from glovecal_service.store.site.site_folder import SiteFolder

BOUND = ("right",)


class Site:
    """A router in this process that follows its site's list of members, with real TLS."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.port = free_port()
        self.endpoint = f"tls/127.0.0.1:{self.port}"
        self.folder = SiteFolder(place / "data")
        self.folder.begin("lab", [], zenoh_port=self.port, rest_port=free_port())
        self.members: dict[str, Member] = {
            "service": read_member(self.folder.service_file),
            "capture": self.folder.add("capture", "capture"),
            "bound": self.folder.add("bound", "capture", gloves=BOUND),
            "other": self.folder.add("other", "capture", gloves=("left",)),
            "viewer": self.folder.add("viewer", "viewer"),
            "revoked": self.folder.add("revoked", "viewer"),
        }
        self.folder.revoke("revoked")
        self.settings = Settings(data=place / "data", zenoh=self.endpoint, site_file=self.folder.service_file)
        self.router = SiteRouter(self.settings, self.folder.service_file)
        self._stopped = Event()
        self._following = Thread(target=self.router.follow, args=(self._stopped,), daemon=True)
        self._open = ExitStack()

    def __enter__(self) -> Site:
        self._following.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        self._following.join()
        self._open.close()
        self.router.session.close()

    def session(self, member: str | Member) -> zenoh.Session:
        """One of its own for the member, closed with the site. Raises zenoh.ZError."""
        found = self.members[member] if isinstance(member, str) else member
        session = zenoh.open(client_config([self.endpoint], found))
        self._open.callback(session.close)
        return session

    def file(self, member: Member, name: str = "") -> Path:
        place = self.place / f"{name or member.name}.glovecal"
        place.write_text(member.document(), encoding="utf-8")
        place.chmod(0o600)
        return place


def tell_everybody(patch: pytest.MonkeyPatch) -> None:
    """Routers from now on tell each member who listens, answers and is there: all of it, on all keys."""
    ordinary = Rules.access_control

    def access_control(rules: Rules) -> dict[str, Any]:
        found = ordinary(rules)
        told = {
            "id": "told",
            "permission": "allow",
            "flows": ["egress"],
            "messages": ["declare_subscriber", "declare_queryable"],
            "key_exprs": ["**"],
        }
        everybody = {"id": "everybody"}
        return found | {
            "rules": [*found["rules"], told],
            "subjects": [*found["subjects"], everybody],
            "policies": [*found["policies"], {"rules": ["told"], "subjects": ["everybody"]}],
        }

    patch.setattr(Rules, "access_control", access_control)


class Heard:
    """What a session hears, by key."""

    def __init__(self, session: Any, key: str) -> None:
        self.samples: list[tuple[str, bytes]] = []
        self._subscriber = session.declare_subscriber(key, self._hear)

    def _hear(self, sample: zenoh.Sample) -> None:
        self.samples.append((str(sample.key_expr), sample.payload.to_bytes()))

    def keys(self) -> set[str]:
        return {key for key, _ in self.samples}

    def close(self) -> None:
        self._subscriber.undeclare()


def eventually(condition: Callable[[], Any], what: str, deadline_s: float = 120.0) -> Any:
    """The first true value of ``condition``; fails with ``what`` after the deadline."""
    end = time.monotonic() + deadline_s
    while not (value := condition()):
        assert time.monotonic() < end, f"did not happen in {deadline_s} s: {what}"
        time.sleep(0.01)
    return value


def answered(session: Any, key: str, timeout_s: float) -> list[str]:
    """Keys that were answered; nobody answering is an empty list."""
    return [str(reply.ok.key_expr) for reply in session.get(key, timeout=timeout_s) if reply.ok is not None]


def tokens(session: Any, key: str, timeout_s: float) -> list[str]:
    """Keys of liveliness tokens that the session sees."""
    replies = session.liveliness().get(key, timeout=timeout_s)
    return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
