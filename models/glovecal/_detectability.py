"""What takes could have shown: how large an effect must be to be named in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from glovecal._calls import Progress, library_call
from glovecal._effects import declared
from glovecal._layouts import LayoutLike
from glovecal._model import CalibrationModel, about, on_takes
from glovecal._takes import takes_in
from glovecal_models.diagnosis.detectability.answer import Detectable
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take


def detectable(
    takes: Take | Iterable[Take],
    effects: str | Sequence[str],
    *,
    model: CalibrationModel | None = None,
    layout: LayoutLike = None,
    rotations: Sequence[str] | None = None,
    sizes_deg: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
    trials: int = 3,
    also: Sequence[str] = (),
    seed: int = 0,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> Detectable:
    """Put effects of known size into these takes, made perfect otherwise, and diagnose them again.

    ``model``: its effects and layout count; without one the takes are looked at by themselves. ``rotations``:
    put in there at once; None for all. ``also``: effects of your own as text, put in by their names as well.
    A trial takes seconds. Raises BadInput, Cancelled.
    """
    from glovecal_models.diagnosis.detectability.detection import Detection

    own = declared(also)
    names = [effects] if isinstance(effects, str) else list(effects)
    names = list(dict.fromkeys([*names, *(item.name for item in own)]))
    with library_call(progress) as report:
        on = on_takes(takes_in(takes), model, layout, own)
        places = None if rotations is None else [tuple(rotations)]
        found = Detection(on, names, places, sizes_deg, trials, seed).answered(cancelled, report)
    return about(found, on.takes, model)
