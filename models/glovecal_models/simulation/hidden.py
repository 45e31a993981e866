"""A cause at work in one glove: its form, its sensors and its sizes, set to the strength asked for.

Strength is the part of a disturbance that calibration cannot take away without knowing the cause.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.causes.form import Cause, Draws, Form, HiddenCause, Stage
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.session_glove import SessionGlove

STRENGTH_LOG_SD = 0.35
"""Sensors of one glove differ in how much a cause moves them."""
SIZE_ROUNDS = 16
LEAST_REACHED_DEG = 1e-4
"""A form of size 1 that moves a sensor less than this is not seen on this motion, and is left out."""
PALM_NEIGHBOURS = ("P_MCP", "R_MCP", "T_TMC", "TI_ABD", "RP_ABD")


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
