"""``python3 do.py study new-person``: error against seconds of own data, other people's takes as a prior.

Real recordings: an ankle sleeve of four sensors, five people, three placements each, four slow motions of 5
to 10 s in each placement. They are no part of the project: without them there is nothing to ask.
Every person is left out whole, and every take of theirs is held out in turn: it is a motion that the
placement's other takes do not have. What is given of those others is nothing, a quarter of a second in the
middle of each, their first 10 s, or all of them (15 to 28 s, called 30 s); ``all`` has the other two
placements too. Blocks ask within the motions instead: the third quarter of each of the placement's takes is
held out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import new_person_hands
import numpy as np

from glovecal_models.calibration.people_prior import PeoplePrior, people_prior
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.quick_check.held_poses import HeldPose
from glovecal_models.quick_check.quick_check import quick_check
from glovecal_models.regression.linear_regressor import LinearRegressor, fit_linear
from glovecal_models.takes.clock_scan import aligned, clock_offsets
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.worker_processes import pin_blas_to_one_thread

mpl.use("Agg")
import matplotlib.pyplot as plt

ANKLE = Path(__file__).resolve().parents[3] / "shared" / "data" / "ankle"
PEOPLE = tuple(f"P{number}" for number in range(300, 305))
TUNED_ON = PEOPLE[:3]
"""Whoever chose the method's constants looked at these alone."""
POSE_FRAMES, FIRST_S = 8, 10.0
BLOCK = (0.5, 0.75)
"""Of a take's time, where blocks are held out."""
AMOUNTS = ("prior alone", "3 poses", "10 s", "30 s", "all")
HOWS = ("without", "new person", "known person")
"""Known: the person's other placements are part of the prior."""
NOT_ASKED = {("without", "prior alone"), ("known person", "all")}
HALF_95 = 1.959964
COLOURS = {"without": "#888888", "new person": "#1d6cab", "known person": "#d9822b"}


@dataclass(frozen=True)
class Frames:
    """Measured frames of one take."""

    name: str
    wearing: str
    time_s: np.ndarray
    readings: np.ndarray
    """(N, S)."""
    angles: np.ndarray
    """(N, R), degrees."""

    def some(self, rows: slice | np.ndarray) -> Frames:
        return replace(self, time_s=self.time_s[rows], readings=self.readings[rows], angles=self.angles[rows])

    @property
    def block(self) -> np.ndarray:
        """(N,): true in the part that is held out."""
        share = (self.time_s - self.time_s[0]) / np.ptp(self.time_s)
        return (share >= BLOCK[0]) & (share < BLOCK[1])


@dataclass(frozen=True)
class Errors:
    """Of held-out frames: degrees, and whether the 95 % interval holds the measured angle; both (N, R)."""

    degrees: np.ndarray
    inside: np.ndarray


Found = Mapping[tuple[str, str], Mapping[str, Sequence[Errors]]]
"""By how and amount, then by person."""


def read_people(folder: Path = ANKLE, people: Sequence[str] = PEOPLE) -> dict[str, list[Take]]:
    """The takes of each person on one clock; a placement is a wearing."""
    takes_by_person = {}
    for person in people:
        takes = [take for path in sorted(folder.glob(f"{person}-*.frames.csv")) for take in read_takes(path)]
        offsets = clock_offsets(takes)
        takes = [aligned(take, item.offset_s) for take, item in zip(takes, offsets, strict=True)]
        takes_by_person[person] = [replace(take, wearing=take.name.rpartition("-")[0]) for take in takes]
    return takes_by_person


def layout_of(people: Mapping[str, Sequence[Take]]) -> Layout:
    first = next(iter(people.values()))[0]
    return Layout.from_columns("ankle", first.sensors, first.rotations)


def frames_of(take: Take) -> Frames:
    angles = take.reference_at_frames(take.rotations)
    known = np.isfinite(angles).all(axis=1)
    return Frames(take.name, take.wearing, take.time_s[known], take.readings[known], angles[known])


def amount_of(amount: str, takes: Sequence[Frames]) -> list[Frames]:
    """The part of a placement's other ``takes`` that is given."""
    if amount == "prior alone":
        return []
    if amount == "3 poses":
        middles = [len(take.time_s) // 2 for take in takes]
        return [take.some(slice(at, at + POSE_FRAMES)) for take, at in zip(takes, middles, strict=True)]
    parts, left = [], FIRST_S if amount == "10 s" else np.inf
    for take in takes:
        part = take.some(take.time_s - take.time_s[0] < left)
        left -= float(np.ptp(take.time_s))
        if len(part.time_s) >= POSE_FRAMES:
            parts.append(part)
    return parts


def planes(
    prior: PeoplePrior | None, takes: Sequence[Frames], rotations: int, wearing: str
) -> list[LinearRegressor]:
    """Of each rotation in ``wearing``; without a prior by training alone. Raises NotTrainable."""
    if prior is None:
        readings = np.concatenate([take.readings for take in takes])
        angles = np.concatenate([take.angles for take in takes])
        return [fit_linear(readings, angles[:, at]) for at in range(rotations)]
    regressors = []
    for at, plane in enumerate(prior.planes):
        own: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        for take in takes:
            own.setdefault(take.wearing, []).append((take.readings, take.angles[:, at]))
        regressors.append(plane.regressor(own, wearing))
    return regressors


def errors_of(regressors: Sequence[LinearRegressor], take: Frames) -> Errors:
    degrees, inside = [], []
    for regressor, angle in zip(regressors, take.angles.T, strict=True):
        predicted = regressor.predict(take.readings)
        degrees.append(predicted.mean - angle)
        inside.append(np.abs(degrees[-1]) < HALF_95 * np.sqrt(predicted.variance + regressor.noise_variance))
    return Errors(np.array(degrees).T, np.array(inside).T)


def asked(people: Mapping[str, Sequence[Take]], whom: Sequence[str]) -> tuple[Found, Found]:
    """Errors on held-out takes, and on held-out blocks of takes, of each of ``whom``, by the others."""
    layout = layout_of(people)
    takes: dict[tuple[str, str], dict[str, list[Errors]]] = {}
    blocks: dict[tuple[str, str], dict[str, list[Errors]]] = {}
    for person in whom:
        prior = people_prior({name: own for name, own in people.items() if name != person}, layout)
        frames, count = [frames_of(take) for take in people[person]], len(layout.rotations)
        for wearing in dict.fromkeys(item.wearing for item in frames):
            own = [item for item in frames if item.wearing == wearing]
            elsewhere = [item for item in people[person] if item.wearing != wearing]
            priors = {"without": None, "new person": prior, "known person": prior.of_person(elsewhere)}
            outside = [frames_of(take) for take in elsewhere]
            for how, given in priors.items():
                for left in own:
                    rest = [item for item in own if item is not left]
                    for amount in AMOUNTS:
                        if (how, amount) in NOT_ASKED:
                            continue
                        part = [*rest, *outside] if amount == "all" else amount_of(amount, rest)
                        errors = errors_of(planes(given, part, count, wearing), left)
                        takes.setdefault((how, amount), {}).setdefault(person, []).append(errors)
                part = [item.some(~item.block) for item in own]
                fitted = planes(given, part, count, wearing)
                for item in own:
                    errors = errors_of(fitted, item.some(item.block))
                    blocks.setdefault((how, "30 s"), {}).setdefault(person, []).append(errors)
    return takes, blocks


def checked(people: Mapping[str, Sequence[Take]], whom: Sequence[str]) -> Mapping[str, Sequence[Errors]]:
    """A quick check by the same three poses: a linear model of the person's other placements with
    ``donning_shift``."""
    layout, settings = layout_of(people), TrainingSettings(method="linear", folds=2)
    errors: dict[str, list[Errors]] = {}
    for person in whom:
        for wearing in dict.fromkeys(take.wearing for take in people[person]):
            own = [take for take in people[person] if take.wearing == wearing]
            elsewhere = [take for take in people[person] if take.wearing != wearing]
            plain = train(elsewhere, layout, person, settings)
            model = add_effect(plain, elsewhere, "donning_shift", settings=settings, least_gain=-9).model
            for left in own:
                poses = [pose_of(take) for take in own if take is not left]
                try:
                    after = quick_check(model, [pose.take for pose in poses], poses=poses).model
                except BadInput:
                    after = model  # poses that contradict the model are refused: it stays as it was
                predictor = GlovePredictor(after)
                angles = predictor.predict_take(left.time_s, left.readings, left.context, wearing)
                reference = left.reference_at_frames(predictor.rotations)
                known = np.isfinite(reference).all(axis=1)
                error = (angles.mean - reference)[known]
                errors.setdefault(person, []).append(
                    Errors(error, np.abs(error) < HALF_95 * angles.sd[known])
                )
    return errors


def pose_of(take: Take) -> HeldPose:
    """The same frames as ``amount_of`` gives."""
    known = np.flatnonzero(np.isfinite(take.reference_at_frames(take.rotations)).all(axis=1))
    return HeldPose(take, known[len(known) // 2 :][:POSE_FRAMES])


def rmse(errors: Mapping[str, Sequence[Errors]]) -> float:
    """Over people, each of whom counts alike, degrees."""
    each = [np.mean(np.concatenate([item.degrees for item in own]) ** 2) for own in errors.values()]
    return float(np.sqrt(np.mean(each)))


def coverage(errors: Mapping[str, Sequence[Errors]]) -> float:
    each = [np.mean(np.concatenate([item.inside for item in own])) for own in errors.values()]
    return float(np.mean(each))


def table(errors: Found, amounts: Sequence[str] = AMOUNTS) -> str:
    """Degrees, and in percent how much of what is held out its 95 % intervals hold."""
    heads = {
        "without": "own data alone",
        "new person": "with other people",
        "known person": "and own wearings",
    }
    lines = ["| own data | " + " | ".join(heads.values()) + " |", "|---" * 4 + "|"]
    for amount in amounts:
        cells = []
        for how in HOWS:
            own = errors.get((how, amount))
            cells.append("" if own is None else f"{rmse(own):.1f} ({100 * coverage(own):.0f} %)")
        lines.append(f"| {amount} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(errors: Found, file: Path) -> None:
    figure, axes = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
    labels = {
        "without": "own data alone",
        "new person": "new person, other people as prior",
        "known person": "known person, next wearing",
    }
    for how in HOWS:
        at = [place for place, amount in enumerate(AMOUNTS) if (how, amount) in errors]
        heights = [rmse(errors[how, AMOUNTS[place]]) for place in at]
        axes.plot(at, heights, "o-", color=COLOURS[how], label=labels[how])
    axes.set_xticks(range(len(AMOUNTS)), AMOUNTS)
    axes.set(ylim=(0, 30), ylabel="held-out error, degrees", xlabel="data of the person's own wearing")
    axes.grid(axis="y", alpha=0.3)
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def page_of(
    title: str, whom: Sequence[str], takes: Found, blocks: Found, check: Mapping[str, Sequence[Errors]]
) -> str:
    takes, blocks = (
        {key: {person: own[person] for person in whom} for key, own in errors.items()}
        for errors in (takes, blocks)
    )
    check = {person: check[person] for person in whom}
    each = ", ".join(
        f"{person} {rmse({person: takes['new person', '30 s'][person]}):.1f}"
        f" ({rmse({person: takes['without', '30 s'][person]}):.1f} alone)"
        for person in whom
    )
    return (
        f"{title}, error on held-out takes in degrees, and how many of them the 95 % interval holds:\n\n"
        f"{table(takes)}\n\nBy person, 30 s: {each}.\n\nA quick check of a known person by the same three "
        f"poses: {rmse(check):.1f} ({100 * coverage(check):.0f} %).\n\nWithin the motions shown:\n\n"
        f"{table(blocks, ['30 s'])}\n"
    )


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study new-person", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for the table and the picture")
    parser.add_argument("--picture", type=Path, help="draw it here instead")
    parser.add_argument("--smoke", action="store_true", help="one person by two others, without files")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if not ANKLE.is_dir():
        print(f"There are no recordings in {ANKLE}; without them there is nothing to ask.")
        return 0
    people = read_people(people=TUNED_ON if options.smoke else PEOPLE)
    if options.smoke:
        print(table(asked(people, TUNED_ON[:1])[0]))
        return 0
    takes, blocks = asked(people, PEOPLE)
    check = checked(people, PEOPLE)
    options.folder.mkdir(exist_ok=True)
    draw(takes, options.picture or options.folder / "new-person.png")
    text = "\n".join(
        page_of(title, whom, takes, blocks, check)
        for title, whom in (
            ("All five", PEOPLE),
            ("Looked at while it was made", TUNED_ON),
            ("Kept apart", PEOPLE[len(TUNED_ON) :]),
        )
    )
    hands = new_person_hands.table(new_person_hands.asked())
    text = f"{text}\nSimulated hands, in the second of two wearings:\n\n{hands}\n"
    print(text)
    (options.folder / "new-person.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
