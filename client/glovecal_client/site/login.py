"""Why a login fails: zenoh says no more than that nobody answered in time, a plain TLS handshake says why."""

from __future__ import annotations

import re
import socket
import ssl

from glovecal_client.site.certificates import client_context
from glovecal_client.site.member import Member

CONNECTED_WITHIN_S, GREETED_WITHIN_S = 2.0, 5.0
_ADDRESS = re.compile(r"(?:tls|tcp)/(?:\[([^\]]+)\]|([^:/]+)):(\d+)")


def why_refused(member: Member, endpoint: str) -> str | None:
    """What keeps ``member`` out at ``endpoint`` (``tls/HOST:PORT``); None: nothing, or nobody is there.

    Takes 7 s at most.
    """
    parts = _ADDRESS.match(endpoint)
    if parts is None:
        return None
    host, port = parts[1] or parts[2], int(parts[3])
    context = client_context(member)
    greeted: bool | None = None
    try:
        with socket.create_connection((host, port), timeout=CONNECTED_WITHIN_S) as connection:
            greeted = False
            connection.settimeout(GREETED_WITHIN_S)
            with context.wrap_socket(connection, server_hostname=host) as secured:
                greeted = True
                secured.settimeout(CONNECTED_WITHIN_S)
                secured.recv(1)  # of TLS 1.3: what is said of our certificate comes after the handshake
    except ssl.SSLCertVerificationError as error:
        return _of_their_certificate(error, host, member)
    except ssl.SSLError as error:
        return _of_an_alert(error, host, port, member)
    except TimeoutError:
        return _not_encrypted(host, port) if greeted is False else None
    except OSError:
        return None
    return None


def _not_encrypted(host: str, port: int) -> str:
    """zenoh without TLS waits for the rest of what it takes for a message."""
    return f"what listens at {host}:{port} does not encrypt: is the service started with GLOVECAL_SITE_FILE?"


def _of_their_certificate(error: ssl.SSLCertVerificationError, host: str, member: Member) -> str:
    if error.verify_code == _OTHER_NAME or error.verify_code == _OTHER_ADDRESS:
        return (
            f"the service at {host} has no certificate for that name; connect to {_hosts(member)}, or "
            f"have it made there: glovecal site renew --host {host}"
        )
    if error.verify_code == _EXPIRED:
        return f"the certificate of the service at {host} has expired; renew it there: glovecal site renew"
    return (
        f"the service at {host} belongs to another site than this computer's file (site {member.site!r}); "
        f"take a file made at that service: glovecal site add NAME --as {member.kind}"
    )


_OTHER_NAME, _OTHER_ADDRESS, _EXPIRED = 62, 64, 10
"""OpenSSL's numbers."""


def _hosts(member: Member) -> str:
    return ", ".join(each.removeprefix("tls/") for each in member.zenoh)


def _of_an_alert(error: ssl.SSLError, host: str, port: int, member: Member) -> str | None:
    """``reason`` is OpenSSL's name of the other side's alert."""
    reason = (error.reason or "").upper()
    if "WRONG_VERSION" in reason or "HTTP_REQUEST" in reason or "RECORD_LAYER" in reason:
        return _not_encrypted(host, port)
    if "CERTIFICATE_EXPIRED" in reason:
        return f"the service at {host} says that the certificate of {member.name!r} has expired"
    if "UNKNOWN_CA" in reason or "BAD_CERTIFICATE" in reason or "DECRYPT" in reason:
        return (
            f"the service at {host} does not know the authority of {member.name!r}: its file is of another "
            f"site, or of an earlier one; make a new file there: glovecal site add NAME --as {member.kind}"
        )
    if "CERTIFICATE" in reason:
        return f"the service at {host} refuses the certificate of {member.name!r}; make a new file there"
    return None
