"""The page draws the curve that the policy follows: its spline against the package's own."""

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
import { sample, shifted } from "%s";
const points = JSON.parse(process.argv[1]);
console.log(JSON.stringify([sample(points), shifted(points, 0.5), shifted(points, 0)]));
"""


@pytest.mark.skipif(NODE is None, reason="needs node to run the page's module")
def test_the_spline_of_the_page_is_that_of_the_package():
    points = np.random.default_rng(0).uniform(0.0, 1.5, curves.NUM_POINTS)
    script = SCRIPT % (PAGE / "spline.js").as_uri()
    command = [NODE, "--input-type=module", "-e", script, json.dumps(points.tolist())]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    line, later, same = map(np.array, json.loads(done.stdout))
    expected = curves.evaluate(jnp.asarray(points)[:, None], jnp.linspace(0.0, 1.0, len(line)))
    np.testing.assert_allclose(line, np.asarray(expected)[:, 0], atol=1e-5)
    np.testing.assert_allclose(same, points, atol=1e-12)
    assert (later[0], later[-1]) == pytest.approx((points[0], points[-1]))
    rising = np.linspace(0.1, 1.4, curves.NUM_POINTS)
    command[-1] = json.dumps(rising.tolist())
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (np.array(json.loads(done.stdout)[1])[1:-1] < rising[1:-1]).all()
