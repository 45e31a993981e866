"""Whether the capture daemon with its logs in DATA is at work: for its image, whose engine asks.

``python -m glovecal_client.capture.health_check DATA`` prints one sentence; exit code 0 when it is, else 1. A
daemon whose glove or service is away is at work: it opens the glove again, and records without the service.
"""

from __future__ import annotations

import sys
from pathlib import Path

from glovecal_client.capture.log_folder import seen_s_ago

SEEN_WITHIN_S = 10.0


def main(data: Path) -> int:
    seen = seen_s_ago(data)
    if seen is None:
        print(f"No capture has its log in {data}.")
        return 1
    glove, ago_s = seen
    print(f"The capture of glove {glove} was seen {ago_s:.0f} s ago.")
    return 0 if ago_s <= SEEN_WITHIN_S else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "/data")))
