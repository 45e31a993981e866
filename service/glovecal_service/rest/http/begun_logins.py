"""Logins that wait for a provider: each is kept, sealed, in the browser that began it, and ends once."""

from __future__ import annotations

import json
import secrets
from collections import OrderedDict
from dataclasses import asdict, dataclass

from cryptography.fernet import Fernet, InvalidToken

from glovecal_service.rest.http.problem import Problem

LOGIN_LASTS_S = 600
"""Between the way to the provider and the way back."""
MOST_ENDED = 10_000


@dataclass(frozen=True)
class Begun:
    state: str
    nonce: str
    verifier: str
    callback: str
    """Address at which the provider answers."""
    page: str
    """To be shown then."""


class BegunLogins:
    """Nothing is kept here of a login that was begun: nobody fills this memory or pushes others out."""

    def __init__(self) -> None:
        self._seal = Fernet(Fernet.generate_key())
        self._ended: OrderedDict[str, None] = OrderedDict()

    def begin(self, callback: str, page: str) -> Begun:
        state, nonce, verifier = (secrets.token_urlsafe(32) for _ in range(3))
        return Begun(state, nonce, verifier, callback, page)

    def sealed(self, begun: Begun) -> str:
        """For the browser, which can neither read nor change it."""
        return self._seal.encrypt(json.dumps(asdict(begun)).encode()).decode("ascii")

    def end(self, sealed: str | None, state: str) -> Begun:
        """The login to which the provider answers with ``state``. Raises Problem where this browser began
        none, it is over, or was answered before."""
        try:
            begun = Begun(**json.loads(self._seal.decrypt((sealed or "").encode(), ttl=LOGIN_LASTS_S)))
        except InvalidToken:
            begun = None
        if begun is None or not secrets.compare_digest(begun.state.encode(), state.encode()):
            raise Problem(
                400,
                "no-such-login",
                f"This browser did not begin that login, or more than {LOGIN_LASTS_S // 60} minutes ago. "
                "Begin again here.",
            )
        if state in self._ended:
            raise Problem(400, "login-ended", "That login was used before. Begin again here.")
        self._ended[state] = None
        if len(self._ended) > MOST_ENDED:
            self._ended.popitem(last=False)
        return begun
