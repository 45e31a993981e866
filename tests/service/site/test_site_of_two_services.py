"""A second service of a site: its router is linked to the first one's over TLS, by the same rules."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import cast

import zenoh
from site_support import Heard, Site, eventually, free_port, tokens

from glovecal_client.keys import service_alive_key
from glovecal_client.session import open_client
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.settings import Settings
from glovecal_service.store.site.router import SiteRouter
from glovecal_service.store.site.site_folder import SiteFolder


def test_frames_poses_and_owners_pass_between_linked_routers_and_nothing_else_does(
    tmp_path: Path, monkeypatch
) -> None:
    with Site(tmp_path / "one") as first:
        other = tmp_path / "two" / "data" / "site"
        shutil.copytree(
            first.folder.folder, other, ignore=shutil.ignore_patterns("authority.key", "service.glovecal")
        )
        file = first.file(first.folder.add("lab-2", "service"))
        endpoint = f"tls/127.0.0.1:{free_port()}"
        settings = Settings(
            data=tmp_path / "two" / "data", zenoh=endpoint, site_file=file, zenoh_peers=first.endpoint
        )
        assert SiteFolder(settings.data).register().site == "lab"
        second = SiteRouter(settings, file)
        try:
            monkeypatch.setenv("GLOVECAL_SITE_FILE", str(first.file(first.members["viewer"])))
            with open_client([f"{endpoint},{first.endpoint}"], wait_s=60) as viewer:
                poses, frames = Heard(viewer, "glovecal/lab/*/pose"), Heard(viewer, "glovecal/lab/*/raw")
                seen = Heard(second.session, "glovecal/lab/*/raw")
                capture = first.session("capture")

                def through() -> bool:
                    capture.put("glovecal/lab/right/raw", b"frame")
                    capture.put("glovecal/lab/right/pose", b"forged")
                    first.router.session.put("glovecal/lab/right/pose", b"pose")
                    return bool(poses.samples and seen.samples)

                eventually(through, "frames reach the second service and poses its viewers")
                assert {content for _, content in poses.samples} == {b"pose"}
                assert not frames.samples
            mine = GloveOwners(cast(zenoh.Session, second.session), "lab", "realtime-2")
            token = first.router.session.liveliness().declare_token(service_alive_key("lab", "realtime-1"))
            gloves = [f"glove{number}" for number in range(32)]
            eventually(lambda: not all(map(mine.may_take, gloves)), "each has its share")
            token.undeclare()
            eventually(lambda: all(map(mine.may_take, gloves)), "all are the one's that is left")
            mine.close()
            assert not tokens(first.session("viewer"), "glovecal/lab/service/**", 1.0)
        finally:
            second.session.close()
