"""A simulated calibration session: takes of one glove in several wearings, with causes hidden in it.

    hand -> mechanical causes -> sensor curve -> electrical causes -> wearing -> healthy remainder
         -> causes in counts -> noise -> converter -> transport -> readings;    hand -> clock -> reference

It is a simulation: every take says so. The clean twin has the same seeds and the same noise and no cause.

A cause at work in one glove: its form, its sensors and its sizes, set to the strength asked for.

Strength is the part of a disturbance that calibration cannot take away without knowing the cause.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.causes.catalogue import forms
from glovecal_models.simulation.causes.form import Cause, Draws, Form, HiddenCause, Stage
from glovecal_models.simulation.scene import Scene, play_scene
from glovecal_models.simulation.session_glove import SessionGlove
from glovecal_models.simulation.session_plan import SessionPlan, TakeMotion, TakeStart, one_more, schedule
from glovecal_models.simulation.signals import at_times
from glovecal_models.simulation.simulated_glove import NOT_MEASURED
from glovecal_models.takes.take import Take

STRENGTH_LOG_SD = 0.35
"""Sensors of one glove differ in how much a cause moves them."""
SIZE_ROUNDS = 16
LEAST_REACHED_DEG = 1e-4
"""A form of size 1 that moves a sensor less than this is not seen on this motion, and is left out."""
PALM_NEIGHBOURS = ("P_MCP", "R_MCP", "T_TMC", "TI_ABD", "RP_ABD")
OWN_CLOCK_HZ = 100.0


@dataclass(frozen=True)
class Hidden:
    """A cause with its sizes."""

    form: Form
    draws: Draws
    affected: np.ndarray
    """Shape (S,), which sensors."""
    size: np.ndarray
    """Shape (S,)."""
    record: HiddenCause

    def apply(self, signal: np.ndarray, scene: Scene) -> np.ndarray:
        """The signal with the cause, shape (T, N, S); a clock's takes any number of channels."""
        changed = self.form.effect(signal, scene, self.size, self.draws)
        return changed if self.form.shared else np.where(self.affected, changed, signal)

    def column(self, scene: Scene) -> tuple[str, np.ndarray]:
        """The context column that records the cause: name and values (T, N)."""
        assert self.form.column is not None
        return self.form.column(scene, self.draws)


FormsOf = Callable[[str], tuple[Form, ...]]
"""The forms of a cause by its name."""


def hide(cause: Cause, place: int, glove: SessionGlove, scene: Scene, forms_of: FormsOf) -> Hidden:
    """Choose form, sensors and sizes. ``place`` tells equal causes of one session apart."""
    label = f"{cause.name}/{place}"
    random = np.random.default_rng([glove.plan.seed, 52, zlib.crc32(label.encode())])
    form = _form(cause, forms_of(cause.name), random)
    affected = _affected(cause, form, glove.plan.sensors, random)
    if form.shared:
        affected[:] = True
    draws = Draws(glove.plan.seed, f"{label}/{form.name}", len(affected))
    spread = np.where(form.shared, 1.0, np.exp(STRENGTH_LOG_SD * random.standard_normal(len(affected))))
    spread /= np.sqrt(np.mean(spread[affected] ** 2))
    measure = _Measure(form, draws, affected, glove, scene)
    targets = cause.strength_deg * spread[affected]
    if form.sizes is not None:
        size = sizes_for(measure, targets, form.sizes, shared=form.shared)
    else:
        size = np.ones(len(targets))
        for _ in range(2):  # the sensors' curves bend, so that proportion is only nearly right
            reached = measure(size)
            if form.shared:
                reached = np.sqrt(np.mean(reached**2))
            size = np.where(reached > LEAST_REACHED_DEG, size * targets / np.maximum(reached, 1e-12), 0.0)
    reached = measure(size)
    everywhere = np.full(len(affected), size[0])  # of no other sensor is anything kept, but a size is no zero
    everywhere[affected] = size
    channels = tuple(np.array(glove.plan.sensors)[affected].tolist())
    record = HiddenCause(
        name=cause.name,
        form=form.name,
        description=form.description,
        stage=form.stage.name.lower(),
        channels=channels,
        strength_deg=cause.strength_deg,
        reached_deg=dict(zip(channels, map(float, reached), strict=True)),
        sizes=dict(zip(channels, map(float, size), strict=True)),
        parameters=dict(draws.values),
        column=form.column(scene, draws)[0] if form.column else None,
    )
    return Hidden(form, draws, affected, everywhere, record)


class _Measure:
    """The strength of a form by itself on the healthy glove, as a function of its sizes."""

    def __init__(
        self, form: Form, draws: Draws, affected: np.ndarray, glove: SessionGlove, scene: Scene
    ) -> None:
        self._form, self._draws, self._affected = form, draws, affected
        self._glove, self._scene = glove, scene
        strain = glove.strain(scene)
        self._before = {Stage.MECHANICAL: strain, Stage.CLOCK: scene.own}.get(form.stage)
        if self._before is None:
            self._before = glove.curve(strain)
        self._clean = self._output(self._before)
        self._own = scene.own[:, scene.recorded][:, :, affected].reshape(-1, int(affected.sum()))
        terms = {"straight_line": {"terms": 2}}.get(form.judged_by, {})
        self._unexplained = Unexplained(self._own, **terms)

    def __call__(self, size: np.ndarray) -> np.ndarray:
        everywhere = np.full(len(self._affected), size[0])
        everywhere[self._affected] = size
        assert self._before is not None
        changed = self._output(self._form.effect(self._before, self._scene, everywhere, self._draws))
        if self._form.judged_by == "lost_angle":
            return lost_angle_rms(self._own, self._clean, changed)
        return self._unexplained.rms(changed - self._clean)

    def _output(self, signal: np.ndarray) -> np.ndarray:
        signal = signal[:, self._scene.recorded]
        if self._form.stage is Stage.MECHANICAL:
            signal = self._glove.curve(signal)
        return signal[:, :, self._affected].reshape(-1, int(self._affected.sum()))


def _form(cause: Cause, known: tuple[Form, ...], random: np.random.Generator) -> Form:
    if cause.form is None:
        drawn = [form for form in known if not form.set_aside and not form.only_by_name] or list(known)
        return drawn[int(random.integers(len(drawn)))]
    for form in known:
        if form.name == cause.form:
            return form
    meant = did_you_mean(cause.form, (form.name for form in known), there="it has")
    raise BadInput(f"{cause.name} has no form {cause.form!r}; {meant}")


def _affected(cause: Cause, form: Form, sensors: tuple[str, ...], random: np.random.Generator) -> np.ndarray:
    order = random.permutation(len(sensors))
    affected = np.zeros(len(sensors), bool)
    if cause.channels is not None:
        missing = set(cause.channels) - set(sensors)
        if missing or not cause.channels:
            raise BadInput(f"{cause.name}: no sensors {sorted(missing)} in this session")
        affected[[sensors.index(name) for name in cause.channels]] = True
        return affected
    palm = [place for place, name in enumerate(sensors) if name in PALM_NEIGHBOURS]
    count = {"two": 2, "one": 1, "one_or_all": 1 if random.random() < 0.5 else len(sensors)}
    if form.touches == "palm" and palm:
        affected[palm] = True
    elif form.touches == "palm":
        affected[-1] = True
    else:
        affected[order[: count.get(form.touches, len(sensors))]] = True
    return affected


OWN_MAP_TERMS = 8
"""Legendre terms that stand for any smooth static map of the own angle."""
READING_SD_DEG = 0.3
READING_STEP_DEG = 0.25


class Unexplained:
    """RMS of what is left of a disturbance after the best smooth function of the own angle.

    ``own`` are all frames of a session, shape (M, S) degrees; ``terms`` 2 stands for straight lines.
    """

    def __init__(self, own: np.ndarray, terms: int = OWN_MAP_TERMS) -> None:
        self._bases = [_orthonormal_basis(column, terms) for column in own.T]

    def rms(self, disturbance: np.ndarray) -> np.ndarray:
        """Shape (S,), degrees, from ``disturbance`` of shape (M, S), degrees."""
        left = [
            column - basis @ (basis.T @ column)
            for basis, column in zip(self._bases, disturbance.T, strict=True)
        ]
        return np.sqrt(np.mean(np.square(left), axis=1))


def lost_angle_rms(own: np.ndarray, clean: np.ndarray, changed: np.ndarray) -> np.ndarray:
    """How much less a noisy reading says about the angle, shape (S,), degrees RMS.

    ``own``, ``clean`` and ``changed`` have shape (M, S), degrees, without noise. A noise of
    ``READING_SD_DEG`` is added, without which a nearly flat curve would lose nothing.
    """
    noise = READING_SD_DEG * np.random.default_rng(0).standard_normal(len(own))
    trios = zip(own.T, clean.T, changed.T, strict=True)
    lost = [
        _spread_within(a, after + noise) - _spread_within(a, before + noise) for a, before, after in trios
    ]
    return np.sqrt(np.maximum(lost, 0.0))


def sizes_for(
    measure: Callable[[np.ndarray], np.ndarray],
    targets: np.ndarray,
    bounds: tuple[float, float],
    *,
    shared: bool,
) -> np.ndarray:
    """Sizes, shape (S,), at which ``measure`` (growing in each sensor's own size) gives ``targets`` (S,).

    ``shared`` asks for one size whose RMS over sensors is that of the targets. Bounds that are too narrow
    give the nearest bound.
    """
    low, high = (np.full(len(targets), bound) for bound in bounds)
    size = np.sqrt(low * high)
    for _ in range(SIZE_ROUNDS):
        reached = measure(size)
        wanted = targets
        if shared:
            reached = np.full(len(targets), np.sqrt(np.mean(reached**2)))
            wanted = np.full(len(targets), np.sqrt(np.mean(targets**2)))
        if np.all(np.abs(reached / wanted - 1) < 0.01):
            break
        low = np.where(reached < wanted, size, low)
        high = np.where(reached < wanted, high, size)
        guess = size * np.clip(wanted / np.maximum(reached, 1e-9), 0.2, 5.0)
        inside = (guess > low) & (guess < high)
        settled = np.abs(reached / wanted - 1) < 0.01
        size = np.where(settled, size, np.where(inside, guess, np.sqrt(low * high)))
    return size


def _orthonormal_basis(angle: np.ndarray, terms: int) -> np.ndarray:
    low, high = angle.min(), angle.max()
    if high - low < 1e-6:
        return np.full((len(angle), 1), 1 / np.sqrt(len(angle)))
    columns = np.polynomial.legendre.legvander(2 * (angle - low) / (high - low) - 1, terms - 1)
    return np.linalg.qr(columns)[0]


def _spread_within(angle: np.ndarray, reading: np.ndarray) -> float:
    group = np.rint((reading - reading.min()) / READING_STEP_DEG).astype(int)
    count = np.maximum(np.bincount(group), 1)
    mean = np.bincount(group, angle) / count
    return float(np.mean((angle - mean[group]) ** 2))


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
