"""``python3 do.py bench``: Glovecal beside its peers, in one run, as ratios.

Two parts: Gaussian-process training and prediction against scikit-learn, GPy, GPyTorch and GPBoost, and
capture to pose through real zenoh. Each can be run alone: ``bench.py gaussian_process`` or ``streaming``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
PARTS = {"gaussian_process": "gaussian_process_bench.py", "streaming": "streaming_bench.py"}
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def main(arguments: list[str]) -> int:
    chosen = [argument for argument in arguments if argument in PARTS] or list(PARTS)
    options = [argument for argument in arguments if argument not in PARTS]
    codes = []
    for part in chosen:
        print(f"== {part.replace('_', ' ')} ==", flush=True)
        command = [sys.executable, str(HERE / PARTS[part]), *options]
        codes.append(subprocess.run(command, env={**os.environ, **ONE_THREAD}).returncode)
    return max(codes)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
