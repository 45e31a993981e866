"""The second act: the loop on a glove with a hidden effect, by the REST calls that a user's verbs make.

At its end the error falls (a chart of text), and what was hidden: was it found?
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from glovecal_client.rest import RestClient
from glovecal_models.comparison.answer import Comparison
from glovecal_models.diagnosis.answer import MissingEffects, NamedEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_models.improvement.answer import EffectAdded
from glovecal_service.first_run.hidden_effect import TRAINING, hidden_sentence
from glovecal_service.first_run.hidden_session import HiddenSession
from glovecal_service.plain import read
from glovecal_service.questions.add_effect import ADD_EFFECT
from glovecal_service.questions.comparison import COMPARE, WHERE
from glovecal_service.questions.diagnose import DIAGNOSE
from glovecal_service.questions.train import TRAIN
from glovecal_service.rest.job.answer import Job, JobFacts
from glovecal_service.rest.take.answer import ImportedTakes

SUBJECT = "demo-hidden"
BASES = ("raw", "linear", "lmc_gpr")
DIAGNOSED = "lmc_gpr"
Say = Callable[[str], None]


@dataclass
class Findings:
    """What the service answered."""

    subject: str = SUBJECT
    layout: str = ""
    tests: list[str] = field(default_factory=list)
    """Ids of the takes that no model is trained on."""
    trainings: dict[str, str] = field(default_factory=dict)
    """Jobs by method."""
    models: dict[str, str] = field(default_factory=dict)
    comparisons: dict[str, Comparison] = field(default_factory=dict)
    """By method; that of the child is ``with_effect``."""
    where: str = ""
    diagnosis: MissingEffects | None = None
    addition: EffectAdded | None = None
    """None when nothing was named."""
    diagnosis_after: MissingEffects | None = None

    @property
    def diagnosed(self) -> MissingEffects:
        """The first diagnosis, once it was made."""
        assert self.diagnosis is not None
        return self.diagnosis

    @property
    def child(self) -> str | None:
        """The model with the effect, if one was named and stayed."""
        return self.addition.model if self.addition else None

    @property
    def served(self) -> str:
        """The model that is active in the end."""
        return self.child or self.models[DIAGNOSED]

    @property
    def last(self) -> Comparison:
        """The comparison of the model that is active in the end."""
        return self.comparisons.get("with_effect", self.comparisons[DIAGNOSED])


def prepare(service: RestClient, hidden: HiddenSession, folder: Path, *, subject: str = SUBJECT) -> Findings:
    """Import the takes and begin to train the bases; nobody needs to watch or to wait."""
    found = Findings(subject)
    service.post("/subjects", {"name": subject, "title": "Simulated subject with a hidden effect"})
    training, test = hidden.write(folder)
    learned = read(ImportedTakes, service.upload_takes(training, subject=subject))
    found.layout = learned.layout
    held_out = read(ImportedTakes, service.upload_takes(test, subject=subject, layout=found.layout))
    takes, found.tests = ([take.id for take in answer.takes] for answer in (learned, held_out))
    for method in BASES:
        found.trainings[method] = _train(service, found, method, takes)
    return found


def second_act(
    service: RestClient,
    found: Findings,
    say: Say,
    progress: Say,
    live: Callable[[], None] = lambda: None,
) -> None:
    """Walk the loop once and complete ``found``.

    ``say`` gets what a user should read, ``progress`` what goes on meanwhile; ``live`` streams with the last
    model, which is active then and being diagnosed: prediction does not wait for that.
    """
    tests = {"takes": found.tests}
    for method in BASES:
        job = read(Job, service.wait_for_job(found.trainings[method]))
        found.models[method] = TRAIN.read(job.result).model
        found.comparisons[method] = _compared(service, found, found.models[method])
    model = found.models[DIAGNOSED]
    _say_errors(found.comparisons[DIAGNOSED], say)
    found.where = WHERE.read(service.post(f"/models/{model}/where", tests)).rotations[0].sentence
    say(f"Where: {found.where}")
    job = service.post(f"/models/{model}/diagnose", {})
    found.diagnosis = DIAGNOSE.read(_finished(service, job, progress))
    _say_diagnosis(found.diagnosis, say)
    if found.diagnosis.named is not None:
        _add(service, found, found.diagnosis.named, progress)
    if found.child is None:
        if found.addition is not None:
            say(f"Not added: {found.addition.sentence}")
        live()
        return
    found.comparisons["with_effect"] = _compared(service, found, found.child)
    say(_added(found))
    again = service.post(f"/models/{found.child}/diagnose", {})
    live()
    found.diagnosis_after = DIAGNOSE.read(_finished(service, again, progress))
    say(f"Diagnosed again: {_after(found.diagnosis_after)}")


def _compared(service: RestClient, found: Findings, model: str) -> Comparison:
    return COMPARE.read(service.post(f"/models/{model}/compare", {"takes": found.tests}))


def _train(service: RestClient, found: Findings, method: str, takes: list[str]) -> str:
    body = {"subject": found.subject, "layout": found.layout, "method": method, "takes": takes}
    begun = service.post("/models/train", body | TRAINING | {"activate": method == DIAGNOSED})
    return read(JobFacts, begun).id


def _add(service: RestClient, found: Findings, named: NamedEffect, progress: Say) -> None:
    """As ``glovecal diagnose`` proposes it; the effect stays only if the error on takes left out falls."""
    corrected = {item.effect for item in found.diagnosed.candidates} - {"clock_offset"}
    body: dict[str, Any] = {"effect": named.effect, "activate": True}
    if named.where and named.effect in corrected:
        body |= {"rotations": list(named.where)}
    begun = service.post(f"/models/{found.models[DIAGNOSED]}/effects", body)
    found.addition = ADD_EFFECT.read(_finished(service, begun, progress))


def _added(found: Findings) -> str:
    """The error before and after, as all else here has it: on the test takes, over all rotations. The
    service's own sentence is of the rotations that were learned anew, on takes left out of training."""
    addition = found.addition
    assert addition is not None
    before, after = (found.comparisons[name].rmse_deg for name in (DIAGNOSED, "with_effect"))
    return (
        f"Added: {addition.effect} on {', '.join(addition.where)}. Held-out error, all rotations: from"
        f" {before:.2f} to {after:.2f} degrees."
    )


def _finished(service: RestClient, begun: dict[str, Any], progress: Say) -> dict[str, Any]:
    """The job's result; each new sentence of it on the way."""
    told: set[str] = set()

    def show(document: dict[str, Any]) -> None:
        now = read(Job, document)
        if 0 < now.fraction < 1 and now.sentence not in told:
            told.add(now.sentence)
            progress(f"  {round(100 * now.fraction):>3} %  {now.sentence}")

    return read(Job, service.wait_for_job(read(JobFacts, begun).id, progress=show)).result or {}


def _say_errors(comparison: Comparison, say: Say) -> None:
    say("LMC-GPR, held-out error and noise floor (RMSE, degrees):")
    for name, errors in comparison.rotations.items():
        known = "unknown" if errors.floor is None else f"{errors.floor.floor_deg:.2f}"
        say(f"  {name:<8} {errors.rmse_deg:5.2f}   floor {known}")


def _say_diagnosis(found: MissingEffects, say: Say) -> None:
    for sentence in (*found.reference_problems, *(item.sentence for item in found.findings)):
        say(f"Found in the recording: {sentence}")
    named = found.named
    if named is None:
        say("Diagnosis: no known effect beats its control significantly.")
        say(_left(found))
        return
    say(f"Diagnosis: {named.sentence}")
    say(f"Confidence set: {', '.join(named.confidence_set)}.")
    if found.next_take is not None:
        say(found.next_take.sentence)


def _after(found: MissingEffects) -> str:
    if found.named is None:
        return f"no further effect beats its control significantly. {_left(found)}"
    return found.named.sentence


def _left(found: MissingEffects) -> str:
    return "" if found.unexplained_residual is None else found.unexplained_residual.sentence


LABELS = {"raw": "raw", "linear": "linear", "lmc_gpr": "LMC-GPR"}
BAR_WIDTH = 48


def errors_deg(found: Findings) -> dict[str, float]:
    """RMSE over all rotations of the takes not trained on, by method; ``with_effect`` is the child's."""
    return {name: item.rmse_deg for name, item in found.comparisons.items()}


def floor_deg(found: Findings) -> float | None:
    """The noise floor as the service measured it on the same takes; None where it could not."""
    return found.last.noise_floor_deg


def chart(found: Findings) -> list[str]:
    """One bar for each calibration and one for the floor."""
    labels = LABELS | {"with_effect": f"+ {_named(found) or ''}"}
    rows = [(labels[name], value) for name, value in errors_deg(found).items()]
    floor = found.last.overall.floor
    if floor is not None:
        rows.append((f"noise floor{' >' if floor.is_lower_bound else ''}", floor.floor_deg))
    width, largest = max(len(label) for label, _ in rows), max(value for _, value in rows)
    return [
        f"  {label:<{width}} {value:6.2f}  {'█' * max(1, round(BAR_WIDTH * value / largest))}"
        for label, value in rows
    ]


def fall(found: Findings) -> list[str]:
    """How much of what is above the floor the effect took away; empty where none was added."""
    errors, floor = errors_deg(found), floor_deg(found)
    if "with_effect" not in errors or floor is None:
        return []
    above, left = (max(errors[name] ** 2 - floor**2, 0.0) ** 0.5 for name in ("lmc_gpr", "with_effect"))
    times = errors["with_effect"] / floor
    return [
        f"Error above the noise floor: LMC-GPR {above:.2f} degrees, with the effect {left:.2f}. The error is "
        f"{times:.1f} times the noise floor."
    ]


def verdict(hidden: HiddenSession, found: Findings) -> list[str]:
    """What was hidden, and whether that is what was said."""
    truth, named = hidden.truth, _named(found)
    perfect = max(hidden.session.floor_deg.values())
    floor = f"Without it, a perfect calibration of this glove has an error of up to {perfect:.2f} degrees."
    if truth is None:
        told = ["Hidden effect: none. This simulated glove is healthy."]
        told.append("Right: nothing was named." if named is None else f"Wrong: {named} was named.")
        if named is None and _is_left(found.diagnosis):
            told.append(
                f"The unexplained residual is the normal slip of cloth, {hidden.session.plan.nuisance_deg:g} "
                "degrees in this simulation; the catalogue has no effect for it."
            )
        return told
    told = [hidden_sentence(truth, hidden.session.plan.sensors), floor]
    wrong = [f"Wrong: {said}." for said in told_wrongly(hidden, found)]
    if is_right(hidden, found):
        if truth.name.startswith("unknown:"):
            return [
                *told,
                "Right: no effect of the catalogue was named, and an unexplained residual was reported.",
                *wrong,
            ]
        return [*told, f"Right: {named} was named.", *wrong]
    if truth.name.startswith("unknown:"):
        said = f"{named} was named" if named else "no unexplained residual was reported"
        return [*told, f"Wrong: {said}; this effect is not in the catalogue."]
    if truth.name in _confidence_set(found):
        return [*told, f"Partly right: {named} was named first; {truth.name} is in the confidence set."]
    return [*told, f"Wrong: {'nothing' if named is None else named} was named."]


def told_wrongly(hidden: HiddenSession, found: Findings) -> list[str]:
    """What was told beside the first name and is not so; each as the end of a sentence.

    The references are right, and no second effect is hidden. That something is left is right where the error
    of a rotation is more than a healthy glove's.
    """
    truth, wrong = hidden.truth, []
    for when, diagnosis in (("", found.diagnosis), (" afterwards", found.diagnosis_after)):
        if diagnosis is None:
            continue
        wrong += [f"{item!r} was told{when}" for item in diagnosis.reference_problems]
        strange = {item.effect for item in diagnosis.findings} - {truth.name if truth else "", _named(found)}
        wrong += [f"{name} was found{when}" for name in sorted(strange)]
    after = _named_after(found)
    if after is not None and after != (truth.name if truth else None):
        wrong.append(f"{after} was named afterwards")
    if truth is None and _is_left(found.diagnosis):
        wrong.append("an unexplained residual was reported of a healthy glove")
    is_catalogued = truth is not None and not truth.name.startswith("unknown:")
    floor, errors = floor_deg(found), errors_deg(found)
    if _is_left(found.diagnosis_after) and is_catalogued and not _is_anything_left(found):
        wrong.append("an unexplained residual was reported afterwards, of an error as in healthy gloves")
    if floor is not None and min(errors.values()) < floor:
        wrong.append("an error was told that lies below its noise floor")
    return list(dict.fromkeys(wrong))


def _is_anything_left(found: Findings) -> bool:
    """Whether the error of the last model is more than a healthy glove's, in all or of one rotation."""
    compared = [found.last.overall, *found.last.rotations.values()]
    most = DIAGNOSIS_LIMITS.healthy_floors
    return any(item.rmse_deg > most * item.floor.floor_deg for item in compared if item.floor)


def is_right(hidden: HiddenSession, found: Findings) -> bool:
    """Named was what is hidden; without a name of its own, that nothing was and that something is left."""
    truth, named = hidden.truth, _named(found)
    if truth is None:
        return named is None
    if not truth.name.startswith("unknown:"):
        return named == truth.name
    if truth.column is not None:
        return named == f"context:{truth.column}"
    return named is None and _is_left(found.diagnosis)


def _is_left(diagnosis: MissingEffects | None) -> bool:
    """Whether an unexplained residual was reported."""
    left = None if diagnosis is None else diagnosis.unexplained_residual
    return left is not None and left.is_significant


def hidden_contract(hidden: HiddenSession, found: Findings) -> dict[str, Any]:
    """What the second act adds to the JSON of ``glovecal demo --json``."""
    truth, floor = hidden.truth, floor_deg(found)
    return {
        "hidden": {
            "truth": truth.name if truth else "none",
            "form": truth.form if truth else None,
            "seed": hidden.seed,
            "named": _named(found),
            "confidence_set": _confidence_set(found),
            "right": is_right(hidden, found),
        },
        "error_fall_deg": {name: round(value, 4) for name, value in errors_deg(found).items()},
        "noise_floor_deg": None if floor is None else round(floor, 4),
    }


def _named(found: Findings) -> str | None:
    named = found.diagnosed.named
    return None if named is None else named.effect


def _named_after(found: Findings) -> str | None:
    named = found.diagnosis_after.named if found.diagnosis_after else None
    return None if named is None else named.effect


def _confidence_set(found: Findings) -> list[str]:
    named = found.diagnosed.named
    return [] if named is None else list(named.confidence_set)
