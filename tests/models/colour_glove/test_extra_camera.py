"""Who only calibrates data gloves pays nothing for the camera: libraries load on demand."""

import subprocess
import sys

PROGRAM = """
import sys, glovecal
loaded = {"numba", "cv2", "skimage", "glovecal_models.colour_glove"} & set(sys.modules)
assert not loaded, loaded
"""


def test_importing_glovecal_loads_nothing_of_the_camera():
    subprocess.run([sys.executable, "-c", PROGRAM], check=True, timeout=60)
