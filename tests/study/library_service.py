"""The requests of the demo's second act, answered by library calls in this process: no server, no workers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.comparison.where.answer import RotationFindings, WhereItFails
from glovecal_models.diagnosis.model_on_takes import diagnose_model
from glovecal_models.diagnosis.text import missing_effects
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.answer import EffectAdded
from glovecal_models.improvement.text import effect_tried
from glovecal_models.layout import Layout
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_service.plain import document_of


class LibraryService:
    """Stands for a ``RestClient`` of one subject. Where a model fails is not worked out: it says nothing of
    causes, and takes time."""

    def __init__(self) -> None:
        self._takes: dict[str, Take] = {}
        self._models: dict[str, CalibrationModel] = {}
        self._settings: dict[str, TrainingSettings] = {}
        self._taught: list[Take] = []
        self._layout: Layout | None = None
        self._results: list[dict[str, Any]] = []

    def upload_takes(self, table: Path, *, subject: str, layout: str = "") -> dict[str, Any]:
        """As the import of a file: its columns make the layout."""
        takes = read_takes(table)
        self._layout = self._layout or Layout.from_columns("auto", takes[0].sensors, takes[0].rotations)
        self._takes |= {take.name: take for take in takes}
        return {"layout": self._layout.name, "takes": [{"id": take.name} for take in takes]}

    def post(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        _, *place = path.split("/")
        asked = body or {}
        if place == ["subjects"]:
            return {}
        if place == ["models", "train"]:
            return self._job(self._train(asked))
        name, verb = place[1:]
        if verb == "compare":
            found = compare(self._models[name], self._some(asked["takes"]))
            return document_of(found)
        if verb == "where":
            not_asked = RotationFindings("(not asked)", 0.0, 0.0, None, (), None, (), None)
            return document_of(WhereItFails([not_asked], ()))
        return self._job(self._diagnosed(name) if verb == "diagnose" else self._added(name, asked))

    def wait_for_job(self, id: str, **_: Any) -> dict[str, Any]:
        """Nothing is waited for: a job is finished when its request returns."""
        return {"result": self._results[int(id)]}

    def _job(self, result: dict[str, Any]) -> dict[str, Any]:
        self._results.append(result)
        return {"id": str(len(self._results) - 1)}

    def _some(self, names: Sequence[str]) -> list[Take]:
        return [self._takes[name] for name in names]

    def _train(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        assert self._layout is not None
        self._taught = self._some(asked["takes"])
        settings = TrainingSettings(**{name: asked[name] for name in ("method", "samples", "folds")})
        model = train(self._taught, self._layout, asked["subject"], settings)
        return {"model": self._kept(model, settings)}

    def _kept(self, model: CalibrationModel, settings: TrainingSettings) -> str:
        name = f"{len(self._models)}"
        self._models[name], self._settings[name] = model, settings
        return name

    def _diagnosed(self, name: str) -> dict[str, Any]:
        return document_of(missing_effects(diagnose_model(self._models[name], self._taught).diagnosis))

    def _added(self, name: str, asked: Mapping[str, Any]) -> dict[str, Any]:
        settings = self._settings[name]
        found = add_effect(
            self._models[name], self._taught, asked["effect"], rotations=asked.get("rotations"),
            settings=settings,
        )  # fmt: skip
        child = self._kept(found.model, settings) if found.added else None
        return document_of(EffectAdded(**effect_tried(found), model=child))
