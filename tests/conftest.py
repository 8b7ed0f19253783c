"""The tests run on the CPU unless JAX_PLATFORMS says otherwise, and render without a display."""

import os
import sys

os.environ.setdefault("JAX_PLATFORMS", "cpu")
if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")
