"""The end of the demo with a model that takes no time to train: ``python demo_stay_process.py FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

from glovecal_service.demo.processes import demo_place, running_service
from glovecal_service.demo.second_act import DIAGNOSED, Findings
from glovecal_service.demo.staying import stay
from glovecal_service.first_run.hidden_session import hidden_session


def main(folder: Path) -> None:
    place, hidden = demo_place(folder), hidden_session("hysteresis", 3, take_s=5.0)
    with running_service(place) as service:
        training, _ = hidden.write(folder)
        service.post("/subjects", {"name": "pia"})
        taken = service.upload_takes(training, subject="pia")
        job = service.post("/models/train", {"subject": "pia", "method": "linear", "folds": 0})
        found = Findings("pia", taken["layout"])
        found.models[DIAGNOSED] = service.wait_for_job(job["id"])["result"]["model"]
        stay(service, place, hidden, found, print, motion_s=5.0)
    print("all ended")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
