"""``python3 do.py study camera``: is a camera as good a reference as true angles?

Gloves and camera are simulated; no picture is made. What the camera's errors are like was measured on hands
that another program draws (``tests/simulated/simulated_camera.py``). Clock offsets, the error of a
calibration in a second wearing, hidden effects judged by the camera, clean gloves.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from camera_gloves import CAMERA_SIZE, TRUE_SIZE, CalibratedGlove, CameraGlove, clock_error
from intervals import wilson

from glovecal_models.calibration.methods import Method
from glovecal_models.worker_processes import pin_blas_to_one_thread

GLOVES = {
    "cyberglove": "CyberGlove, fits differently each time",
    "steady": "five sensors that fit the same each time",
}
METHODS: tuple[Method, ...] = ("lmc_gpr", "linear")
EFFECTS = ("hysteresis", "cross_coupling", "donning_shift")
Answer = Mapping[str, Any]


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study camera", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--gloves", type=int, default=14, help="of each hidden effect (default 14)")
    parser.add_argument("--clean", type=int, default=60, help="clean gloves (default 60)")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for answers and the table")
    parser.add_argument("--smoke", action="store_true", help="one of a few, nothing written: seconds")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        print(table([task() for task in tasks(1, 1, 1)][::7]))
        return 0
    options.folder.mkdir(parents=True, exist_ok=True)
    file = options.folder / "camera.jsonl"
    done = [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.is_file() else []
    for place, task in enumerate(tasks(options.gloves, options.clean, 40)):
        if place < len(done):
            continue
        done.append(task())
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(done[-1]) + "\n")
    text = table(done)
    print(text)
    (options.folder / "camera.md").write_text(f"# The camera as the reference\n\n{text}\n", encoding="utf-8")
    return 0


def tasks(gloves: int, clean: int, clocks: int) -> Iterator[Callable[[], dict[str, Any]]]:
    """In the order of the answers' file; all the same, so that a study that was stopped goes on."""
    for number in range(max(clean, gloves)):
        if number < clean:
            yield lambda n=number: {"part": "clean", **CameraGlove("none", n).named()}
        for effect in EFFECTS if number < gloves else ():
            yield lambda n=number, e=effect: {"part": "hidden", **CameraGlove(e, n).named()}
        for motion in ("natural", "fast") if number < clocks else ():
            yield lambda n=number, m=motion: {"part": "clock", **clock_error(n, m)}
        for method in METHODS if number < 10 else ():
            yield lambda n=number, m=method: {"part": "calibration", **CalibratedGlove(n).of_steady(m)}
            if number < 6:
                yield lambda n=number, m=method: {
                    "part": "calibration",
                    **CalibratedGlove(n).of_cyberglove(m),
                }


def table(answers: Sequence[Answer]) -> str:
    """A table in Markdown: demanded beside measured."""
    rows = [*_clock_rows(answers), *_calibration_rows(answers), *_hidden_rows(answers), *_clean_rows(answers)]
    return "\n".join(["| | measured | demanded |", "|---|---|---|", *rows])


def _of(answers: Sequence[Answer], part: str, **wanted: Any) -> list[Answer]:
    return [
        item
        for item in answers
        if item["part"] == part and all(item[name] == value for name, value in wanted.items())
    ]


def _clock_rows(answers: Sequence[Answer]) -> Iterator[str]:
    for motion in ("natural", "fast"):
        found = _of(answers, "clock", motion=motion)
        if len(found) > 1:
            error, sd = (1e3 * np.array([item[name] for item in found]) for name in ("error_s", "sd_s"))
            yield (
                f"| clock offset, 30 s of {motion} motion, {len(found)} gloves | bias {error.mean():.1f} ms, "
                f"SD {error.std(ddof=1):.1f} ms (stated: {np.sqrt(np.mean(sd**2)):.1f} ms) | 5 ms each |"
            )


def _calibration_rows(answers: Sequence[Answer]) -> Iterator[str]:
    for glove, method in product(("cyberglove", "steady"), METHODS):
        asked = _of(answers, "calibration", method=method, glove=glove)
        found = [item for item in asked if item["ratio"] is not None]
        refused = f", {len(asked) - len(found)} with too few samples" if len(found) < len(asked) else ""
        if found:
            true, seen = (
                np.sqrt(np.mean([item[name] ** 2 for item in found])) for name in ("true", "camera")
            )
            worst = max(item["ratio"] for item in found)
            what = f"{GLOVES[glove]}, {method}, second wearing, {len(found)} gloves{refused}"
            yield (
                f"| {what} | {seen:.2f} degrees by the camera, {true:.2f} by true angles: "
                f"{seen / true:.2f} x (worst glove {worst:.2f} x) | 1.5 x |"
            )


def _hidden_rows(answers: Sequence[Answer]) -> Iterator[str]:
    for effects in ((effect,) for effect in EFFECTS):
        yield from _hidden_row(answers, effects)
    yield from _hidden_row(answers, EFFECTS)


def _hidden_row(answers: Sequence[Answer], effects: Sequence[str]) -> Iterator[str]:
    found = [item for item in _of(answers, "hidden") if item["effect"] in effects]
    if found:
        true, seen = (sum(item[kind] == item["effect"] for item in found) for kind in ("true", "camera"))
        yield (
            f"| {' or '.join(effects)} named | by the camera at {CAMERA_SIZE} floors "
            f"{_share(seen, len(found))}; by a true reference at {TRUE_SIZE} {_share(true, len(found))} "
            "| within 10 points |"
        )


def _clean_rows(answers: Sequence[Answer]) -> Iterator[str]:
    found = _of(answers, "clean")
    if found:
        true, seen = (sum(item[kind] is not None for item in found) for kind in ("true", "camera"))
        alarms = sum(item["alarm_camera"] for item in found)
        yield (
            f"| clean gloves: an effect is named | by the camera {seen} of {len(found)} (and {alarms} "
            f"unexplained residuals); by a true reference {true} | 1 of 60 |"
        )


def _share(count: int, total: int) -> str:
    low, high = wilson(count, total)
    return f"{100 * count / total:.0f} % ({count} of {total}; {100 * low:.0f} to {100 * high:.0f} %)"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
