"""Whether every process of the service on this computer lives: ``python -m glovecal_service.health_check``.

For container images, whose engine asks every few seconds and may restart what is not healthy: it loads
nothing but the standard library, and asks once. Prints one sentence; exit code 0 when all live, else 1. A
service without its database lives: ``/v1/health/ready`` tells that.
"""

from __future__ import annotations

import json
import os
import ssl
import sys
from http.client import HTTPConnection, HTTPException, HTTPSConnection

PATIENCE_S = 4.0
EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}


def main() -> int:
    host = os.environ.get("GLOVECAL_HOST", "127.0.0.1")
    port = os.environ.get("GLOVECAL_PORT", "8600")
    healthy, sentence = ask(EVERYWHERE.get(host, host), port)
    print(sentence)
    return 0 if healthy else 1


def ask(host: str, port: str) -> tuple[bool, str]:
    """Whether the service there lives, and a sentence."""
    connection = None
    try:
        connection = _connection(host, int(port))
        connection.request("GET", "/v1/health/live", headers={"Host": f"localhost:{port}"})
        answer = connection.getresponse()
        found = json.loads(answer.read())
    except (OSError, HTTPException, ValueError):
        return False, f"Nothing answers as Glovecal on {host}, port {port}, within {PATIENCE_S:g} s."
    finally:
        if connection is not None:
            connection.close()
    if answer.status != 200:
        return False, f"Not healthy: {found.get('detail', answer.status)}."
    return True, f"Healthy: {', '.join(found['processes_seen_s_ago'])}."


def _connection(host: str, port: int) -> HTTPConnection:
    """With a site's file over TLS: it is this computer that is asked, so its certificate needs no look."""
    if not os.environ.get("GLOVECAL_SITE_FILE"):
        return HTTPConnection(host, port, timeout=PATIENCE_S)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return HTTPSConnection(host, port, timeout=PATIENCE_S, context=context)


if __name__ == "__main__":
    sys.exit(main())
