"""What each kind of member may do on the wire, tried for every key plane; forgeries reach nobody."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
import zenoh
from site_support import Heard, Site, answered, eventually, tokens

from glovecal_client.keys import PLANES
from glovecal_client.site.member import read_member
from glovecal_service.store.site.site_folder import SiteFolder

EXPECTED = """
plane         | capture                   | viewer
raw           | put                       | -
pose          | -                         | subscribe
pose/meta     | subscribe                 | subscribe ask
pose/explain  | -                         | -
status        | put answer subscribe      | -
meta          | put answer ask            | -
alive         | declare see               | -
log           | answer                    | -
control       | answer                    | -
picture       | -                         | -
"""
ACTIONS = ("put", "subscribe", "ask", "answer", "declare", "see")
WHO = {"capture": "capture", "bound": "capture", "other": "capture", "viewer": "viewer",
       "revoked": "nobody"}  # fmt: skip
TIMEOUT_S = 1.5


def allowed() -> set[tuple[str, str, str]]:
    """Cells of the table above: member, plane, action, for the glove ``right``."""
    head, *rows = (line.split("|") for line in EXPECTED.strip().splitlines())
    kinds = [cell.strip() for cell in head[1:]]
    table = {
        (kind, row[0].strip(), action)
        for row in rows
        for kind, cell in zip(kinds, row[1:], strict=True)
        for action in cell.split()
        if action != "-"
    }
    return {
        (name, plane, action)
        for name, kind in WHO.items()
        for plane in PLANES
        for action in ACTIONS
        if (kind, plane, action) in table and name != "other"  # which is bound to the glove left
    }


def test_every_plane_kind_and_action_is_let_through_exactly_as_the_table_says(site: Site) -> None:
    service = site.session("service")
    sessions = {name: site.session(name) for name in WHO}
    keys = {plane: f"glovecal/lab/right/{plane}" for plane in PLANES}
    found: set[tuple[str, str, str]] = set()

    def note(action: str, name: str, heard: set[str]) -> None:
        found.update((name, plane, action) for plane, key in keys.items() if key in heard)

    _try_puts(site, service, sessions, keys, note)
    _try_subscriptions(service, sessions, keys, note)
    _try_questions(service, sessions, keys, note)
    _try_answers(service, sessions, keys, note)
    _try_tokens(service, sessions, keys, note)
    assert len(WHO) * len(PLANES) * len(ACTIONS) == 300
    assert found == allowed()


Note = Callable[[str, str, set[str]], None]


def _try_puts(site: Site, service: Any, sessions: dict[str, Any], keys: dict[str, str], note: Note) -> None:
    heard = Heard(service, "glovecal/**")
    first = "a first frame"
    eventually(lambda: sessions["bound"].put(keys["raw"], b"first") or heard.samples, first)
    for name, session in sessions.items():
        for key in keys.values():
            session.put(key, name, congestion_control=zenoh.CongestionControl.BLOCK)
    for name, glove in (("capture", "any"), ("bound", "right"), ("other", "left")):
        _pass(site, sessions[name], f"glovecal/lab/{glove}/raw")
    _settle(sessions)
    wanted = {(keys[plane], name.encode()) for name, plane, action in allowed() if action == "put"}
    eventually(lambda: wanted <= set(heard.samples), "what may be put")
    for name in sessions:
        note("put", name, {key for key, text in heard.samples if text == name.encode()})
    heard.close()


def _try_subscriptions(service: Any, sessions: dict[str, Any], keys: dict[str, str], note: Note) -> None:
    heard = {(name, key): Heard(session, key) for name, session in sessions.items() for key in keys.values()}
    _settle(sessions)
    for key in keys.values():
        service.put(key, "told")
    eventually(lambda: heard["viewer", keys["pose"]].samples, "a pose for the viewer")
    eventually(lambda: heard["bound", keys["status"]].samples, "a status for the capture")
    _settle(sessions)
    for (name, _), each in heard.items():
        note("subscribe", name, each.keys())
        each.close()


def _try_questions(service: Any, sessions: dict[str, Any], keys: dict[str, str], note: Note) -> None:
    answers = [service.declare_queryable(key, _answer) for key in keys.values()]
    _settle(sessions)
    asked = {name: [session.get(key, timeout=TIMEOUT_S) for key in keys.values()]
             for name, session in sessions.items()}  # fmt: skip
    for name, replies in asked.items():
        note("ask", name, {str(reply.ok.key_expr) for some in replies for reply in some if reply.ok})
    for each in answers:
        each.undeclare()


def _try_answers(service: Any, sessions: dict[str, Any], keys: dict[str, str], note: Note) -> None:
    for name, session in sessions.items():
        answers = [session.declare_queryable(key, _answer) for key in keys.values()]
        _settle({name: session})
        asked = [service.get(key, timeout=TIMEOUT_S) for key in keys.values()]
        note("answer", name, {str(reply.ok.key_expr) for some in asked for reply in some if reply.ok})
        for each in answers:
            each.undeclare()
        _settle({name: session})


def _try_tokens(service: Any, sessions: dict[str, Any], keys: dict[str, str], note: Note) -> None:
    for name, session in sessions.items():
        declared = [session.liveliness().declare_token(key) for key in keys.values()]
        _settle({name: session})
        note("declare", name, set(tokens(service, "glovecal/lab/right/**", TIMEOUT_S)))
        for each in declared:
            each.undeclare()
        eventually(lambda: not tokens(service, "glovecal/lab/right/**", TIMEOUT_S), "the tokens to go")
    declared = [service.liveliness().declare_token(key) for key in keys.values()]
    _settle({"service": service})
    seen = {
        name: [session.liveliness().get(key, timeout=TIMEOUT_S) for key in keys.values()]
        for name, session in sessions.items()
    }
    for name, replies in seen.items():
        note("see", name, {str(reply.ok.key_expr) for some in replies for reply in some if reply.ok})
    for each in declared:
        each.undeclare()


def _answer(query: zenoh.Query) -> None:
    with query:
        query.reply(query.key_expr, "answer")


def _settle(sessions: dict[str, Any]) -> None:
    """The router has looked at what was sent before on each connection, as far as its answers can tell."""
    waiting = [
        session.liveliness().get("glovecal/lab/service/router/admits", timeout=0.3)
        for session in sessions.values()
    ]
    for replies in waiting:
        list(replies)


def _pass(site: Site, session: Any, key: str) -> None:
    """What was put before on this connection has gone before this put, which is allowed."""
    heard = Heard(site.router.session, key)
    eventually(lambda: session.put(key, b"pass") or heard.samples, f"a put on {key}")
    heard.close()


FORGED = 10_000


def test_forged_poses_frames_metas_and_statuses_reach_nobody(site: Site) -> None:
    """Those of a viewer, and those of a capture that has another glove; nor does what they send again."""
    heard = [Heard(each, "glovecal/lab/right/**") for each in (site.router.session, site.session("service"))]
    watching = Heard(site.session("viewer"), f"{_RIGHT}/pose")
    right, forgers = site.session("bound"), [site.session("viewer"), site.session("other")]
    genuine = {"raw": b"frame 1", "meta": b"{}", "status": b"{}"}
    for plane, payload in genuine.items():
        eventually(
            lambda p=plane, b=payload: right.put(f"glovecal/lab/right/{p}", b) or _has(heard, p), plane
        )
    for forger in forgers:
        for plane in ("raw", "pose", "pose/meta", "meta", "status"):
            key, payload = f"glovecal/lab/right/{plane}", b"forged"
            for _ in range(FORGED):
                forger.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
    answer = site.router.session.declare_queryable("glovecal/lab/right/pose/meta", _answer)
    asked = "what was asked after the forgeries"
    eventually(lambda: answered(forgers[0], "glovecal/lab/right/pose/meta", TIMEOUT_S), asked)
    answer.undeclare()
    _pass(site, forgers[1], "glovecal/lab/left/raw")
    right.put("glovecal/lab/right/raw", b"marker")
    site.router.session.put("glovecal/lab/right/pose", b"marker")
    eventually(lambda: all((f"{_RIGHT}/raw", b"marker") in each.samples for each in heard), "the marker")
    eventually(lambda: (f"{_RIGHT}/pose", b"marker") in watching.samples, "the marker's pose")
    forged = [sample for each in heard for sample in each.samples if sample[1] == b"forged"]
    assert forged == []
    assert watching.samples == [(f"{_RIGHT}/pose", b"marker")]


_RIGHT = "glovecal/lab/right"


def _has(heard: list[Heard], plane: str) -> bool:
    return all(any(key == f"{_RIGHT}/{plane}" for key, _ in each.samples) for each in heard)


def test_a_stranger_with_an_authority_of_its_own_does_not_get_in(site: Site, tmp_path: Any) -> None:
    folder = SiteFolder(tmp_path)
    folder.begin("lab", [], zenoh_port=site.port, rest_port=1)
    with pytest.raises(zenoh.ZError):
        site.session(read_member(folder.service_file))


def test_the_stream_of_a_revoked_member_stops_and_the_others_go_on(site: Site) -> None:
    leaving = site.folder.add("leaving", "viewer")
    streams = [Heard(site.session(member), "glovecal/lab/left/pose") for member in (leaving, "viewer")]
    arrived: list[tuple[int, float]] = []

    def publish() -> None:
        counts = [len(stream.samples) for stream in streams]
        site.router.session.put("glovecal/lab/left/pose", b"pose")
        time.sleep(0.005)
        now = time.monotonic()
        for index, stream in enumerate(streams):
            if len(stream.samples) > counts[index]:
                arrived.append((index, now))

    eventually(lambda: publish() or {0, 1} <= {index for index, _ in arrived}, "both streams")
    revoked = time.monotonic()
    site.folder.revoke("leaving")
    quiet = _Quiet(site)
    eventually(
        lambda: publish() or quiet.is_over(arrived), "the router with other rules, and the other stream"
    )
    before = max(at for index, at in arrived if index == 0) - revoked
    kept = [at for index, at in arrived if index == 1]
    gap = max(later - earlier for earlier, later in pairwise(kept))
    print(f"a revoked viewer's stream stopped {before:.2f} s after; the others' gap was {gap:.2f} s")
    length = len(streams[0].samples)
    for _ in range(50):
        publish()
    assert len(streams[0].samples) == length


class _Quiet:
    """Whether the router has been replaced and the other stream runs again."""

    def __init__(self, site: Site) -> None:
        self._site, self._session = site, site.router.session._session
        self._replaced = 0.0

    def is_over(self, arrived: list[tuple[int, float]]) -> bool:
        if not self._replaced and self._site.router.session._session is not self._session:
            self._replaced = time.monotonic()
        return bool(self._replaced) and any(index == 1 and at > self._replaced + 0.5 for index, at in arrived)


def test_a_member_that_is_added_needs_no_other_router(site: Site) -> None:
    before = site.router.session._session
    added = [site.folder.add(f"added-{number}", "viewer") for number in range(3)]
    heard = [Heard(site.session(member), "glovecal/lab/left/pose") for member in added]
    eventually(
        lambda: (
            site.router.session.put("glovecal/lab/left/pose", b"pose") or all(each.samples for each in heard)
        ),
        "poses for the new members",
    )
    site.router.look()
    assert site.router.session._session is before


def test_a_capture_bound_to_gloves_is_let_in_soon(site: Site) -> None:
    added = site.folder.add("late", "capture", gloves=["third"])
    heard = Heard(site.router.session, "glovecal/lab/third/raw")
    session = site.session(added)
    eventually(lambda: session.put("glovecal/lab/third/raw", b"frame") or heard.samples, "its frames")
    assert answered(session, "glovecal/lab/right/log", 0.5) == []
