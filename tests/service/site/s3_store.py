"""Test support: the part of S3 that Glovecal uses, in memory: ``python s3_store.py PORT KEY SECRET_FILE``.

It answers only requests that are signed with that key and secret (AWS Signature Version 4).
"""

from __future__ import annotations

import hashlib
import hmac
import re
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qsl, quote, urlsplit

OBJECTS: dict[str, bytes] = {}


def signature(secret: str, scope: str, moment: str, request: str) -> str:
    key = f"AWS4{secret}".encode()
    for part in scope.split("/"):
        key = hmac.digest(key, part.encode(), "sha256")
    signed = ["AWS4-HMAC-SHA256", moment, scope, hashlib.sha256(request.encode()).hexdigest()]
    return hmac.digest(key, "\n".join(signed).encode(), "sha256").hex()


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    key = secret = ""

    def _is_signed(self) -> bool:
        told = re.match(
            r"AWS4-HMAC-SHA256 Credential=([^/]+)/(.+?), ?SignedHeaders=(.+?), ?Signature=(\w+)",
            self.headers.get("Authorization", ""),
        )
        if told is None or told[1] != self.key:
            return False
        parts = urlsplit(self.path)
        query = sorted(parse_qsl(parts.query, keep_blank_values=True))
        request = [
            self.command,
            parts.path,
            "&".join(f"{quote(name, safe='-_.~')}={quote(value, safe='-_.~')}" for name, value in query),
            *(f"{name}:{self.headers[name].strip()}" for name in told[3].split(";")),
            "",
            told[3],
            self.headers["x-amz-content-sha256"],
        ]
        right = signature(self.secret, told[2], self.headers["x-amz-date"], "\n".join(request))
        return hmac.compare_digest(right, told[4])

    def _answer(self) -> None:
        content = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        name = urlsplit(self.path).path
        if not self._is_signed():
            self._say(403)
        elif self.command == "PUT":
            OBJECTS[name] = content
            self._say(200)
        elif self.command == "DELETE":
            OBJECTS.pop(name, None)
            self._say(204)
        elif name not in OBJECTS:
            self._say(404)
        else:
            self._say(200, OBJECTS[name])

    do_GET = do_HEAD = do_PUT = do_DELETE = _answer  # noqa: N815

    def _say(self, status: int, content: bytes = b"") -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("ETag", f'"{hashlib.md5(content).hexdigest()}"')
        self.send_header("Last-Modified", self.date_time_string())
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)


if __name__ == "__main__":
    Handler.key, Handler.secret = sys.argv[2], Path(sys.argv[3]).read_text(encoding="ascii").strip()
    ThreadingHTTPServer(("0.0.0.0", int(sys.argv[1])), Handler).serve_forever()
