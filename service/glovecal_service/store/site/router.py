"""The router of a site with certificates: it is given other rules and certificates while the service runs.

zenoh takes neither while a router runs, so the router is replaced; what was declared on it is declared again,
and all others connect again by themselves.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import cast

import zenoh

from glovecal_client.errors import BadName
from glovecal_client.keys import admission_key
from glovecal_client.session import open_router, router_config
from glovecal_client.site.kept_session import KeptSession
from glovecal_client.site.member import Member, read_member
from glovecal_client.site.rules import Admitted, Rules
from glovecal_models.errors import BadInput
from glovecal_service.settings import Settings
from glovecal_service.store.site.site_folder import SiteFolder

LOOK_EVERY_S = 0.5
_log = logging.getLogger("glovecal.site")


class SiteRouter:
    """The service's router; ``session`` is used as a ``zenoh.Session``."""

    def __init__(self, settings: Settings, file: Path) -> None:
        """Raises BadSiteFile, BadInput, zenoh.ZError where the endpoint cannot be used."""
        self._settings = settings
        self._file = file
        self._folder = SiteFolder(settings.data)
        self._member = read_member(file)
        self._rules = Rules(settings.site, self._members())
        self.session = KeptSession(self._open, None)
        self.session.liveliness().declare_token(admission_key(settings.site))

    def _open(self) -> zenoh.Session:
        listen, peers = [self._settings.zenoh], self._settings.linked_routers
        return zenoh.open(router_config(listen, peers=peers, member=self._member, rules=self._rules))

    def _members(self) -> tuple[Admitted, ...]:
        return self._folder.register().admitted

    def follow(self, stopped: Event) -> None:
        """Until ``stopped``: other members, other rules; another certificate of the service."""
        while not stopped.wait(LOOK_EVERY_S):
            self.look()

    def look(self) -> bool:
        """Whether the router had to be replaced. What cannot be read changes nothing."""
        try:
            member, members = self._read()
        except (BadName, BadInput) as error:
            _log.warning("the site's rules stay as they are: %s", error)
            return False
        if member == self._member and self._rules.fit(members):
            return False
        self._member, self._rules = member, Rules(self._settings.site, members)
        self.session.reopen()
        _log.info("the router has the rules of now: %d members", sum(each.belongs for each in members))
        return True

    def _read(self) -> tuple[Member, tuple[Admitted, ...]]:
        return read_member(self._file), self._members()


@contextmanager
def service_router(settings: Settings) -> Iterator[tuple[zenoh.Session, SiteRouter | None]]:
    """The router's session, and who keeps its rules; None for a service without certificates."""
    if settings.site_file is None:
        with open_router([settings.zenoh], peers=settings.linked_routers) as session:
            yield session, None
        return
    router = SiteRouter(settings, settings.site_file)
    try:
        yield cast(zenoh.Session, router.session), router
    finally:
        router.session.close()
