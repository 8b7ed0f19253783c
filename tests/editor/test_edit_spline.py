"""The page draws the curve that the policy follows: its splines against the package's own."""

from __future__ import annotations

import json
import shutil
import subprocess

import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.editor.site import PAGE
from getup_jax.motion.getup import curves

NODE = shutil.which("node")
SCRIPT = """
import { sample } from "%s";
import { drawn, keysOf } from "%s";
const points = JSON.parse(process.argv[1]);
console.log(JSON.stringify([sample(points), drawn(keysOf(points))]));
"""


@pytest.mark.skipif(NODE is None, reason="needs node to run the page's module")
def test_the_curves_of_the_page_are_those_of_the_package():
    points = np.random.default_rng(0).uniform(0.0, 1.5, curves.NUM_POINTS)
    script = SCRIPT % tuple((PAGE / name).as_uri() for name in ("spline.js", "keys.js"))
    command = [NODE, "--input-type=module", "-e", script, json.dumps(points.tolist())]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    line, keyed = map(np.array, json.loads(done.stdout))
    expected = curves.evaluate(jnp.asarray(points)[:, None], jnp.linspace(0.0, 1.0, len(line)))
    np.testing.assert_allclose(line, np.asarray(expected)[:, 0], atol=1e-5)
    np.testing.assert_allclose(keyed, line, atol=1e-9)
