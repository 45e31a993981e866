"""Providers of OpenID Connect: one that others wrote, in a process of its own, and one that lies."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import jwt
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from free_ports import free_port
from jwt.algorithms import RSAAlgorithm

CLIENT, SECRET = "glovecal", "a secret: of the provider"


@contextmanager
def others_provider(host: str, *people: dict[str, Any]) -> Iterator[str]:
    """oidc-provider-mock (authlib) on loopback; ``people`` are claims with ``sub``. Gives the issuer."""
    port = free_port()
    claims = [part for each in people for part in ("--user-claims", json.dumps(each))]
    module = (sys.executable, "-I", "-m", "oidc_provider_mock", "--host", "127.0.0.1")
    process = subprocess.Popen(
        [*module, "--port", str(port), "--require-nonce", "true", *claims], stderr=subprocess.DEVNULL
    )
    issuer = f"http://{host}:{port}"
    try:
        until = time.monotonic() + 120
        while True:
            try:
                httpx.get(f"{issuer}/.well-known/openid-configuration").raise_for_status()
                break
            except httpx.HTTPError:
                assert process.poll() is None
                assert time.monotonic() < until
                time.sleep(0.05)
        yield issuer
    finally:
        process.kill()
        process.wait()


@cache
def private_key(number: int) -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(65537, 2048)


def public_jwk(number: int) -> dict[str, Any]:
    public = json.loads(RSAAlgorithm.to_jwk(private_key(number).public_key()))
    return {**public, "kid": str(number), "use": "sig"}


def signed_by_everybody(claims: dict[str, Any], kid: str = "0") -> str:
    """HS256 with the public key as the secret."""
    pem = private_key(0).public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    parts = [json.dumps(each).encode() for each in ({"alg": "HS256", "kid": kid}, claims)]
    text = b".".join(base64.urlsafe_b64encode(each).rstrip(b"=") for each in parts)
    mac = hmac.digest(pem, text, hashlib.sha256)
    return (text + b"." + base64.urlsafe_b64encode(mac).rstrip(b"=")).decode()


def signed(claims: dict[str, Any], number: int = 0, algorithm: str = "RS256") -> str:
    return jwt.encode(claims, private_key(number), algorithm=algorithm, headers={"kid": str(number)})


@dataclass
class LyingProvider:
    """Answers as it should, unless a test says otherwise."""

    issuer: str = ""
    claims: dict[str, Any] = field(default_factory=dict)
    """Of the next ID token, beside or instead of the right ones; None: left out."""
    sign: Callable[[dict[str, Any]], str] = signed
    keys: list[dict[str, Any]] = field(default_factory=lambda: [public_jwk(0)])
    description: dict[str, Any] = field(default_factory=dict)
    answers: dict[str, Callable[[BaseHTTPRequestHandler], None]] = field(default_factory=dict)
    """By path: what is done instead of answering."""
    asked: list[tuple[str, dict[str, str], dict[str, str]]] = field(default_factory=list)
    """Path, form and headers of each request."""
    nonce: str = ""

    def document(self, path: str) -> dict[str, Any]:
        if path == "/.well-known/openid-configuration":
            places = {"authorization_endpoint": "/authorize", "token_endpoint": "/token", "jwks_uri": "/keys"}
            own = {name: self.issuer + place for name, place in places.items()}
            return {"issuer": self.issuer, **own, **self.description}
        if path == "/keys":
            return {"keys": self.keys}
        now = int(time.time())
        right = {"iss": self.issuer, "sub": "1", "aud": CLIENT, "iat": now, "exp": now + 300}
        right |= {"nonce": self.nonce, "groups": ["leads"], "preferred_username": "anna"}
        claims = {name: value for name, value in (right | self.claims).items() if value is not None}
        return {"access_token": "x", "token_type": "Bearer", "id_token": self.sign(claims)}


@contextmanager
def lying_provider() -> Iterator[LyingProvider]:
    provider = LyingProvider()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.do_GET()

        def do_GET(self) -> None:
            path = urlsplit(self.path).path
            body = self.rfile.read(int(self.headers.get("content-length", 0))).decode()
            form = {name: values[0] for name, values in parse_qs(body).items()}
            provider.asked.append((path, form, {name.lower(): text for name, text in self.headers.items()}))
            if path in provider.answers:
                provider.answers[path](self)
                return
            answer = json.dumps(provider.document(path)).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, format: str, *args: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    provider.issuer = f"http://127.0.0.1:{server.server_port}"
    try:
        yield provider
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
