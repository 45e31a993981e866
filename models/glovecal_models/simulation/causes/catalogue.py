"""All causes that can be hidden, by name, and the forms of each.

Causes outside every catalogue of effects are here too: honest answers to them are "something is left that I
do not know". They sit on one sensor or on all. Most have nothing recorded that could explain them; one
follows a context column of an unfamiliar name, in a curve that rises and falls.

Causes outside every catalogue that follow a recorded column of an unfamiliar name.
"""

from __future__ import annotations

from importlib import import_module

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise

PACKAGE = "glovecal_models.simulation.causes"
CONTEXT_COLUMNS = ("strap_tension", "tilt_g", "cuff_bend", "lining_state")


def _slow(random: np.random.Generator, times_s: np.ndarray, low_s: float, high_s: float) -> np.ndarray:
    """A smooth random course of standard deviation about 1."""
    periods = random.uniform(low_s, high_s, 5)
    phases = random.uniform(0, 2 * np.pi, 5)
    waves = np.sin(2 * np.pi * times_s[:, None] / periods + phases)
    return np.asarray(np.sqrt(0.4) * waves.sum(axis=1))


def strap_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """A strap's tension: drawn for each wearing, falling slowly, with a course of its own in each take."""
    values = []
    for start, since in zip(scene.starts, scene.since_donned_s, strict=True):
        level = draws.stream("strap_level", start.wearing).uniform(-0.6, 1.0)
        course = _slow(draws.stream("strap_course", start.key), scene.time_s, 8.0, 40.0)
        values.append(level - 0.4 * np.tanh(np.maximum(since, 0.0) / 600) + 0.6 * course)
    return "strap_tension", np.clip(np.stack(values), -2.0, 2.0)


def tilt_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Gravity along the hand: it turns to and fro about some way of holding it in each take."""
    values = []
    for start in scene.starts:
        held = draws.stream("tilt_held", start.key).uniform(-0.7, 0.7)
        turning = _slow(draws.stream("tilt_turning", start.key), scene.time_s, 2.0, 12.0)
        values.append(np.sin(held + 0.8 * turning))
    return "tilt_g", 1.5 * np.stack(values)


def lining_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The state of a lining: a level for each take, and a course within it."""
    values = []
    for start in scene.starts:
        level = draws.stream("lining_level", start.key).uniform(-0.9, 0.9)
        values.append(level + 0.5 * _slow(draws.stream("lining_course", start.key), scene.time_s, 15.0, 60.0))
    return "lining_state", np.clip(np.stack(values), -2.0, 2.0)


@form(
    Stage.WEARING,
    "From one level to another around one value of a recorded column (sigmoid; ours).",
    touches="one_or_all",
    column=strap_column,
    only_by_name=True,
)
def context_threshold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hyperbolic tangent of the strap's tension."""
    _, tension = strap_column(scene, draws)
    place = draws.each("place", -0.4, 0.6)
    width = draws.each("width", 0.25, 0.7)
    return signal + size * 1.5 * draws.signs() * np.tanh((tension[..., None] - place) / width)


@form(
    Stage.WEARING,
    "A recorded column times a bow over the own bend, nothing at both ends of the range (ours).",
    touches="one_or_all",
    column=tilt_column,
    only_by_name=True,
)
def context_times_bow(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The tilt of the hand lets the cloth hang down where the joint is half bent."""
    _, tilt = tilt_column(scene, draws)
    curved = draws.each("curved", -0.3, 0.3)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    hangs = tilt[..., None] + curved * tilt[..., None] ** 2
    return signal + size * 2 * draws.signs() * hangs * np.sin(np.pi * bend)


@form(
    Stage.WEARING,
    "An exponential rise over a recorded column that also stretches the reading (ours).",
    touches="one_or_all",
    column=lining_column,
    only_by_name=True,
)
def context_exponential(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Hardly anything on one side of the column and ever more on the other, more so when bent."""
    _, state = lining_column(scene, draws)
    steep = draws.each("steep", 0.6, 1.2) * draws.signs("steep_side")
    grows = draws.each("grows", 0.0, 0.8)
    bend = (signal - scene.low) / scene.span
    rise = np.expm1(steep * state[..., None])
    return signal + size * draws.signs() * rise * (1 + grows * (bend - 0.5))


RECORDED_CONTEXT = (context_threshold, context_times_bow, context_exponential)


def context_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The recorded column: name and values (T, N), about -2 to 2."""
    name = CONTEXT_COLUMNS[int(draws.stream("column").integers(len(CONTEXT_COLUMNS)))]
    values = _column_values(scene, draws)
    return name, np.round(values + 0.01 * draws.stream("column noise").standard_normal(values.shape), 4)


@form(Stage.WEARING, "Unrecorded slow waves common to all sensors (ours).", touches="all")
def slow_waves(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Slow waves with no clock or column to follow, the same for all sensors."""
    weight = draws.each("weight", 0.7, 1.3)
    waves = np.zeros(scene.session_s.shape)
    for row, start in enumerate(scene.starts):
        random = draws.stream("waves", start.key)
        for period_s in random.uniform(12.0, 60.0, 3):
            waves[row] += np.sin(2 * np.pi * (scene.time_s / period_s + random.random()))
    return signal + size * weight * waves[:, :, None]


@form(Stage.WEARING, "An unrecorded slow wander common to all sensors (ours).", touches="all")
def slow_wander(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A common random wander of all sensors, with signs of their own."""
    lasts_s = draws.one("lasts_s", 8.0, 30.0)
    return signal + size * draws.signs() * _wander(scene, draws, lasts_s, 1)


@form(Stage.WEARING, "One sensor wanders, a loose thread (ours).", touches="one")
def channel_wander(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each affected sensor wanders by itself."""
    lasts_s = draws.one("lasts_s", 3.0, 20.0)
    return signal + size * _wander(scene, draws, lasts_s, len(scene.sensors))


@form(Stage.WEARING, "Unrecorded grip pressure that follows the hand's closing.", touches="one_or_all")
def grip_pressure(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Pressure that builds as the hand closes, with an effort that changes from grip to grip."""
    from_share = draws.one("from_share", 0.3, 0.5)
    weight = draws.each("weight", 0.6, 1.4) * draws.sign()
    effort = 1 + 0.5 * np.tanh(_wander(scene, draws, draws.one("effort_lasts_s", 4.0, 12.0), 1))
    grip = np.maximum(scene.closing - from_share, 0.0)[:, :, None] ** draws.one("power", 1.0, 2.0)
    return signal + size * weight * grip * effort


@form(Stage.WEARING, "An unrecorded pull by the thumb under the palm (ours).", touches="one_or_all")
def thumb_across(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A cable that the thumb pulls when it goes under the palm; no sensor of the thumb need be there."""
    pull = 1 / (1 + np.exp(-10 * (scene.bent("T_TMC") - draws.one("at_share", 0.4, 0.6))))
    return signal + size * draws.signs() * pull[:, :, None]


@form(Stage.WEARING, "A hump over a recorded column (ours).", touches="one_or_all", column=context_column)
def context_hump(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hump over the values of a recorded column of an unfamiliar name."""
    value = _column_values(scene, draws)[:, :, None]
    centre, width = draws.one("centre", -0.6, 0.6), draws.one("width", 0.5, 0.9)
    return signal + size * draws.signs() * np.exp(-(((value - centre) / width) ** 2))


@form(Stage.WEARING, "A wave over a recorded column (ours).", touches="one_or_all", column=context_column)
def context_wave(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A wave over the values of a recorded column of an unfamiliar name."""
    value = _column_values(scene, draws)[:, :, None]
    return signal + size * draws.signs() * np.sin(
        draws.one("waves", 1.8, 2.8) * value + draws.one("at", 0, 3)
    )


@form(Stage.WEARING, "The pull of gravity as the forearm turns, unrecorded (ours).", touches="one_or_all")
def tilt(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The cuff's weight pulls one way or the other as the forearm turns, which nobody records."""
    turn = np.pi * np.tanh(_wander(scene, draws, draws.one("lasts_s", 1.5, 6.0), 1))
    return signal + size * draws.signs() * np.sin(turn + draws.one("mounted_at", -1.5, 1.5))


@form(Stage.WEARING, "Unrecorded bumps of a second on one sensor (ours).", touches="one")
def short_bumps(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The glove catches now and then: one sensor is pushed for a second, at random times and either way."""
    width_s, every_s = draws.one("width_s", 0.8, 1.2), draws.one("every_s", 6.0, 12.0)
    pushed = np.zeros(scene.session_s.shape)
    for row, start in enumerate(scene.starts):
        random = draws.stream("bumps", start.key)
        count = max(1, int(random.poisson(float(np.ptp(scene.time_s)) / every_s)))
        for at, way in zip(
            random.uniform(scene.time_s[0], scene.time_s[-1], count), random.choice([-1.0, 1.0], count),
            strict=True,
        ):  # fmt: skip
            away = np.abs(scene.time_s - at) / width_s
            pushed[row] += way * np.where(away < 0.5, np.cos(np.pi * away) ** 2, 0.0)
    return signal + size * pushed[:, :, None]


def _column_values(scene: Scene, draws: Draws) -> np.ndarray:
    """Another level in every take and a slow wander around it, shape (T, N)."""
    level = np.array([draws.stream("level", start.key).uniform(-1, 1) for start in scene.starts])
    return level[:, None] + 0.6 * _wander(scene, draws, 8.0, 1)[:, :, 0]


def _wander(scene: Scene, draws: Draws, lasts_s: float, channels: int) -> np.ndarray:
    """Shape (T, N, channels), standard deviation 1."""
    count = len(scene.time_s)
    return np.stack(
        [
            lasting_noise(draws.stream("wander", start.key), count, channels, lasts_s, scene.rate_hz)
            for start in scene.starts
        ]
    )


FORMS_BY_NAME: dict[str, tuple[Form, ...]] = {
    "common_swing": (slow_waves, slow_wander),
    "one_channel_wander": (channel_wander,),
    "posture_locked": (grip_pressure, thumb_across),
    "context": (context_hump, context_wave, *RECORDED_CONTEXT),
    "tilt": (tilt,),
    "bumps": (short_bumps,),
}


KNOWN_CAUSES = (
    "nonlinearity", "cross_coupling", "palm_arch", "hysteresis", "creep", "lag", "clock_offset",
    "glove_latency", "repeated_samples", "warmup_drift", "temperature", "humidity", "donning_shift",
    "garment_slip", "supply_sag", "saturation", "contact_pressure", "sensor_fault",
)  # fmt: skip
"""Those with an effect's name; each lives in the file of that name."""
UNKNOWN_CAUSES = tuple(f"unknown:{name}" for name in FORMS_BY_NAME)


def forms(name: str) -> tuple[Form, ...]:
    """The forms of one cause. Raises BadInput for another name."""
    if name in UNKNOWN_CAUSES:
        return FORMS_BY_NAME[name.removeprefix("unknown:")]
    if name in KNOWN_CAUSES:
        return import_module(f"{PACKAGE}.{name}").FORMS
    raise BadInput(f"no cause {name!r}; {did_you_mean(name, KNOWN_CAUSES + UNKNOWN_CAUSES)}")
