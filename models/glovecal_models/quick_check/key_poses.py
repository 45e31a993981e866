"""Angles of the poses that every hand takes much alike."""

from __future__ import annotations

from collections.abc import Mapping

KEY_POSES_DEG: Mapping[str, Mapping[str, float]] = {
    "flat": {f"{finger}_{joint}": 0.0 for finger in "IMRP" for joint in ("MCP", "PIP")}
    | dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD", "T_MCP", "T_IP"), 3.0),
    "fist": {f"{finger}_MCP": 86.0 for finger in "IMRP"} | {f"{finger}_PIP": 95.0 for finger in "IMRP"},
    "spread": {f"{finger}_{joint}": 0.0 for finger in "IMRP" for joint in ("MCP", "PIP")}
    | dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD"), 24.0),
}
"""The key poses that every hand takes much alike (Wang & Neff 2013, section 5.1.1); joints that people hold
differently in them are not given."""
