from __future__ import annotations

import dataclasses

import numpy as np
from ground_samples import TERRAIN, make_site

from getup_jax.config import PhysicsConfig
from getup_jax.envs.getup.resets.cache import Request, cached_starts, fingerprint
from getup_jax.envs.getup.resets.lying import Starts

REQUEST = Request("falls", 2, 0)


class Maker:
    """Makes starts and counts how often."""

    def __init__(self, width: int = 56) -> None:
        self.calls, self.width = 0, width

    def __call__(self, request, log):
        self.calls += 1
        number = float(self.calls)
        size = (request.count, self.width)
        return Starts(np.full(size, number), np.full((2, 55), number), np.array([1, 2]))


def get(site, make, folder, log, request=REQUEST):
    return cached_starts(request, site.character, make, folder, log.append)


def test_starts_are_made_once(site, tmp_path):
    make, log = Maker(), []
    first, second = get(site, make, tmp_path, log), get(site, make, tmp_path, log)
    assert make.calls == 1
    for name in ("qpos", "qvel", "region"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert not log


def test_another_count_or_seed_is_another_file(site, tmp_path):
    make, log = Maker(), []
    for request in (REQUEST, Request("falls", 2, 1), Request("falls", 3, 0)):
        get(site, make, tmp_path, log, request)
    assert make.calls == 3


def test_the_hash_is_of_the_model_with_its_ground(site):
    again = make_site(PhysicsConfig(engine="native"))
    rougher = make_site(
        PhysicsConfig(engine="native"), dataclasses.replace(TERRAIN, rough_m=(0.0, 0.1, 0.2))
    )
    stiffer = make_site(PhysicsConfig(engine="native", gain_scale=2.0))
    keys = [fingerprint(REQUEST, s.character) for s in (site, again, rougher, stiffer)]
    assert keys[0] == keys[1]
    assert len(set(keys)) == 3


def test_a_file_of_another_model_is_made_again(site, tmp_path):
    make, log = Maker(), []
    get(site, make, tmp_path, log)
    (file,) = tmp_path.glob("*.npz")
    with np.load(file) as data:
        np.savez(file, **{**data, "key": "of another model"})
    get(site, make, tmp_path, log)
    assert make.calls == 2
    assert "made again (it belongs to another model" in log[0]


def test_a_damaged_file_is_made_again(site, tmp_path):
    make, log = Maker(), []
    get(site, make, tmp_path, log)
    (file,) = tmp_path.glob("*.npz")
    file.write_bytes(file.read_bytes()[:200])
    get(site, make, tmp_path, log)
    assert make.calls == 2
    assert "made again" in log[0]
