"""``python3 do.py bench``: Glovecal beside its peers, in one run, as ratios.

Nine parts: Gaussian-process training and prediction against scikit-learn, GPy, GPyTorch and GPBoost, capture
to pose through real zenoh, the same with a site's certificates beside one without, inverse kinematics against
mink, the studio's Live page in a browser, live bridges, retargeting to skeletons like those of other
programs, lists of a store that is large, and what improving takes. Figures and the picture go to a folder.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent
PARTS = {
    "gaussian-process": "gaussian_process_bench.py",
    "streaming": "streaming_bench.py",
    "certificates": "certificates_bench.py",
    "inverse-kinematics": "inverse_kinematics_bench.py",
    "studio": "studio_bench.py",
    "bridges": "bridges_bench.py",
    "retargeting": "retargeting_table.py",
    "lists": "lists_bench.py",
    "capacity": "capacity_bench.py",
    "improvement": "improvement_bench.py",
}
USUAL = tuple(
    name
    for name in PARTS
    if name not in ("certificates", "studio", "bridges", "retargeting", "lists", "capacity", "improvement")
)
"""The first three want a quiet computer, the studio a browser too; the last four have no peer."""
OF_STREAMING = ("gloves", "people", "processes", "recordings", "seconds")
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"{' or '.join(PARTS)}; default: {', '.join(USUAL)}"
    )
    parser.add_argument("--quick", action="store_true", help="fewer frames, shorter runs")
    parser.add_argument("--smoke", action="store_true", help="tiny runs, in a temporary folder unless named")
    parser.add_argument("--gloves", help="of streaming: only so many gloves with effects, such as 16,32,64")
    parser.add_argument("--people", help="of streaming with --gloves: who have a model each; default 8")
    parser.add_argument("--processes", help="of streaming with --gloves: that predict; default 1")
    parser.add_argument("--recordings", help="of streaming with --gloves: begun a second meanwhile")
    parser.add_argument("--seconds", help="of streaming with --gloves: length of a run")
    parser.add_argument("--minutes", help="of studio: how long the growth of a page is watched")
    parser.add_argument("--bridge", action="append", help="of bridges: only this one; repeatable")
    parser.add_argument("--page", help="of capacity: put the figures between their marks in this page")
    parser.add_argument("--folder", type=Path, help="for figures and picture; default .bench")
    options = parser.parse_args()
    unknown = sorted(set(options.parts) - set(PARTS))
    if unknown:
        parser.error(f"there is no part {unknown[0]!r}; there are {', '.join(PARTS)}")
    with TemporaryDirectory(prefix="glovecal-bench-") as temporary:
        folder = options.folder or Path(temporary if options.smoke else ".bench")
        folder.mkdir(parents=True, exist_ok=True)
        return max(_run(part, folder, options) for part in options.parts or USUAL)


def _run(part: str, folder: Path, options: argparse.Namespace) -> int:
    print(f"\n== {part} ==", flush=True)
    command = [sys.executable, str(HERE / PARTS[part]), "--json", str(folder / f"{part}.json")]
    command += [f"--{name}" for name in ("quick", "smoke") if getattr(options, name)]
    if part == "gaussian-process":
        command += ["--picture", str(folder / f"{part}.png")]
    if part == "streaming":
        command += [f"--{name}={value}" for name in OF_STREAMING if (value := vars(options)[name])]
    if part == "studio" and options.minutes:
        command += [f"--minutes={options.minutes}"]
    if part == "capacity" and options.page:
        command += [f"--page={options.page}"]
    if part == "bridges":
        command += [f"--bridge={name}" for name in options.bridge or ()]
    return subprocess.run(command, env={**os.environ, **ONE_THREAD}).returncode


if __name__ == "__main__":
    sys.exit(main())
