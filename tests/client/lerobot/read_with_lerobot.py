"""Runs in an environment with the real LeRobot: reads a dataset with its own functions, prints it as JSON."""

# pyright: reportMissingImports=false

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from with_lerobot import HEAVY, StandIns

READING = {"datasets", "pandas", "pyarrow", "requests"}
"""What LeRobot reads with, and that reads with."""


def main(folder: Path) -> None:
    HEAVY.difference_update(READING)
    sys.meta_path.insert(0, StandIns())
    from lerobot.datasets.utils import (
        get_hf_features_from_features,
        load_episodes,
        load_info,
        load_nested_dataset,
        load_stats,
        load_tasks,
    )

    info, stats, tasks = load_info(folder), load_stats(folder), load_tasks(folder)
    features = get_hf_features_from_features(info["features"])
    rows = load_nested_dataset(folder / "data", features=features)
    episodes = load_episodes(folder)
    assert stats is not None
    document: dict[str, Any] = {
        "version": info["codebase_version"],
        "fps": info["fps"],
        "names": info["features"]["action"]["names"],
        "path": info["data_path"].format(chunk_index=0, file_index=0),
        "totals": [info["total_frames"], info["total_episodes"], info["total_tasks"]],
        "tasks": {str(name): int(row.task_index) for name, row in tasks.iterrows()},
        "episodes": [dict(row) for row in episodes],
        "action_mean": stats["action"]["mean"].tolist(),
        "state_q99": stats["observation.state"]["q99"].tolist(),
        "rows": {name: rows[name] for name in rows.column_names},
    }
    print(json.dumps(document, default=list))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
