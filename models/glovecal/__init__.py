"""Glovecal as a library: calibrate a data glove, find which physical effect is missing, add it.

    import glovecal

    takes = glovecal.read_takes("monday.csv")
    result = glovecal.improve(takes, progress=True)
    result.plot()

Every result prints itself, shows itself in a notebook, and has ``to_frame()`` (needs pandas) and ``plot()``
(needs matplotlib). All its numbers are its fields; ``inner``, where there is one, is the result of
``glovecal_models`` behind it. Angles and errors are in degrees. Long calls take ``progress`` (True, or a
callable of a sentence and the fraction done) and ``cancelled`` (a callable that says True to stop). Ctrl-C
ends them, and workers where there are any.
"""

from __future__ import annotations

from glovecal._additions import Addition, add_effect, remove_effect
from glovecal._comparison import Comparison, WhereItFails, compare, where
from glovecal._detectability import Detectable, detectable
from glovecal._diagnosis import Diagnosis, diagnose
from glovecal._effects import Catalogue, effects, register_effect
from glovecal._explanation import Explanation, explain
from glovecal._improvement import Improvement, improve
from glovecal._layouts import read_layout
from glovecal._model import CalibrationModel, load_model, save_model
from glovecal._prediction import Angles, predict
from glovecal._simulation import Session, simulate
from glovecal._takes import Takes, look, read_takes, write_takes
from glovecal._training import train
from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.dynamics import ArrayStateEffect, HistoryEffect, InstantEffect
from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Effect,
    FormSignals,
    FurtherColumns,
    IntervalEffect,
    RepairEffect,
    SignatureEffect,
    Stream,
)
from glovecal_models.effects.base.facts import About, Parameter, Shape, Weights
from glovecal_models.effects.base.relations import Motion, Relations, Rival
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units
from glovecal_models.errors import BadInput, Cancelled, GlovecalError, NotTrainable, WorkerDied
from glovecal_models.layout import Layout
from glovecal_models.takes.answer import TablePreview
from glovecal_models.takes.take import Take

__all__ = [
    "About",
    "Addition",
    "Angles",
    "ArrayStateEffect",
    "BadInput",
    "CalibrationModel",
    "Cancelled",
    "Catalogue",
    "Comparison",
    "ContextEffect",
    "CorrectionEffect",
    "Detectable",
    "Diagnosis",
    "Effect",
    "EffectComparison",
    "Explanation",
    "FormSignals",
    "FurtherColumns",
    "GlovecalError",
    "HistoryEffect",
    "Improvement",
    "InstantEffect",
    "IntervalEffect",
    "Layout",
    "Motion",
    "NotTrainable",
    "Parameter",
    "Relations",
    "RepairEffect",
    "Rival",
    "Session",
    "Settings",
    "Shape",
    "Signals",
    "SignatureEffect",
    "Stream",
    "TablePreview",
    "Take",
    "Takes",
    "Weights",
    "WhereItFails",
    "WorkerDied",
    "add_effect",
    "compare",
    "detectable",
    "diagnose",
    "effects",
    "explain",
    "fit_joint_units",
    "improve",
    "in_joint_units",
    "load_model",
    "look",
    "predict",
    "read_layout",
    "read_takes",
    "register_effect",
    "remove_effect",
    "save_model",
    "simulate",
    "train",
    "where",
    "write_takes",
]

# Shown as glovecal.train, not by the file it lies in. What comes from glovecal_models keeps its home: other
# processes unpickle it from there.
for _name in __all__:
    if getattr(globals()[_name], "__module__", "").startswith("glovecal._"):
        globals()[_name].__module__ = "glovecal"
