from __future__ import annotations

import sys

import numpy as np
import pytest

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.evaluation import film, turntable
from getup_jax.physics.character import load_character


@pytest.fixture(scope="module")
def sheet(request) -> np.ndarray:
    """Of a body that stands and then is gone."""
    character = load_character(PhysicsConfig())
    qpos = np.tile(character.neutral_qpos, (9, 1))
    qpos[5:, 2] += 50.0
    try:
        return turntable.sheet(character.model, qpos)
    except ConfigError as error:
        pytest.skip(str(error))


def stills(sheet: np.ndarray) -> np.ndarray:
    """[moments, directions, rows, columns, 3]."""
    rows, columns = turntable.SIZE
    parts = sheet.reshape(turntable.MOMENTS, rows, turntable.DIRECTIONS, columns, 3)
    return parts.transpose(0, 2, 1, 3, 4).astype(int)


def test_rows_are_moments_and_columns_directions(sheet):
    found = stills(sheet)
    first, last = found[0], found[-1]
    for direction in range(turntable.DIRECTIONS):
        assert np.abs(first[direction] - last[direction]).max() > 30  # there, and gone
        assert np.abs(first[direction] - found[1, direction]).mean() < 0.5  # it stands still
    for direction in range(1, turntable.DIRECTIONS):
        assert np.abs(first[0] - first[direction]).mean() > 0.5


def test_a_file_is_written(tmp_path, monkeypatch):
    imageio = pytest.importorskip("imageio.v2")
    monkeypatch.setattr(film, "require", lambda _: imageio)
    picture = np.arange(8 * 8 * 3, dtype=np.uint8).reshape(8, 8, 3)
    monkeypatch.setattr(turntable, "sheet", lambda model, qpos: picture)
    character = load_character(PhysicsConfig())
    turntable.write_turntable(tmp_path / "a.png", character.model, character.neutral_qpos[None])
    assert np.array_equal(imageio.imread(tmp_path / "a.png"), picture)


def test_without_the_library_the_error_names_the_option(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio.v2", None)
    with pytest.raises(ConfigError, match=r"--turntable: needs imageio"):
        film.require("--turntable")
