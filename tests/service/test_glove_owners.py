"""One process has a glove: shares, what moves when a process comes or goes, and who has it for a moment."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from realtime_support import eventually, free_endpoint

from glovecal_client.keys import service_alive_key, term_key
from glovecal_client.session import open_client, open_router
from glovecal_service.incoming.glove_owners import GloveOwners

GLOVES = [f"glove{number}" for number in range(64)]


class Site:
    """A router and processes that have gloves; all of them hear each glove's frames at once."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.processes: dict[str, tuple[ExitStack, GloveOwners]] = {}

    def start(self, name: str) -> GloveOwners:
        opened = ExitStack()
        session = opened.enter_context(open_client([self.endpoint], wait_s=20))
        owners = GloveOwners(session, "lab", f"realtime-{name}")
        owners.announce()
        self.processes[name] = opened, owners
        return owners

    def kill(self, name: str) -> None:
        """As the router sees it: the connection is gone, nothing was said."""
        opened, _ = self.processes.pop(name)
        opened.close()

    def look(self) -> dict[str, list[str]]:
        """Frames of all gloves come; who has each glove afterwards."""
        has: dict[str, list[str]] = {glove: [] for glove in GLOVES}
        for name, (_, owners) in self.processes.items():
            for glove in GLOVES:
                if owners.may_take(glove):
                    owners.take(glove)
            for glove in owners.kept(GLOVES):
                has[glove].append(name)
        return has

    def settled(self, *names: str) -> dict[str, str]:
        """Once each glove has one process and each of ``names`` has some."""

        def done() -> dict[str, str]:
            has = self.look()
            one = {glove: who[0] for glove, who in has.items() if len(who) == 1}
            return one if len(one) == len(GLOVES) and set(one.values()) == set(names) else {}

        return eventually(done, f"each glove has one of {names}")


@pytest.fixture
def site() -> Iterator[Site]:
    endpoint = free_endpoint()
    with open_router([endpoint]):
        site = Site(endpoint)
        yield site
        for name in list(site.processes):
            site.kill(name)


def test_only_the_gloves_of_a_process_that_goes_move_and_one_that_comes_has_its_share(site: Site) -> None:
    site.start("a")
    alone = site.settled("a")
    assert set(alone) == set(GLOVES)
    site.start("b")
    site.start("c")
    three = site.settled("a", "b", "c")
    assert min(list(three.values()).count(name) for name in "abc") >= 8
    site.kill("b")
    two = site.settled("a", "c")
    assert {glove for glove in GLOVES if two[glove] != three[glove]} == {
        glove for glove in GLOVES if three[glove] == "b"
    }
    site.start("b")
    assert site.settled("a", "b", "c") == three, "the same names have the same gloves"


def test_each_owner_has_a_higher_term_than_those_it_knew(site: Site) -> None:
    first, _ = site.start("a").take("glove1")
    assert first >= int(time.time()) - 600, "higher than before everything was started anew"
    terms = [first]
    for before, name in (("a", "b"), ("b", "c"), ("c", "a")):
        owners = site.start(name)
        site.kill(before)
        eventually(lambda owners=owners: owners.may_take("glove1"), "nobody else is there")
        term, was_anothers = owners.take("glove1")
        assert was_anothers
        assert owners.take("glove1") == (term, False)
        terms.append(term)
    assert terms == sorted(set(terms))


def test_of_two_that_have_a_glove_the_higher_term_keeps_it(site: Site) -> None:
    mine = site.start("a")
    with open_client([site.endpoint], wait_s=20) as stranger:
        other = stranger.liveliness()
        assert mine.may_take("glove1")
        term, _ = mine.take("glove1")
        lower = other.declare_token(term_key("lab", "realtime-b", "glove1", term - 1))
        higher = other.declare_token(term_key("lab", "realtime-c", "glove1", term + 1))
        eventually(lambda: mine.kept(["glove1"]) == set(), "it yields to the higher term")
        assert not mine.is_mine("glove1")
        assert not mine.may_take("glove1"), "not at once"
        higher.undeclare()
        lower.undeclare()
        eventually(lambda: mine.may_take("glove1"), "it is its turn again")
        again, was_anothers = mine.take("glove1")
        assert again > term + 1
        assert was_anothers


@pytest.mark.parametrize("rest", ["b/has/UPPER/3", "b/has/g/-3", "b/has/g/99999999999", "B/alive"])
def test_tokens_that_are_none_of_ours_change_nothing(site: Site, rest: str) -> None:
    mine = site.start("a")
    mine.take("glove1")
    with open_client([site.endpoint], wait_s=20) as stranger:
        token = stranger.liveliness().declare_token(f"glovecal/lab/service/realtime-{rest}")
        sound = stranger.liveliness().declare_token(service_alive_key("lab", "realtime-z"))
        eventually(lambda: not all(mine.may_take(glove) for glove in GLOVES), "the other is heard of")
        assert mine.kept(["glove1"]) == {"glove1"}
        token.undeclare()
        sound.undeclare()


def test_a_recorder_is_no_rival_of_real_time(site: Site) -> None:
    mine = site.start("a")
    with open_client([site.endpoint], wait_s=20) as stranger:
        tokens = [
            stranger.liveliness().declare_token(service_alive_key("lab", "recorder-b")),
            stranger.liveliness().declare_token(service_alive_key("lab", "realtime-b")),
        ]
        eventually(lambda: not all(mine.may_take(glove) for glove in GLOVES), "the other is heard of")
        tokens.pop().undeclare()
        eventually(lambda: all(mine.may_take(glove) for glove in GLOVES), "the recorder counts for nothing")
        tokens.pop().undeclare()
