"""A simulated calibration session: takes of one glove in several wearings, with causes hidden in it.

    hand -> mechanical causes -> sensor curve -> electrical causes -> wearing -> healthy remainder
         -> causes in counts -> noise -> converter -> transport -> readings;    hand -> clock -> reference

It is a simulation: every take says so. The clean twin has the same seeds and the same noise and no cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.simulation.causes.catalogue import forms
from glovecal_models.simulation.causes.form import Cause, HiddenCause, Stage
from glovecal_models.simulation.hidden import FormsOf, Hidden, hide
from glovecal_models.simulation.scene import Scene, play_scene
from glovecal_models.simulation.session_glove import SessionGlove
from glovecal_models.simulation.session_plan import SessionPlan, TakeMotion
from glovecal_models.simulation.session_schedule import TakeStart, one_more, schedule
from glovecal_models.simulation.signals import at_times
from glovecal_models.simulation.simulated_take import NOT_MEASURED
from glovecal_models.takes.take import Take

OWN_CLOCK_HZ = 100.0


@dataclass(frozen=True)
class RecordedTake:
    """One take, its twin without causes, and what the hand really did at its frames."""

    take: Take
    clean: Take
    truth: np.ndarray
    """Shape (N, R), degrees, in the order of the plan's rotations."""


@dataclass(frozen=True)
class RecordedSession:
    """All takes of a plan. Tuples are in the order of recording."""

    plan: SessionPlan
    takes: tuple[Take, ...]
    clean: tuple[Take, ...]
    truth: tuple[np.ndarray, ...]
    """Shape (N, R) each, degrees, at the frames' times, in the order of the plan's rotations."""
    causes: tuple[HiddenCause, ...]
    floor_deg: Mapping[str, float]
    """What a perfect static calibration of the healthy glove leaves: RMS degrees per rotation that has
    a sensor."""
    _hidden: tuple[Hidden, ...] = field(repr=False)

    def also(self, motion: TakeMotion, take_s: float, wearing: int, *, repeat: int = 0) -> RecordedTake:
        """One more take after the session, of the same glove with the same causes.

        ``wearing`` counts from 0; one above the plan's is a new wearing. The same arguments give the same
        take; another ``repeat`` gives another. Raises BadInput.
        """
        [start] = one_more(self.plan, motion, take_s, wearing, repeat)
        return self.at(start)

    def at(self, start: TakeStart) -> RecordedTake:
        """One more take after the session, in circumstances of its own: battery, power, time."""
        return _record(self.plan, SessionGlove(self.plan), (start,), self._hidden)[0]


def record_session(
    plan: SessionPlan, causes: Sequence[Cause] = (), *, forms_of: FormsOf = forms
) -> RecordedSession:
    """Record all takes of ``plan`` with ``causes`` acting together, each in its place in the chain.

    Sizes are set so that each cause by itself has its strength on the plan's own takes. ``forms_of`` may know
    more forms than the catalogue. Raises BadInput for a name, form or sensor that does not exist.
    """
    glove = SessionGlove(plan)
    starts = schedule(plan)
    scene = play_scene(plan, starts, glove.zero / glove.gain)
    hidden = tuple(hide(cause, place, glove, scene, forms_of) for place, cause in enumerate(causes))
    recorded = _record_scene(plan, glove, scene, hidden)
    return RecordedSession(
        plan=plan,
        takes=tuple(item.take for item in recorded),
        clean=tuple(item.clean for item in recorded),
        truth=tuple(item.truth for item in recorded),
        causes=tuple(item.record for item in hidden),
        floor_deg=glove.floor_deg(scene),
        _hidden=hidden,
    )


def _record(
    plan: SessionPlan, glove: SessionGlove, starts: Sequence[TakeStart], hidden: Sequence[Hidden]
) -> list[RecordedTake]:
    return _record_scene(plan, glove, play_scene(plan, starts, glove.zero / glove.gain), hidden)


def _record_scene(
    plan: SessionPlan, glove: SessionGlove, scene: Scene, hidden: Sequence[Hidden]
) -> list[RecordedTake]:
    jitter = _jitter(plan, scene)
    remainder = glove.nuisance(scene)
    remainder_and_noise = remainder, _on_grid(scene, glove.noise(scene))
    readings = _readings(glove, scene, hidden, remainder_and_noise, jitter)
    clean = _readings(glove, scene, (), remainder_and_noise, jitter) if hidden else readings
    shown = scene.angles
    for item in hidden:
        if item.form.stage is Stage.CLOCK:
            shown = item.apply(shown, scene)
    columns = dict(item.column(scene) for item in hidden if item.form.column)
    takes = []
    for number in range(len(scene.starts)):
        time = scene.time_s[scene.recorded] + jitter[number]
        truth = _sampled(scene, scene.angles[number], time, plan.frame_jitter_s > 0)
        context = _context(plan, scene, number, columns)
        pair = [
            _take(plan, glove, scene, number, time, counts[number], angles[number], context)
            for counts, angles in ((readings, shown), (clean, scene.angles))
        ]
        takes.append(RecordedTake(pair[0], pair[1], truth))
    return takes


def _readings(
    glove: SessionGlove,
    scene: Scene,
    hidden: Sequence[Hidden],
    remainder_and_noise: tuple[np.ndarray, np.ndarray],
    jitter: np.ndarray,
) -> np.ndarray:
    """Counts at the recorded frames, shape (T, frames, S)."""

    def through(stage: Stage, signal: np.ndarray) -> np.ndarray:
        for item in hidden:
            if item.form.stage is stage:
                signal = item.apply(signal, scene)
        return signal

    remainder, noise = remainder_and_noise
    signal = glove.curve(through(Stage.MECHANICAL, glove.strain(scene)))
    signal = through(Stage.WEARING, through(Stage.ELECTRICAL, signal)) + remainder
    signal = through(Stage.COUNTS, signal)
    if jitter.any():
        signal = signal.copy()
        for number, off in enumerate(jitter):
            at = scene.time_s[scene.recorded] + off
            signal[number, scene.recorded] = at_times(scene.time_s, signal[number], at)
    counts = glove.counts(through(Stage.CONVERTER, signal + noise))
    return through(Stage.TRANSPORT, counts)[:, scene.recorded]


def _take(
    plan: SessionPlan,
    glove: SessionGlove,
    scene: Scene,
    number: int,
    time: np.ndarray,
    counts: np.ndarray,
    angles: np.ndarray,
    context: Mapping[str, np.ndarray],
) -> Take:
    start = scene.starts[number]
    measured = [place for place, name in enumerate(plan.rotations) if name not in NOT_MEASURED]
    if plan.reference_clock == "own":
        random = np.random.default_rng([plan.seed, 48, start.key])
        rate = OWN_CLOCK_HZ
        at = np.arange(random.uniform(0.0, 1 / rate), start.take_s, 1 / rate)
        reference = at_times(scene.time_s, angles, at)
    else:
        rate, at = plan.rate_hz, time
        reference = _sampled(scene, angles, time, plan.frame_jitter_s > 0)
    reference = reference + glove.reference_noise(start.key, len(at), rate)
    poses = scene.poses[number]
    return Take(
        name=start.name,
        wearing=start.wearing_name,
        sensors=plan.sensors,
        time_s=time,
        readings=counts,
        rotations=tuple(plan.rotations[place] for place in measured),
        reference_time_s=at,
        reference=reference[:, measured],
        context=context,
        poses=poses if any(poses) else None,
        simulated=True,
    )


def _context(
    plan: SessionPlan, scene: Scene, number: int, columns: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """What sensors beside the glove's tell, with their own little noise."""
    random = np.random.default_rng([plan.seed, 49, scene.starts[number].key])
    rows = scene.recorded
    count = rows.stop - rows.start
    return {
        "power_on_s": scene.power_on_s[number, rows],
        "supply_v": np.round(scene.supply_v[number, rows] + 0.002 * random.standard_normal(count), 4),
        "temperature_c": np.round(
            scene.temperature_c[number, rows] + 0.03 * random.standard_normal(count), 3
        ),
        "humidity_pct": np.round(scene.humidity_pct[number, rows] + 0.1 * random.standard_normal(count), 2),
        **{name: values[number, rows] for name, values in columns.items()},
    }


def _sampled(scene: Scene, values: np.ndarray, time: np.ndarray, between_frames: bool) -> np.ndarray:
    return at_times(scene.time_s, values, time) if between_frames else values[scene.recorded].copy()


def _jitter(plan: SessionPlan, scene: Scene) -> np.ndarray:
    """How far each frame is from the even beat, shape (T, frames), seconds; frames keep their order."""
    count = scene.recorded.stop - scene.recorded.start
    if not plan.frame_jitter_s:
        return np.zeros((len(scene.starts), count))
    draws = [np.random.default_rng([plan.seed, 51, start.key]) for start in scene.starts]
    off = plan.frame_jitter_s * np.stack([random.standard_normal(count) for random in draws])
    most = 0.45 / plan.rate_hz
    return np.clip(off, -most, most)


def _on_grid(scene: Scene, frames: np.ndarray) -> np.ndarray:
    grid = np.zeros((len(frames), len(scene.time_s), frames.shape[2]))
    grid[:, scene.recorded] = frames
    return grid
