"""The demo's result: a table like Wang & Neff 2013, Table 3, and the JSON contract."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from glovecal_service.demo.walk import Walk

HEADINGS = {"raw": "raw", "linear": "linear", "lmc_gpr": "LMC-GPR", "spgp": "SPGP 100"}


def error_table(found: Walk) -> Table:
    """Mean and standard deviation of the absolute error over all rotations, per pose and over all."""
    table = Table(title="Error in degrees, second wearing (not used for training)", box=None, pad_edge=False)
    table.add_column("pose")
    for method in found.models:
        table.add_column(HEADINGS[method], justify="right")
    by_pose = {
        method: {item["pose"]: item for item in found.comparisons[method]["poses"]} for method in found.models
    }
    for pose in by_pose[next(iter(found.models))]:
        cells = (by_pose[method][pose] for method in found.models)
        table.add_row(pose, *(f"{cell['mean_deg']:.1f} ± {cell['sd_deg']:.1f}" for cell in cells))
    rmse = rmse_deg(found)
    table.add_row("all frames, RMSE", *(f"{rmse[method]:.2f}" for method in found.models), style="bold")
    return table


def rmse_deg(found: Walk) -> dict[str, float]:
    """Root mean square error of each method over all rotations and frames of the second wearing."""
    return {method: found.comparisons[method]["overall"]["rmse_deg"] for method in found.models}


def sentences(found: Walk) -> list[str]:
    """What the figures say, with a scale for each."""
    rmse, frames = rmse_deg(found), contract(found)["frames"]
    lost = frames["sent"] - frames["received"] - frames["skipped"]
    spread = found.comparisons["linear"]["overall"]["baseline_deg"]
    median, late = found.meter.latency_ms(50), found.meter.latency_ms(99)
    return [
        f"Scale: the error when predicting the mean is {spread:.1f} degrees; sensor noise and 8-bit steps "
        "are about 1 degree.",
        f"Error ratios: LMC-GPR to linear {rmse['lmc_gpr'] / rmse['linear']:.2f}, SPGP to LMC-GPR "
        f"{rmse['spgp'] / rmse['lmc_gpr']:.2f}.",
        f"Live: reading to pose {median:.2f} ms (median), {late:.2f} ms (99th percentile) through two zenoh "
        "hops; frame period 8.3 ms at 120 Hz.",
        f"Frames: {frames['sent']} sent, {frames['received']} poses received, "
        f"{frames['skipped']} skipped by the service, {lost} lost.",
    ]


def contract(found: Walk) -> dict[str, Any]:
    """The JSON of ``glovecal demo --json``."""
    meter = found.meter
    return {
        "rmse_deg": {method: round(value, 4) for method, value in rmse_deg(found).items()},
        "latency_ms": {
            "p50": round(found.meter.latency_ms(50), 4),
            "p99": round(found.meter.latency_ms(99), 4),
        },
        "frames": {
            "sent": found.recording["sent"],
            "received": meter.counts.received,
            "skipped": meter.skipped,
        },
    }
