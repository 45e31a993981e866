"""What REST shows others: the service's certificate, renewed while it runs, and the names it answers to."""

from __future__ import annotations

import logging
import ssl
from threading import Event

from glovecal_client.errors import ClientError
from glovecal_client.hosts import comparable
from glovecal_client.site.certificates import check_certificate, load_key, server_context
from glovecal_client.site.member import Member, read_member
from glovecal_service.settings import Settings

LOOK_EVERY_S = 1.0
_log = logging.getLogger("glovecal.site")


class AllowedHosts:
    """Names and addresses, beside those of loopback, that requests may be sent to."""

    def __init__(self, settings: Settings) -> None:
        self._fixed = tuple(filter(None, (name.strip() for name in settings.allowed_hosts.split(","))))
        self.names: frozenset[str] = frozenset(map(comparable, self._fixed))
        if settings.site_file is not None and not self._fixed:
            try:
                self.take_from(read_member(settings.site_file))
            except ClientError as error:
                _log.warning("only loopback names are answered: %s", error)

    def take_from(self, member: Member) -> None:
        """Those in the service's certificate, unless GLOVECAL_ALLOWED_HOSTS does. Raises ClientError."""
        if not self._fixed:
            self.names = frozenset(map(comparable, check_certificate(member).hosts))

    def __contains__(self, name: str) -> bool:
        return comparable(name) in self.names


class WebLogin:
    """The certificate with which REST answers, for a service with a site's file."""

    def __init__(self, settings: Settings, hosts: AllowedHosts) -> None:
        """Raises ClientError where the file cannot be used."""
        assert settings.site_file is not None
        self._file, self._hosts = settings.site_file, hosts
        self._member = read_member(self._file)
        self.context: ssl.SSLContext = server_context(self._member)

    def follow(self, stopped: Event) -> None:
        """Until ``stopped``: connections from now on are shown the certificate that is in the file then."""
        while not stopped.wait(LOOK_EVERY_S):
            try:
                renewed = read_member(self._file)
                if renewed != self._member:
                    check_certificate(renewed)
                    self._member = renewed
                    load_key(self.context, renewed)
                    self._hosts.take_from(renewed)
                    _log.info("REST shows the renewed certificate")
            except (ClientError, OSError, ssl.SSLError) as error:
                _log.debug("the site's file: %s", error)
