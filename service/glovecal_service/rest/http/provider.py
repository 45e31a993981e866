"""A provider of OpenID Connect, asked who somebody is: the authorization code flow with PKCE, and what proves
that the answer is the provider's, for this service, for this login, and of now.

What the provider sends is bounded in size and time, and no text of it reaches a person.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import time
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, urlencode, urlsplit

import anyio
import httpx
import jwt
from jwt.exceptions import ExpiredSignatureError, ImmatureSignatureError, PyJWTError

from glovecal_client.site.roles import ROLES, Role
from glovecal_service.rest.http.begun_logins import Begun, BegunLogins
from glovecal_service.rest.http.problem import Problem
from glovecal_service.settings import Settings, is_safe_address

PROVIDER_TIMEOUT_S = 8.0
"""For all that is asked of the provider for one page."""
LARGEST_ANSWER = 256_000
"""Bytes."""
KEPT_S = 3600.0
"""What is known of the provider is asked again after that; its keys also when it signs with another one."""
ASKED_AT_ONCE = 8
CLOCKS_DIFFER_S = 60.0
LONGEST_SUB = 255
"""As the specification has it."""
ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA")
"""With a private key that the provider alone has; never ``none``, nor one whose secret is everybody's."""
ENDPOINTS = ("authorization_endpoint", "token_endpoint", "jwks_uri")


@dataclass(frozen=True)
class Known:
    """Whom the provider knows."""

    sub: str
    preferred_name: str
    role: Role | None


class Provider:
    """For the event loop's thread."""

    def __init__(self, settings: Settings, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock`` in seconds. Raises BadInput for a secret that cannot be read."""
        self.issuer = settings.oidc_issuer
        self.name = settings.oidc_name or urlsplit(self.issuer).hostname or self.issuer
        self._settings, self._clock = settings, clock
        self._secret = settings.oidc_secret
        self.logins = BegunLogins()
        self._kept: dict[str, tuple[float, dict[str, Any]]] = {}
        self._http = httpx.AsyncClient(
            limits=httpx.Limits(max_connections=ASKED_AT_ONCE),
            timeout=PROVIDER_TIMEOUT_S,
            headers={"Accept": "application/json", "Accept-Encoding": "identity"},
        )

    async def close(self) -> None:
        await self._http.aclose()

    async def address_of(self, begun: Begun) -> str:
        """Where the browser goes. Raises Problem."""
        async with self._in_time():
            described = await self._description()
        supported = described.get("scopes_supported")
        own = self._settings.oidc_claim
        asked = {
            "response_type": "code",
            "client_id": self._settings.oidc_client_id,
            "redirect_uri": begun.callback,
            "scope": f"openid profile{f' {own}' if isinstance(supported, list) and own in supported else ''}",
            "state": begun.state,
            "nonce": begun.nonce,
            "code_challenge": _challenge(begun.verifier),
            "code_challenge_method": "S256",
        }
        address = described["authorization_endpoint"]
        return f"{address}{'&' if '?' in address else '?'}{urlencode(asked)}"

    async def known(self, code: str, begun: Begun) -> Known:
        """Whom the provider's answer ``code`` is about. Raises Problem."""
        async with self._in_time():
            described = await self._description()
            tokens = await self._tokens(described, code, begun)
            claims = await self._checked(described, tokens.get("id_token"), begun)
            if not {self._settings.oidc_claim, "preferred_username"} <= set(claims):
                address, token = described.get("userinfo_endpoint"), tokens.get("access_token")
                claims = await self._completed(claims, address, token)
        preferred = (claims.get(each) for each in ("preferred_username", "name"))
        name = next((each for each in preferred if isinstance(each, str) and each.strip()), "")
        return Known(claims["sub"], name, self._role(claims))

    @asynccontextmanager
    async def _in_time(self) -> AsyncIterator[None]:
        """Raises Problem for what does not come, or comes too slowly."""
        try:
            with anyio.fail_after(PROVIDER_TIMEOUT_S):
                yield
        except (TimeoutError, httpx.HTTPError, httpx.InvalidURL) as error:
            raise Problem(
                503,
                "provider-away",
                f"{self.name} does not answer. Try again later; keys and passwords are taken meanwhile.",
            ) from error

    async def _description(self) -> dict[str, Any]:
        address = f"{self.issuer.rstrip('/')}/.well-known/openid-configuration"
        described = await self._kept_of(address)
        if described.get("issuer") != self.issuer:
            raise self._wrong("says that it is another one; an admin compares GLOVECAL_OIDC_ISSUER with it")
        for endpoint in ENDPOINTS:
            if not _is_plain(described.get(endpoint)) or not is_safe_address(described[endpoint]):
                raise self._wrong(f"names no {endpoint} that is reached by https; an admin looks there")
        return described

    async def _kept_of(self, address: str, *, anew: bool = False) -> dict[str, Any]:
        until, document = self._kept.get(address, (0.0, {}))
        if anew or not document or self._clock() > until:
            document = await self._asked(self._http.build_request("GET", address))
            self._kept[address] = (self._clock() + KEPT_S, document)
        return document

    async def _tokens(self, described: Mapping[str, Any], code: str, begun: Begun) -> dict[str, Any]:
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": begun.callback,
            "code_verifier": begun.verifier,
        }
        headers = {}
        client, methods = (
            self._settings.oidc_client_id,
            described.get("token_endpoint_auth_methods_supported"),
        )
        if not self._secret:
            form["client_id"] = client
        elif isinstance(methods, list) and "client_secret_post" in methods and _BASIC not in methods:
            form |= {"client_id": client, "client_secret": self._secret}
        else:
            pair = f"{quote(client, safe='')}:{quote(self._secret, safe='')}"
            headers["Authorization"] = f"Basic {base64.b64encode(pair.encode('ascii')).decode('ascii')}"
        request = self._http.build_request("POST", described["token_endpoint"], data=form, headers=headers)
        return await self._asked(request)

    async def _checked(self, described: Mapping[str, Any], token: Any, begun: Begun) -> dict[str, Any]:
        """The claims of an ID token that proves itself."""
        try:
            header = jwt.get_unverified_header(token) if _is_plain(token) else {}
            key = await self._signing_key(described["jwks_uri"], header.get("kid"))
            claims = jwt.decode(
                token, key, algorithms=ALGORITHMS, audience=self._settings.oidc_client_id, issuer=self.issuer,
                leeway=CLOCKS_DIFFER_S, options={"require": ["exp", "iat", "iss", "aud", "sub"]},
            )  # fmt: skip
        except (ExpiredSignatureError, ImmatureSignatureError) as error:
            raise self._wrong(
                "sent a proof that is not of now; begin again, or have both clocks set"
            ) from error
        except (PyJWTError, ValueError, TypeError, AttributeError) as error:
            raise self._wrong(
                "sent no proof for this service, signed by it; an admin compares the GLOVECAL_OIDC settings "
                "with what is registered there"
            ) from error
        audience, party = claims["aud"], claims.get("azp", self._settings.oidc_client_id)
        is_shared = isinstance(audience, list) and len(audience) > 1 and "azp" not in claims
        if party != self._settings.oidc_client_id or is_shared:
            raise self._wrong("sent a proof for another service; an admin looks at GLOVECAL_OIDC_CLIENT_ID")
        nonce, sub = claims.get("nonce"), claims["sub"]
        if not isinstance(nonce, str) or not hmac.compare_digest(nonce.encode(), begun.nonce.encode()):
            raise self._wrong("answered another login than this one; begin again")
        if not sub or len(sub) > LONGEST_SUB or not sub.isprintable():
            raise self._wrong("does not say who this is; an admin looks at the account there")
        return claims

    async def _signing_key(self, address: str, kid: Any) -> Any:
        """The one key that has this id, or the only one; asked for anew where there is none."""
        for anew in (False, True):
            keys = jwt.PyJWKSet.from_dict(await self._kept_of(address, anew=anew)).keys
            fitting = [each for each in keys if kid in (None, each.key_id) and each.public_key_use != "enc"]
            if len(fitting) == 1:
                return fitting[0].key
        raise ValueError("no key")

    async def _completed(self, claims: dict[str, Any], address: Any, token: Any) -> dict[str, Any]:
        """With what the provider says of the same person beside the ID token."""
        if not (_is_plain(token) and _is_plain(address) and is_safe_address(address)):
            return claims
        headers = {"Authorization": f"Bearer {token}"}
        more = await self._asked(self._http.build_request("GET", address, headers=headers))
        return {**more, **claims} if more.get("sub") == claims["sub"] else claims

    async def _asked(self, request: httpx.Request) -> dict[str, Any]:
        content = bytearray()
        answer = await self._http.send(request, stream=True)
        try:
            async for part in answer.aiter_raw():
                content += part
                if len(content) > LARGEST_ANSWER:
                    raise self._wrong("sends more than a login needs; an admin looks there")
        finally:
            await answer.aclose()
        try:
            document = json.loads(content) if answer.is_success else None
        except (ValueError, RecursionError):
            document = None
        if isinstance(document, dict):
            return document
        if request.method == "POST":
            raise self._wrong(
                "does not take this login, which may be over or used before: begin again. If it stays so, an "
                "admin compares GLOVECAL_OIDC_CLIENT_ID and GLOVECAL_OIDC_SECRET_FILE with what is registered"
            )
        raise self._wrong("does not answer as it should; try again later, or have an admin look there")

    def _role(self, claims: Mapping[str, Any]) -> Role | None:
        """The most that the values of the claim give; an address of mail counts once it is verified."""
        claim, roles = self._settings.oidc_claim, self._settings.oidc_roles
        if claim == "email" and claims.get("email_verified") is not True:
            return None
        value = claims.get(claim)
        values: Iterable[Any] = value if isinstance(value, list) else [value]
        given: list[Role] = [roles[each] for each in values if isinstance(each, str) and each in roles]
        return max(given, key=ROLES.index, default=None)

    def _wrong(self, what: str) -> Problem:
        return Problem(502, "provider-wrong", f"{self.name} {what}.")


_BASIC = "client_secret_basic"


def _is_plain(value: Any) -> bool:
    """Whether it is a text that may stand in a header or an address."""
    return isinstance(value, str) and value.isascii() and value.isprintable() and " " not in value


def _challenge(verifier: str) -> str:
    """S256 (RFC 7636)."""
    digest = hashlib.sha256(verifier.encode("ascii")).digest()
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode("ascii")
