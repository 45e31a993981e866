"""The second act: the loop on a glove with a hidden effect, by the REST calls that a user's verbs make.

take import -> train -> compare -> where -> diagnose -> add-effect -> compare -> diagnose
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from glovecal_client.rest import RestClient
from glovecal_service.demo.hidden_session import HiddenSession

SUBJECT = "demo-hidden"
BASES = ("raw", "linear", "lmc_gpr")
DIAGNOSED = "lmc_gpr"
TRAINING = {"samples": 600, "folds": 2}
"""Five joints with one sensor each need no more. The folds give each version the error that the studio shows;
what the demo prints is measured on the test takes."""
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
    comparisons: dict[str, dict[str, Any]] = field(default_factory=dict)
    """By method; that of the child is ``with_effect``."""
    where: str = ""
    diagnosis: dict[str, Any] = field(default_factory=dict)
    addition: dict[str, Any] | None = None
    """None when nothing was named."""
    diagnosis_after: dict[str, Any] | None = None

    @property
    def child(self) -> str | None:
        """The model with the effect, if one was named and stayed."""
        return self.addition["model"] if self.addition else None

    @property
    def served(self) -> str:
        """The model that is active in the end."""
        return self.child or self.models[DIAGNOSED]

    @property
    def last(self) -> dict[str, Any]:
        """The comparison of the model that is active in the end."""
        return self.comparisons.get("with_effect", self.comparisons[DIAGNOSED])


def prepare(service: RestClient, hidden: HiddenSession, folder: Path, *, subject: str = SUBJECT) -> Findings:
    """Import the takes and begin to train the bases; nobody needs to watch or to wait."""
    found = Findings(subject)
    service.post("/subjects", {"name": subject, "title": "Simulated subject with a hidden effect"})
    training, test = hidden.write(folder)
    learned = service.upload_takes(training, subject=subject)
    found.layout = learned["layout"]
    held_out = service.upload_takes(test, subject=subject, layout=found.layout)
    takes, found.tests = ([take["id"] for take in answer["takes"]] for answer in (learned, held_out))
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
        found.models[method] = service.wait_for_job(found.trainings[method])["result"]["model"]
        found.comparisons[method] = service.post(f"/models/{found.models[method]}/compare", tests)
    model = found.models[DIAGNOSED]
    _say_errors(found.comparisons[DIAGNOSED], say)
    found.where = service.post(f"/models/{model}/where", tests)["rotations"][0]["sentence"]
    say(f"Where: {found.where}")
    found.diagnosis = _finished(service, service.post(f"/models/{model}/diagnose", {}), progress)
    _say_diagnosis(found.diagnosis, say)
    named = found.diagnosis["named"]
    if named is not None:
        _add(service, found, named, progress)
    if found.child is None:
        if found.addition is not None:
            say(f"Not added: {found.addition['sentence']}")
        live()
        return
    found.comparisons["with_effect"] = service.post(f"/models/{found.child}/compare", tests)
    say(_added(found))
    again = service.post(f"/models/{found.child}/diagnose", {})
    live()
    found.diagnosis_after = _finished(service, again, progress)
    say(f"Diagnosed again: {_after(found.diagnosis_after)}")


def _train(service: RestClient, found: Findings, method: str, takes: list[str]) -> str:
    body = {"subject": found.subject, "layout": found.layout, "method": method, "takes": takes}
    return service.post("/models/train", body | TRAINING | {"activate": method == DIAGNOSED})["id"]


def _add(service: RestClient, found: Findings, named: dict[str, Any], progress: Say) -> None:
    """As ``glovecal diagnose`` proposes it; the effect stays only if the error on takes left out falls."""
    corrected = {item["effect"] for item in found.diagnosis["candidates"]} - {"clock_offset"}
    body = {"effect": named["effect"], "activate": True}
    if named["where"] and named["effect"] in corrected:
        body["rotations"] = named["where"]
    job = service.post(f"/models/{found.models[DIAGNOSED]}/effects", body)
    found.addition = _finished(service, job, progress)


def _added(found: Findings) -> str:
    """The error before and after, as all else here has it: on the test takes, over all rotations. The
    service's own sentence is of the rotations that were learned anew, on takes left out of training."""
    addition = found.addition or {}
    before, after = (found.comparisons[name]["overall"]["rmse_deg"] for name in (DIAGNOSED, "with_effect"))
    return (
        f"Added: {addition['effect']} on {', '.join(addition['where'])}. Held-out error, all rotations: from"
        f" {before:.2f} to {after:.2f} degrees."
    )


def _finished(service: RestClient, job: dict[str, Any], progress: Say) -> dict[str, Any]:
    """The job's result; each new sentence of it on the way."""
    told: set[str] = set()

    def show(document: dict[str, Any]) -> None:
        sentence = document["sentence"]
        if 0 < document["fraction"] < 1 and sentence not in told:
            told.add(sentence)
            progress(f"  {round(100 * document['fraction']):>3} %  {sentence}")

    return service.wait_for_job(job["id"], progress=show)["result"]


def _say_errors(comparison: dict[str, Any], say: Say) -> None:
    say("LMC-GPR, held-out error and noise floor (RMSE, degrees):")
    for name, errors in comparison["rotations"].items():
        floor = errors["floor"]
        known = "unknown" if floor is None else f"{floor['floor_deg']:.2f}"
        say(f"  {name:<8} {errors['rmse_deg']:5.2f}   floor {known}")


def _say_diagnosis(found: dict[str, Any], say: Say) -> None:
    for sentence in (*found["reference_problems"], *(item["sentence"] for item in found["findings"])):
        say(f"Found in the recording: {sentence}")
    named = found["named"]
    if named is None:
        say("Diagnosis: no known effect beats its control significantly.")
        say(found["unexplained_residual"]["sentence"])
        return
    say(f"Diagnosis: {named['sentence']}")
    say(f"Confidence set: {', '.join(named['confidence_set'])}.")
    following = found["next_take"]
    if following:
        rivals = " and ".join(following["separates"])
        say(f"To separate {rivals}, record {following['seconds']} s: {following['what']}")


def _after(found: dict[str, Any]) -> str:
    if found["named"] is None:
        residual = found["unexplained_residual"]["sentence"]
        return f"no further effect beats its control significantly. {residual}"
    return found["named"]["sentence"]
