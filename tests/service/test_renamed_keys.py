"""Results that jobs of earlier versions stored are read with the keys and values of today."""

from __future__ import annotations

from glovecal_service.report.diagnosis_page import diagnosis_page
from glovecal_service.report.improvement_page import improvement_page
from glovecal_service.views.job_result import current_result
from glovecal_service.views.renamed_keys import current_evidence

HELD = {
    "sentence": "The readings drift.", "verdict": "not_judgeable", "confidence_set": [], "holds": 0,
    "probability": 1.0, "drift_in_other_poses": None, "recovery": None, "poses": [],
}  # fmt: skip
DIAGNOSIS = {
    "rotations": {"probability": {"rmse_deg": 2.0, "noise_floor_deg": None}},
    "named": {
        "effect": "lag", "where": ["I_PIP"], "kind": "correction", "verdict": "named",
        "confidence_set": ["lag"], "parameters": {"I_PIP": {"tau_s": 0.1}}, "saved_deg": 1.0,
        "decoy_saved_deg": 0.1, "sentence": "lag on I_PIP.",
    },
    "candidates": [
        {
            "effect": "lag", "where": ["I_PIP"], "rmse_before_deg": 2.0, "rmse_after_deg": 1.0,
            "rmse_decoy_deg": 1.9, "saved_share": {"I_PIP": 0.7}, "decoy_saved_share": {"I_PIP": 0.1},
            "probability": 0.01, "passes": True, "sentence": "lag.",
        }
    ],
    "not_judgeable": [{"effect": "creep", "why": "no pose is held"}],
    "findings": [],
    "reference_problems": [],
    "hold_drift": None,
    "something_left": {
        "is_left": True, "sentence": "Something is left.", "not_judgeable": None,
        "goes_with": [
            {
                "rotation": "I_PIP", "column": "wearing", "phrase": "the wearing", "size_deg": 0.8,
                "probability": 0.01,
            }
        ],
    },
    "next_take": None,
    "sentences": ["lag on I_PIP."],
    "model": "0123456789abcdef",
    "takes": [{"id": "a", "name": "one"}],
}  # fmt: skip
IMPROVEMENT = {
    "steps": [
        {"model": "a", "added": None, "rmse_deg": 2.0, "per_rotation": {"I_PIP": 2.0}},
        {
            "model": "b", "rmse_deg": 1.0, "per_rotation": {"I_PIP": 1.0}, "decoy_rmse_deg": 1.9,
            "added": {
                "effect": "lag", "where": ["I_PIP"], "verdict": "named", "confidence_set": ["lag"],
                "parameters": {"I_PIP": {"tau_s": 0.1}},
            },
        },
    ],
    "baselines": {"raw": 9.0},
    "noise_floor_deg": {"I_PIP": 0.8},
    "noise_floor_interval_deg": {"I_PIP": [0.7, 0.9]},
    "stopped": "noise_floor",
    "undone": [],
    "hold_drift": HELD,
    "something_left": True,
    "next_take": None,
    "sentences": [],
}  # fmt: skip


def test_a_stored_diagnosis_has_the_keys_of_today():
    found = current_result("diagnose", DIAGNOSIS)
    assert found is not None
    assert found["not_identifiable"] == [{"effect": "creep", "why": "no pose is held"}]
    assert found["unexplained_residual"]["is_significant"] is True
    assert found["unexplained_residual"]["associations"][0]["p_value"] == 0.01
    assert found["named"]["control_saved_deg"] == 0.1
    [candidate] = found["candidates"]
    assert (candidate["rmse_control_deg"], candidate["p_value"]) == (1.9, 0.01)
    assert candidate["control_saved_share"] == {"I_PIP": 0.1}
    assert set(found["rotations"]) == {"probability"}, "names that users gave stay"
    assert current_result("diagnose", found) == found
    assert "1.90" in diagnosis_page(found)


def test_a_stored_improvement_has_the_keys_of_today():
    found = current_result("improve", IMPROVEMENT)
    assert found is not None
    assert found["steps"][1]["control_rmse_deg"] == 1.9
    assert found["unexplained_residual"]["is_significant"] is True
    assert (found["hold_drift"]["verdict"], found["hold_drift"]["p_value"]) == ("not_identifiable", 1.0)
    assert current_result("improve", found) == found
    assert "1.90" in improvement_page(found, "linear", "anna")


def test_what_is_no_result_of_its_kind_is_shown_as_it_is():
    assert current_result("diagnose", {"odd": 1}) == {"odd": 1}
    assert current_result("train", {"model": "a"}) == {"model": "a"}
    assert current_result("improve", None) is None


def test_evidence_in_stored_models_has_the_keys_of_today():
    assert current_evidence({"rmse_decoy_deg": 1.0, "nlpd": 2.0}) == {"rmse_control_deg": 1.0, "nlpd": 2.0}
