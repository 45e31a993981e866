"""Who may do what on the wire of a site: one table, by key plane and kind; everything else is refused.

The router tells members apart by the common name of their certificates, which is ``KIND.NUMBER``. zenoh reads
its rules when it starts only, so the next few numbers of each kind are let in ahead: a member that is added
later needs no new router. Nobody can have such a certificate before the authority has signed it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from glovecal_client.keys import PLANES, ROOT, admission_key, check_identifier
from glovecal_client.site.member import Kind

Action = Literal["put", "subscribe", "ask", "answer", "declare", "see"]
"""``ask`` and ``answer``: queries. ``declare`` and ``see``: liveliness tokens."""

TABLE: dict[str, dict[Kind, tuple[Action, ...]]] = {
    "raw": {"capture": ("put",)},
    "pose": {"viewer": ("subscribe",)},
    "pose/meta": {"capture": ("subscribe",), "viewer": ("subscribe", "ask")},
    "pose/explain": {},
    "status": {"capture": ("put", "answer", "subscribe")},
    "meta": {"capture": ("put", "answer", "ask")},
    "alive": {"capture": ("declare", "see")},
    "log": {"capture": ("answer",)},
    "control": {"capture": ("answer",)},
    "picture": {},
}
"""A capture may do so for its own gloves only; it listens to status, meta and alive to find out whether
another has its glove. The service may do everything, and is the only one that publishes poses."""
assert tuple(TABLE) == PLANES

_IN, _OUT = "ingress", "egress"
_MESSAGES: dict[Action, tuple[tuple[str, str], ...]] = {
    "put": ((_IN, "put"), (_OUT, "declare_subscriber")),
    "subscribe": ((_IN, "declare_subscriber"), (_OUT, "put")),
    "ask": ((_IN, "query"), (_OUT, "reply"), (_OUT, "declare_queryable")),
    "answer": ((_IN, "declare_queryable"), (_OUT, "query"), (_IN, "reply")),
    "declare": ((_IN, "liveliness_token"),),
    "see": ((_IN, "liveliness_query"), (_IN, "declare_liveliness_subscriber"), (_OUT, "liveliness_token")),
}
"""What zenoh calls it, as the router sees it: what comes in from a member, what goes out to it."""
_OF_ANY_GLOVE = {(_OUT, "declare_subscriber"), (_OUT, "declare_queryable"), (_OUT, "query")}
"""Who listens or asks does so for all gloves at once (``*/raw``), and zenoh lets through only what a rule
covers whole. A capture gets no more by it: what it answers, and what it sends, is bound to its gloves."""
_ALL_MESSAGES = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable", "liveliness_token",
    "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
SPARE = 16


@dataclass(frozen=True)
class Admitted:
    """A member as the router knows it."""

    kind: Kind
    number: int
    gloves: tuple[str, ...] = ()
    """Those that a capture is bound to; none: any."""
    belongs: bool = True
    """False once it was revoked."""

    @property
    def common_name(self) -> str:
        """In its certificate."""
        return common_name(self.kind, self.number, bound=bool(self.gloves))


def common_name(kind: Kind, number: int, *, bound: bool = False) -> str:
    """Captures that are bound to gloves are counted apart: what the next may do is not known ahead."""
    return f"{'bound-' if bound else ''}{kind}.{number}"


class Rules:
    """The rules of one router, as made for the members of one moment."""

    def __init__(self, site: str, members: Iterable[Admitted]) -> None:
        self._site = check_identifier(site, "site")
        known = tuple(members)
        self._names: dict[tuple[Kind, tuple[str, ...]], set[str]] = {}
        for member in known:
            if member.belongs:
                self._admit(member)
        for kind in ("capture", "viewer"):
            last = max((each.number for each in known if each.kind == kind and not each.gloves), default=0)
            for number in range(last + 1, last + 1 + SPARE):
                self._admit(Admitted(kind, number))

    def _admit(self, member: Admitted) -> None:
        self._names.setdefault((member.kind, member.gloves), set()).add(member.common_name)

    def fit(self, members: Iterable[Admitted]) -> bool:
        """Whether a router with these rules does right by ``members``, so that it needs no others."""
        for member in members:
            if member.belongs:
                right = member.common_name in self._names.get((member.kind, member.gloves), ())
            else:
                right = all(member.common_name not in names for names in self._names.values())
            if not right:
                return False
        return True

    def access_control(self) -> dict[str, Any]:
        """For zenoh's configuration, ``access_control``."""
        rules: list[dict[str, Any]] = []
        subjects: list[dict[str, Any]] = []
        policies: list[dict[str, Any]] = []
        for index, ((kind, gloves), names) in enumerate(sorted(self._names.items())):
            keys = _keys(self._site, kind, gloves)
            if not keys:
                continue
            mine = [
                {
                    "id": f"{index}-{flow}-{message}",
                    "permission": "allow",
                    "flows": [flow],
                    "messages": [message],
                    "key_exprs": sorted(expressions),
                }
                for (flow, message), expressions in sorted(keys.items())
            ]
            rules += mine
            subjects.append({"id": str(index), "cert_common_names": sorted(names)})
            policies.append({"rules": [rule["id"] for rule in mine], "subjects": [str(index)]})
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": subjects,
            "policies": policies,
        }


def _keys(site: str, kind: Kind, gloves: Sequence[str]) -> dict[tuple[str, str], set[str]]:
    """Key expressions by flow and message."""
    if kind == "service":
        return {(flow, message): {"**"} for flow in (_IN, _OUT) for message in _ALL_MESSAGES}
    keys: dict[tuple[str, str], set[str]] = {}
    for plane, row in TABLE.items():
        for action in row.get(kind, ()):
            for way in _MESSAGES[action]:
                named = ("*",) if way in _OF_ANY_GLOVE or not gloves else gloves
                keys.setdefault(way, set()).update(f"{ROOT}/{site}/{glove}/{plane}" for glove in named)
    if keys:
        for way in _MESSAGES["see"]:
            keys.setdefault(way, set()).add(admission_key(site))
    return keys
