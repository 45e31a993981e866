"""What capturing two gloves at 120 Hz costs, and that a cut network loses no frame. Minutes: slow."""

from __future__ import annotations

import os
import threading
import time
from contextlib import ExitStack

import pytest
from realtime_support import SteadyDevice

from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings, CaptureSummary
from glovecal_client.frame_log import Recording
from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_router
from glovecal_service.settings import Settings

MINUTES = float(os.environ.get("GLOVECAL_CAPTURE_MINUTES", "10"))
RATE_HZ = 120.0
CUT_SHARE = 0.1
"""A minute of ten."""


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_two_gloves_cost_a_tenth_of_a_core_and_lose_nothing(settings: Settings) -> None:
    """The router runs in this process too: what it costs is counted."""
    stop, summaries = threading.Event(), list[CaptureSummary]()
    total_s = 60 * MINUTES

    def capture(glove: str) -> None:
        asked = CaptureSettings(
            GloveKeys(settings.site, glove), "anna", "w", (settings.zenoh,), settings.data / glove
        )
        summaries.append(CaptureDaemon(SteadyDevice(RATE_HZ), asked, lambda _: None).run(stop))

    threads = [threading.Thread(target=capture, args=(glove,)) for glove in ("left", "right")]
    with ExitStack() as opened:
        router = opened.enter_context(ExitStack())
        router.enter_context(open_router([settings.zenoh]))
        for thread in threads:
            thread.start()
        time.sleep(2.0)
        cpu_s, begun_s = time.process_time(), time.monotonic()
        time.sleep((1 - CUT_SHARE) / 2 * total_s)
        router.close()
        time.sleep(CUT_SHARE * total_s)
        opened.enter_context(open_router([settings.zenoh]))
        time.sleep((1 - CUT_SHARE) / 2 * total_s)
        share = (time.process_time() - cpu_s) / (time.monotonic() - begun_s)
        stop.set()
        for thread in threads:
            thread.join(60)
    print(f"{100 * share:.1f} % of a core, {[one.frames for one in summaries]} frames in {MINUTES:g} min")
    for one in summaries:
        numbers = [frame.sequence for frame in Recording.open(one.log).frames()]
        assert numbers == list(range(one.frames)), "every frame is in the log, in order"
        assert one.frames_not_logged == 0
        assert one.frames >= 0.98 * RATE_HZ * total_s
    assert share <= 0.10
