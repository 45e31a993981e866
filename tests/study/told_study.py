"""``python3 do.py study told``: what other verbs and pages tell of healthy gloves, beside the diagnosis.

Healthy gloves with few short takes, of every rate and motion: the doctor on 5 s of frames, the live watch
while takes are streamed, the clocks that a take's page examines, what training says of sensors, and what a
take's page says of its readings. All of it is false here, but for what only asks the wearer to move.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from unittest.mock import patch

import numpy as np
from blind_glove import BlindGlove
from glove_choices import few_takes
from intervals import clopper_pearson

from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.text import dead_sensor_sentences
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.worn_glove import GloveFinding, worn_glove_findings
from glovecal_models.errors import BadInput
from glovecal_models.takes.clock_scan import clock_offsets
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import take_warnings
from glovecal_models.worker_processes import pin_blas_to_one_thread, work_off
from glovecal_service.realtime import glove_lanes
from glovecal_service.realtime.glove_lanes import LiveWatch
from glovecal_service.realtime.served_model import ServedModel

FIRST = 3500
"""Gloves of smaller numbers were asked while limits were chosen, or after (docs/study-tried.md)."""
LISTENED_S = 5.0
"""As long as ``glovecal doctor`` listens."""
ASKED_S = 20.0
LOOK_NS = 1_000_000_000
"""The status is asked for once a second."""
NOT_A_FAULT = ("motion",)
"""Parts of a finding that only ask the wearer to move."""
HEAD = "| told by | gloves | with a false word | 95 % interval | most often |\n" + "|---" * 5 + "|"


@dataclass(frozen=True)
class Told:
    """What was told of one healthy glove, by verb or page."""

    number: int
    motion: str
    rate_hz: float
    said: Mapping[str, tuple[tuple[str, str], ...]]
    """For each its sentences with the part that each is about; none: nothing. Missing: not asked."""


def told(number: int, method: Method) -> Told:
    """A model learns from the first wearing; the second is worn while it is asked."""
    glove = few_takes(number)
    learned = [take for take in glove.takes if take.wearing == glove.takes[0].wearing]
    worn = [take for take in glove.takes if take.wearing != glove.takes[0].wearing]
    asked = glove.also("natural", ASKED_S, glove.wearings - 1)
    answers = {
        "take check, takes page": _about("take", take_warnings(list(glove.takes))),
        "clocks, a take's page": _about("clock", _clocks(glove)),
        "doctor, no model": _doctor([*worn, asked], glove, None),
    }
    try:
        settings = TrainingSettings(method=method, folds=0, samples=200)
        plan = plan_training(learned, glove.layout, "anna", settings)
        answers["train"] = _about("sensor", dead_sensor_sentences(plan.usable, plan.unreadable))
        model = train(learned, glove.layout, "anna", settings)
    except BadInput:
        return Told(number, glove.motion, glove.rate_hz, answers)
    answers |= {
        "doctor, motion as learned": _doctor(worn, glove, model),
        "doctor, whole hand": _doctor([asked], glove, model),
        "live watch, motion as learned": _watched(worn, model),
        "live watch, whole hand": _watched([asked], model),
    }
    return Told(number, glove.motion, glove.rate_hz, answers)


def _about(part: str, sentences: Sequence[str]) -> tuple[tuple[str, str], ...]:
    return tuple((part, sentence) for sentence in sentences)


def _clocks(glove: BlindGlove) -> list[str]:
    return [item.sentence for item in clock_offsets(glove.takes) if item.verdict == "offset"]


def _findings(found: Sequence[GloveFinding]) -> Iterator[tuple[str, str]]:
    yield from ((item.part, item.sentence) for item in found if item.part not in NOT_A_FAULT)


def _doctor(
    takes: Sequence[Take], glove: BlindGlove, model: CalibrationModel | None
) -> tuple[tuple[str, str], ...]:
    """Of every ``LISTENED_S`` of the takes."""
    return tuple(
        each
        for take in takes
        for part in _parts(take)
        for each in _findings(worn_glove_findings(part, glove.rate_hz, model))
    )


def _parts(take: Take) -> Iterator[Take]:
    count = int(round(float(np.ptp(take.time_s))) // LISTENED_S)
    for number in range(count):
        begin = take.time_s[0] + number * LISTENED_S
        inside = (take.time_s >= begin) & (take.time_s < begin + LISTENED_S)
        yield Take("now", take.wearing, take.sensors, take.time_s[inside], take.readings[inside])


def _watched(takes: Sequence[Take], model: CalibrationModel) -> tuple[tuple[str, str], ...]:
    """Each take is a run whose status is asked for every second; a warning is counted once a run."""
    served, found = ServedModel.prepare("ab" * 32, model), list[tuple[str, str]]()
    for run, take in enumerate(takes):
        watch, look_ns, seen = LiveWatch(run, served, served.sensors), 0, dict[str, str]()
        degrees = served.predictor.predict(take.readings).mean
        with patch.object(glove_lanes, "LOOK_AGAIN_S", 0.0):
            for time_s, readings, angles in zip(take.time_s, take.readings, degrees, strict=True):
                time_ns = round(1e9 * (time_s - take.time_s[0]))
                watch.add(time_ns, readings, angles)
                if time_ns >= look_ns:
                    look_ns = time_ns + LOOK_NS
                    seen |= {item["sentence"]: item["part"] for item in watch.warnings()}
        found += [(part, sentence) for sentence, part in seen.items() if part not in NOT_A_FAULT]
    return tuple(found)


def rows(found: Sequence[Told]) -> list[str]:
    """Counts of gloves with exact intervals, and which part is blamed most often."""
    lines = []
    for verb in dict.fromkeys(verb for each in found for verb in each.said):
        asked = [each.said[verb] for each in found if verb in each.said]
        false = sum(bool(sentences) for sentences in asked)
        low, high = clopper_pearson(false, len(asked))
        parts = Counter(part for sentences in asked for part in {part for part, _ in sentences})
        most = ", ".join(f"{part} {count}" for part, count in parts.most_common(3))
        lines.append(f"| {verb} | {len(asked)} | {false} | {100 * low:.1f} to {100 * high:.1f} % | {most} |")
    return lines


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="do.py study told", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--gloves", type=int, default=300, metavar="N", help="healthy gloves (default 300)")
    parser.add_argument("--first", type=int, default=FIRST, metavar="N", help=f"number (default {FIRST})")
    parser.add_argument("--method", default="linear", help="of the model that is served (default linear)")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--smoke", action="store_true", help="one glove: seconds")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    count = 1 if options.smoke else options.gloves
    found: list[Told | None] = [None] * count

    def keep(number: int, each: Told) -> None:
        found[number] = each
        for verb, sentences in each.said.items():
            for part, sentence in sentences:
                about = f"{each.number} ({each.rate_hz:g} Hz, {each.motion})"
                print(f"{about}: {verb}: {part}: {sentence}", file=sys.stderr, flush=True)

    job, code = partial(told, method=options.method), 0
    try:
        work_off(job, iter(range(options.first, options.first + count)), options.workers, keep, "told")
    except KeyboardInterrupt:
        print("stopped; of the gloves that were asked:", file=sys.stderr)
        code = 130
    print(HEAD)
    print("\n".join(rows([each for each in found if each is not None])))
    return code


if __name__ == "__main__":
    import told_study  # by this name worker processes find its work

    sys.exit(told_study.main(sys.argv[1:]))
