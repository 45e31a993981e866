"""Certificates of members, judged and used with Python's own ``ssl``.

A client that only subscribes to poses needs no further package: its certificate is judged by a handshake with
itself, in memory, which says what a peer of the site would say: expired, of another authority, not its key.
"""

from __future__ import annotations

import contextlib
import ssl
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from glovecal_client.errors import NotAdmitted
from glovecal_client.private_files import open_private
from glovecal_client.site.member import BadSiteFile, Member

EXPIRED, NOT_YET_VALID = 10, 9
"""OpenSSL's numbers of what is wrong with a certificate."""


@dataclass(frozen=True)
class CertificateFacts:
    """What a certificate says that its authority vouches for."""

    common_name: str
    not_before: datetime
    not_after: datetime
    hosts: tuple[str, ...]
    """Names and addresses that a service answers to; none for others."""


def check_certificate(member: Member) -> CertificateFacts:
    """What the member's certificate says.

    Raises NotAdmitted where its site would refuse it today, BadSiteFile where it can never be used.
    """
    whose = f"the certificate of {member.name!r} at site {member.site!r}"
    try:
        peer = peer_context(member)
        client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        client.check_hostname, client.verify_mode = False, ssl.CERT_NONE
        load_key(client, member)
        seen = _shake_hands(client, peer)
    except ssl.SSLCertVerificationError as error:
        raise NotAdmitted(f"{whose} {why_unverified(error)}") from error
    except (ssl.SSLError, ValueError) as error:
        raise BadSiteFile(f"{whose} cannot be used: it and its private key do not fit together") from error
    return CertificateFacts(
        common_name_in(seen),
        _time(str(seen["notBefore"])),
        _time(str(seen["notAfter"])),
        tuple(str(name) for _, name in seen.get("subjectAltName", ())),
    )


def why_unverified(error: ssl.SSLCertVerificationError) -> str:
    again = "ask whoever runs the service for a new file (glovecal site renew)"
    if error.verify_code == EXPIRED:
        return f"has expired; {again}. Or this computer's clock is wrong"
    if error.verify_code == NOT_YET_VALID:
        return "is not valid yet; set this computer's clock"
    return f"was not signed by the authority in the same file; {again}"


def client_context(member: Member) -> ssl.SSLContext:
    """For connections to the service: it must show a certificate of the site for the name it is called by.

    Shows the member's own where it is asked for.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.load_verify_locations(cadata=member.authority)
    load_key(context, member)
    return context


def server_context(member: Member) -> ssl.SSLContext:
    """For REST: shows the service's certificate and asks for none, as browsers have none."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    load_key(context, member)
    return context


def peer_context(member: Member) -> ssl.SSLContext:
    """For a service's other doors: shows its certificate, and lets in who has one of the same authority."""
    context = server_context(member)
    context.load_verify_locations(cadata=member.authority)
    context.verify_mode = ssl.CERT_REQUIRED
    return context


def load_key(context: ssl.SSLContext, member: Member) -> None:
    """``ssl`` takes files only: for that moment they lie in a folder that nobody else can open.

    May be called again for a context in use, after a renewal. Raises ssl.SSLError.
    """
    with tempfile.TemporaryDirectory(prefix="glovecal-site-") as folder:
        file = Path(folder, "member.pem")
        with open(file, "w", encoding="ascii", opener=open_private) as stream:
            stream.write(member.private_key + member.certificate)
        context.load_cert_chain(file)


def _shake_hands(client: ssl.SSLContext, server: ssl.SSLContext) -> dict[str, Any]:
    """What the server learns of the client. Raises ssl.SSLError."""
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    client_end = client.wrap_bio(to_client, to_server)
    server_end = server.wrap_bio(to_server, to_client, server_side=True)
    for _ in range(4):
        with contextlib.suppress(ssl.SSLWantReadError):
            client_end.do_handshake()
        with contextlib.suppress(ssl.SSLWantReadError):
            server_end.do_handshake()
    return server_end.getpeercert() or {}


def common_name_in(seen: Mapping[str, Any]) -> str:
    """Of a certificate as ``getpeercert`` gives it; "" where it has none."""
    names = [value for part in seen.get("subject", ()) for name, value in part if name == "commonName"]
    return names[0] if names else ""


def _time(text: str) -> datetime:
    return datetime.fromtimestamp(ssl.cert_time_to_seconds(text), timezone.utc)
