"""The session of a member whose file is read again when it changes: a renewal loses no connection."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path

import zenoh

from glovecal_client.errors import ClientError
from glovecal_client.keys import admission_key
from glovecal_client.site.certificates import check_certificate
from glovecal_client.site.kept_session import KeptSession
from glovecal_client.site.member import Member, read_member, site_file

LOOK_EVERY_S = 1.0
UNANSWERED_LOOKS = 3
"""In a row, by a router that is connected: it stands still, or does not know this member any more."""
_log = logging.getLogger("glovecal.site")


def is_admitted(session: zenoh.Session | KeptSession, site: str) -> bool:
    """Whether the router answers what every member may ask; it has then read all that was said before."""
    replies = session.liveliness().get(admission_key(site), timeout=1.0)
    return any(reply.ok is not None for reply in replies)


class RenewedSession:
    """``session`` is used as a ``zenoh.Session``. Close this."""

    def __init__(
        self, member: Member, session: zenoh.Session, open_session: Callable[[Member], zenoh.Session]
    ) -> None:
        """``session`` is open already, as ``member``; ``open_session`` opens the later ones."""
        self._member = member
        self._file = site_file()
        first = [session]
        self.session: KeptSession = KeptSession(
            lambda: first.pop() if first else open_session(self._member),
            lambda session: is_admitted(session, member.site),
        )
        self._unanswered = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="site file", daemon=True)
        self._thread.start()

    def _follow(self) -> None:
        while self._file is not None and not self._over.wait(LOOK_EVERY_S):
            self._look(self._file)
            self._watch_admission()

    def _watch_admission(self) -> None:
        """zenoh tells nobody that a router stopped passing on what it says."""
        before, name, site = self._unanswered, self._member.name, self._member.site
        try:
            gone = not list(self.session.info.routers_zid())
            self._unanswered = 0 if gone or is_admitted(self.session, site) else before + 1
        except zenoh.ZError:
            return  # being replaced
        if self._unanswered == UNANSWERED_LOOKS:
            _log.warning(
                "the service at site %s answers %s no more: it stands still, or this member was revoked, and "
                "nothing arrives. Look with `glovecal site list` at the service", site, name,
            )  # fmt: skip
        elif before >= UNANSWERED_LOOKS and not gone and not self._unanswered:
            _log.warning("the service at site %s answers %s again", site, name)

    def _look(self, file: Path) -> None:
        """A file that cannot be used is left alone: the certificate in use may be good for long."""
        before = self._member
        try:
            renewed = read_member(file)
            if renewed == before:
                return
            check_certificate(renewed)
            self._member = renewed
            self.session.reopen()
            _log.info("the renewed certificate of %s is in use", renewed.name)
        except ClientError as error:
            _log.debug("the site's file: %s", error)
        except zenoh.ZError:
            self._member = before  # tried again at the next look
            _log.warning("no connection with the renewed certificate; trying again")

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self.session.close()
