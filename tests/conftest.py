"""The tests run on the CPU unless JAX_PLATFORMS says otherwise, and render without a display.

Most of their time is XLA's, which compiles more than twice as fast without optimisations of its
code generator; `XLA_FLAGS= make test` runs what users run.
"""

import os
import sys

os.environ.setdefault("JAX_PLATFORMS", "cpu")
if os.environ["JAX_PLATFORMS"] == "cpu":
    quick = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
    os.environ.setdefault("XLA_FLAGS", quick)
if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")
