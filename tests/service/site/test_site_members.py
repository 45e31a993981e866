"""A member's file: read with care, judged before it is used, renewed and revoked."""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from site_support import Heard, Site, eventually, free_port

from glovecal_client.errors import NoAnswer, NotAdmitted
from glovecal_client.session import open_client, open_router
from glovecal_client.site.certificates import check_certificate
from glovecal_client.site.member import BadSiteFile, Member, read_member
from glovecal_models.errors import BadInput
from glovecal_service.store.site.authority import CLOCKS_APART
from glovecal_service.store.site.site_folder import SiteFolder

POSE = "glovecal/lab/right/pose"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory):
    with Site(tmp_path_factory.mktemp("members")) as site:
        yield site


def test_a_certificate_of_every_member_is_good_for_397_days_at_most(site: Site) -> None:
    for member in site.members.values():
        facts = check_certificate(member)
        assert facts.not_after - facts.not_before == timedelta(days=397)
        assert bool(facts.hosts) is (member.kind == "service")


@pytest.mark.skipif(sys.platform == "win32", reason="files have no modes there")
def test_files_are_for_their_owner_only(site: Site) -> None:
    assert site.folder.folder.stat().st_mode & 0o777 == 0o700
    modes = {path.name: path.stat().st_mode & 0o777 for path in site.folder.folder.iterdir()}
    assert set(modes.values()) == {0o600}, modes


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"format": "other"}, "no field 'format'"),
        ({"kind": "king"}, "its kind is 'king'"),
        ({"role": "king"}, "its role is 'king'"),
        ({"site": "No Name"}, "site: 'No Name'"),
        ({"zenoh": ["tcp/127.0.0.1:7447"]}, "'zenoh'"),
        ({"zenoh": "tls/a:1"}, "'zenoh' is no list"),
        ({"zenoh": ["tls/a:1"] * 33}, "'zenoh' is no list"),
        ({"rest": "http://lab:8600"}, "'rest'"),
        ({"certificate": "-----BEGIN NOTHING"}, "'certificate'"),
        ({"private_key": None}, "'private_key' is no text"),
        ({"api_key": 1}, "'api_key' is no text"),
    ],
)
def test_a_wrong_file_is_told_by_what_is_wrong(
    site: Site, tmp_path: Path, change: dict[str, object], problem: str
) -> None:
    file = tmp_path / "wrong.glovecal"
    file.write_text(json.dumps(json.loads(site.members["viewer"].document()) | change))
    with pytest.raises(BadSiteFile) as told:
        read_member(file)
    assert problem in str(told.value)
    assert "glovecal site add" in str(told.value)
    assert "PRIVATE KEY" not in str(told.value)


@pytest.mark.parametrize("content", [b"", b"\xff", b"[]", b"{" * 60000, b"[" * 60000, b" " * 70000, b"1e999"])
def test_a_file_of_another_kind_is_told(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "other.glovecal"
    file.write_bytes(content)
    with pytest.raises(BadSiteFile, match="is not a site's file"):
        read_member(file)


def test_who_a_member_is_shows_no_secret(site: Site) -> None:
    assert "KEY" not in repr(dataclasses.replace(site.members["viewer"], api_key="KEY-of-rest"))


def test_an_expired_and_a_foreign_certificate_are_told_before_anything_is_sent(
    site: Site, tmp_path: Path
) -> None:
    old = site.folder.add("old", "viewer", days=1, now=datetime.now(UTC) - timedelta(days=3))
    with pytest.raises(NotAdmitted, match="has expired"):
        check_certificate(old)
    early = site.folder.add("early", "viewer", now=datetime.now(UTC) + timedelta(days=3))
    with pytest.raises(NotAdmitted, match="not valid yet"):
        check_certificate(early)
    viewer = site.members["viewer"]
    with pytest.raises(NotAdmitted, match="not signed by the authority"):
        check_certificate(dataclasses.replace(viewer, authority=_other_site(tmp_path).authority))
    with pytest.raises(BadSiteFile, match="do not fit together"):
        check_certificate(dataclasses.replace(viewer, private_key=old.private_key))


def _other_site(place: Path) -> Member:
    folder = SiteFolder(place)
    folder.begin("lab", [], zenoh_port=1, rest_port=1)
    return read_member(folder.service_file)


def refusal(site: Site, monkeypatch: pytest.MonkeyPatch, member: Member, endpoint: str = "") -> str:
    monkeypatch.setenv("GLOVECAL_SITE_FILE", str(site.file(member)))
    with pytest.raises(NotAdmitted) as told, open_client([endpoint or site.endpoint], wait_s=10):
        pass
    return str(told.value)


def test_why_a_login_fails_is_told(site: Site, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("glovecal_client.session.ADMITTED_WITHIN_S", 0.5)
    monkeypatch.setattr("glovecal_client.site.login.GREETED_WITHIN_S", 1.0)
    assert "it was revoked" in refusal(site, monkeypatch, site.members["revoked"])
    stranger = dataclasses.replace(_other_site(tmp_path), kind="viewer")
    assert "belongs to another site" in refusal(site, monkeypatch, stranger)
    # it knows our authority, and its own certificate is of another
    viewer = site.members["viewer"]
    trusting = dataclasses.replace(stranger, authority=stranger.authority + viewer.authority)
    assert "does not know the authority" in refusal(site, monkeypatch, trusting)
    plain = f"tcp/127.0.0.1:{free_port()}"
    with open_router([plain]):
        assert "does not encrypt" in refusal(site, monkeypatch, viewer, plain)
    nobody = f"tls/127.0.0.1:{free_port()}"
    monkeypatch.setenv("GLOVECAL_SITE_FILE", str(site.file(viewer)))
    with pytest.raises(NoAnswer, match="no router at"), open_client([nobody], wait_s=0):
        pass
    with open_client([site.endpoint], wait_s=10) as session:
        assert session.zid()


def test_a_certificate_that_ends_ends_the_stream(site: Site) -> None:
    lasts = timedelta(seconds=3)
    short = site.folder.add(
        "short", "viewer", days=1, now=datetime.now(UTC) + lasts + CLOCKS_APART - timedelta(days=1)
    )
    heard = Heard(site.session(short), POSE)
    eventually(lambda: site.router.session.put(POSE, b"pose") or heard.samples, "poses")
    ends = check_certificate(short).not_after.timestamp()
    eventually(lambda: not _is_heard(site, heard) and time.time() > ends, "the end")
    assert time.time() > ends
    count = len(heard.samples)
    for _ in range(50):
        site.router.session.put(POSE, b"pose")
        time.sleep(0.002)
    assert len(heard.samples) == count


def _is_heard(site: Site, heard: Heard) -> bool:
    before = len(heard.samples)
    site.router.session.put(POSE, b"pose")
    time.sleep(0.05)
    return len(heard.samples) > before


def test_a_renewed_file_is_used_without_a_gap(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    file = site.file(site.members["viewer"])
    monkeypatch.setenv("GLOVECAL_SITE_FILE", str(file))
    numbers: list[int] = []
    with open_client([site.endpoint]) as session:
        inner = session._session  # type: ignore[attr-defined]
        session.declare_subscriber(POSE, lambda sample: numbers.append(int(sample.payload.to_bytes())))
        eventually(lambda: site.router.session.put(POSE, b"0") or numbers, "poses")
        renewed = site.folder.renew("viewer")
        assert renewed.certificate != site.members["viewer"].certificate
        beside = file.with_suffix(".new")
        beside.write_text(renewed.document())
        beside.replace(file)
        sent = 0

        def publish() -> bool:
            nonlocal sent
            sent += 1
            site.router.session.put(POSE, str(sent))
            time.sleep(0.004)
            return session._session is not inner  # type: ignore[attr-defined]

        eventually(publish, "another session")
        for _ in range(100):
            publish()
        eventually(lambda: sent in numbers, "the last pose")
    missed = sorted(set(range(1, sent + 1)) - set(numbers))
    print(f"of {sent} poses during a renewal {len(missed)} were missed")
    assert missed == []


def test_the_service_renews_its_own_while_its_router_runs(site: Site) -> None:
    before = site.router._member
    site.folder.renew("service", hosts=["lab.example"])
    eventually(lambda: site.router._member != before, "the service's new certificate")
    assert "lab.example" in check_certificate(site.router._member).hosts
    heard = Heard(site.session("viewer"), POSE)
    eventually(lambda: site.router.session.put(POSE, b"pose") or heard.samples, "poses with it")


def test_the_authority_s_key_may_be_moved_away(tmp_path: Path) -> None:
    folder = SiteFolder(tmp_path / "data")
    folder.begin("lab", ["lab.example"], zenoh_port=7447, rest_port=8600)
    away = folder.authority_key.rename(tmp_path / "authority.key")
    with pytest.raises(BadInput, match="--authority-key"):
        folder.add("viewer", "viewer")
    member = folder.add("viewer", "viewer", key=away)
    assert (member.zenoh, member.rest) == (("tls/lab.example:7447",), "https://lab.example:8600")
    with pytest.raises(BadInput, match="gloves are for a capture"):
        folder.add("second", "viewer", gloves=["right"], key=away)
    with pytest.raises(BadInput, match="is a member already"):
        folder.add("viewer", "viewer", key=away)
    with pytest.raises(BadInput, match="there is a site"):
        folder.begin("lab", [], zenoh_port=1, rest_port=1)
    other = SiteFolder(tmp_path / "other")
    other.begin("lab", [], zenoh_port=1, rest_port=1)
    with pytest.raises(BadInput, match="not that of this site's authority"):
        folder.add("another", "viewer", key=other.authority_key)


def test_a_name_that_was_revoked_may_be_given_again_and_the_old_file_stays_out(site: Site) -> None:
    first = site.folder.add("again", "viewer")
    site.folder.revoke("again")
    second = site.folder.add("again", "viewer")
    names = check_certificate(first).common_name, check_certificate(second).common_name
    assert names[0] != names[1]
    rows = [row for row in site.folder.register().members if row.name == "again"]
    assert [row.revoked is None for row in rows] == [False, True]


def test_a_running_client_is_told_that_it_was_revoked_and_let_in_again(
    site: Site, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    file = site.file(site.folder.add("running", "viewer"))
    monkeypatch.setenv("GLOVECAL_SITE_FILE", str(file))
    with open_client([site.endpoint]) as session:
        heard = Heard(session, POSE)
        eventually(lambda: site.router.session.put(POSE, b"pose") or heard.samples, "poses")
        site.folder.revoke("running")
        eventually(lambda: "site lab answers running no more" in caplog.text, "silence")
        assert caplog.text.count("no more") == 1
        again = file.with_suffix(".again")
        again.write_text(site.folder.add("running", "viewer").document())
        again.replace(file)
        eventually(lambda: "answers running again" in caplog.text, "admission")
        before = len(heard.samples)
        eventually(lambda: site.router.session.put(POSE, b"pose") or len(heard.samples) > before, "poses")
