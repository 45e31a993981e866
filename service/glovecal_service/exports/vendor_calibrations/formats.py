"""The formats of other programs' calibrations by name; their lines as a model of the glove, and back.

Nobody knows how far an imported line is from the truth: it claims ``ASSUMED_SD_DEG``, and no error.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from glovecal_client.encryption.kept_file import read_kept
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.training import uncertain_above
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, Handedness
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.names import did_you_mean
from glovecal_models.regression.linear_regressor import LinearRegressor, gains_of, line_of
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_service.exports.vendor_calibrations.calibration_format import (
    MOST_CHARACTERS,
    CalibrationFormat,
    Counts,
    FoundLines,
    SensorLine,
    require_lines,
)
from glovecal_service.exports.vendor_calibrations.cyberglove import ASR, VIRTUALHAND
from glovecal_service.exports.vendor_calibrations.finger_ranges import JOINTS, LEROBOT, OPENGLOVES
from glovecal_service.exports.vendor_calibrations.shadow import SHADOW_XML, SHADOW_YAML

ASSUMED_SD_DEG = 5.0
"""Near the 4.45 degrees of gains that others were calibrated with (Gracia-Ibanez et al. 2017, precision)."""
STEEPEST_DEG = 20.0
"""Degrees for one of 256 counts: eight times the steepest sensor of three published gloves."""
EIGHT_BITS = (1.0, 255.0)
"""What a glove is taken to send whose layout does not say."""


def counts_of(layout: Layout) -> Counts:
    return Counts(*(layout.counts or EIGHT_BITS))


def read_model(
    text: str, form: CalibrationFormat, layout: Layout, subject: str, hand: Handedness
) -> tuple[CalibrationModel, FoundLines]:
    """Raises BadInput for text that is none of the format, or of another glove."""
    if len(text) > MOST_CHARACTERS:
        raise BadInput(f"{len(text)} characters are no calibration: {MOST_CHARACTERS} at most")
    found = _without_steep(form.read(text, counts_of(layout), hand), counts_of(layout))
    rotations = [_rotation(item, found.lines, layout) for item in layout.correspondences]
    known = [item for item in rotations if item is not None]
    if not known:
        raise BadInput(
            f"none of the sensors {', '.join(found.lines)} is read by itself in layout {layout.name!r}"
        )
    names = {item.rotation for item in known}
    ruled = [item for item in map(_rule, layout.correspondences) if item and _follows(item, names)]
    model = CalibrationModel(
        layout=layout,
        subject=subject,
        method="linear",
        rotations=(*known, *ruled),
        takes=(),
        error_estimate={"how": f"not estimated: imported from {form.name}", "folds": 0},
    )
    return model, found


def _without_steep(found: FoundLines, counts: Counts) -> FoundLines:
    """What no sensor can tell is left out: two points that are hardly apart give any number of degrees."""
    most = STEEPEST_DEG / counts.per_8_bit
    steep = {
        name: f"its points are too close together: {abs(line.gain):.3g} degrees a count, {most:.3g} at most"
        for name, line in found.lines.items()
        if abs(line.gain) > most
    }
    flat = {name: line for name, line in found.lines.items() if name not in steep}
    return require_lines(FoundLines(flat, {**found.left_out, **steep}, found.doubts), "the calibration")


def _rotation(item: Correspondence, lines: Mapping[str, SensorLine], layout: Layout) -> RotationModel | None:
    sensor = item.measuring_sensor
    if sensor is None or sensor not in lines:
        return None
    line, name = lines[sensor], item.rotation
    if sensor != name:
        line = _scaled(line, sensor, name)
    counts = counts_of(layout)
    regressor = line_of([line.gain], -line.gain * line.zero, ASSUMED_SD_DEG, {"trainer": "imported"})
    return RotationModel(
        Correspondence(name, "1S1R", (sensor,)),
        regressor,
        np.array([counts.lowest]),
        np.array([counts.highest]),
        uncertain_above(regressor.noise_variance),
        None,
        0,
    )


def _scaled(line: SensorLine, sensor: str, rotation: str) -> SensorLine:
    """Of a finger's sensor, for one of its joints, which goes through its range over the same readings."""
    of = JOINTS.get(sensor[:1], rotation)
    (low, high), (own_low, own_high) = (
        ACTIVE_RANGE_DEG[of],
        ACTIVE_RANGE_DEG.get(rotation, ACTIVE_RANGE_DEG[of]),
    )
    found = SensorLine.through((line.reading(low), own_low), (line.reading(high), own_high))
    return found or line


def _rule(item: Correspondence) -> RotationModel | None:
    if item.simulated is None:
        return None
    rule = RuleRegressor(item.simulated.sensors, item.simulated.weights(item.simulated.sensors))
    return RotationModel(item, rule, np.empty(0), np.empty(0), uncertain_above(0.0), None, 0)


def _follows(item: RotationModel, names: set[str]) -> bool:
    return isinstance(item.regressor, RuleRegressor) and set(item.regressor.rotations) <= names


class WrittenLines(NamedTuple):
    text: str
    left_out: dict[str, str]
    """Rotations that the format cannot say, and why."""


def write_model(model: CalibrationModel, form: CalibrationFormat, hand: Handedness) -> WrittenLines:
    """Raises BadInput where no rotation is a line of one sensor, or effects would be lost."""
    if model.effects:
        named = ", ".join(item.name for item in model.effects)
        raise BadInput(f"the model corrects for {named}, which {form.title} cannot say: export its parent")
    lines: dict[str, SensorLine] = {}
    left_out: dict[str, str] = {}
    for item in model.rotations:
        if isinstance(item.regressor, RuleRegressor):
            continue
        line = rotation_line(item)
        sensor = item.correspondence.sensors[0]
        of = sensor if sensor in model.rotation_names else JOINTS.get(sensor[:1], item.rotation)
        if line is None:
            left_out[item.rotation] = "no line of one sensor"
        elif of == item.rotation:
            try:
                form.write({sensor: line}, counts_of(model.layout), hand)
            except BadInput as error:
                left_out[item.rotation] = str(error)
            else:
                lines[sensor] = line
    if not lines:
        why = "; ".join(f"{name}: {reason}" for name, reason in left_out.items())
        raise BadInput(f"nothing of this model can be written as {form.title} ({why})")
    return WrittenLines(form.write(lines, counts_of(model.layout), hand), left_out)


def rotation_line(item: RotationModel) -> SensorLine | None:
    """Of a rotation that is read from one sensor alone; None for any other."""
    if not isinstance(item.regressor, LinearRegressor) or item.correspondence.simulated is not None:
        return None
    gains, offset = gains_of(item.regressor)
    if gains[0] == 0.0 or np.any(gains[1:] != 0.0):
        return None
    return SensorLine(float(gains[0]), -offset / float(gains[0]))


FORMATS: dict[str, CalibrationFormat] = {
    one.name: one for one in (VIRTUALHAND, ASR, SHADOW_XML, SHADOW_YAML, OPENGLOVES, LEROBOT)
}


if TYPE_CHECKING:
    FormatName = str
else:
    FormatName = Literal[tuple(FORMATS)]


def calibration_text(path: Path) -> str:
    """The whole file, UTF-8 or else Windows-1252. Raises BadInput for one that is too long."""
    content = read_kept(path, MOST_CHARACTERS + 1)
    if len(content) > MOST_CHARACTERS:
        raise BadInput(f"{path.stat().st_size} bytes are no calibration: {MOST_CHARACTERS} at most")
    return as_text(content)


def as_text(content: bytes) -> str:
    """ "" for what is no text."""
    if b"\0" in content:
        return ""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace")


def recognised(text: str) -> CalibrationFormat | None:
    """By what stands in the file; None for what is no calibration of another program."""
    return next((one for one in FORMATS.values() if one.recognises(text)), None)


def calibration_format(name: str) -> CalibrationFormat:
    """Raises BadInput that lists what there is."""
    if name not in FORMATS:
        raise BadInput(f"no calibration format {name!r}; {did_you_mean(name, FORMATS)}")
    return FORMATS[name]
