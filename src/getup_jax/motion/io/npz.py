"""Arrays out of .npz files that others made: what they declare is checked before it is read."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from getup_jax.motion.clips import MotionError

_KINDS = "biufU"  # of numbers and text


class _BadArray(ValueError):
    """An array's file is not as it says."""


def read_arrays(file: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """The arrays of these names, numbers or text; others in the file are not read.

    Raises MotionError where the file is no .npz, lacks one of them, or declares another size than
    it has.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            found = [name.removesuffix(".npy") for name in archive.namelist()]
            if not set(names) <= set(found):
                raise MotionError(
                    f"{file}: not a clip: expected {sorted(names)}, or poses, trans and "
                    f"mocap_framerate of SMPL, got {sorted(found)[:20]}; import again"
                )
            return {name: _read(archive, f"{name}.npy") for name in names}
    except MotionError:
        raise
    except FileNotFoundError as error:
        raise MotionError(f"{file}: no such file") from error
    except Exception as error:  # zip and npy headers fail in many ways
        raise MotionError(
            f"{file}: not a clip: expected an .npz file of getup-motion, getup-edit or SMPL; "
            "import again"
        ) from error


def names_in(file: Path) -> tuple[str, ...]:
    """The names of the arrays in a file; MotionError where it is no .npz."""
    try:
        with zipfile.ZipFile(file) as archive:
            return tuple(name.removesuffix(".npy") for name in archive.namelist())
    except FileNotFoundError as error:
        raise MotionError(f"{file}: no such file") from error
    except Exception as error:  # zip fails in many ways
        raise MotionError(f"{file}: not a clip: expected an .npz file; save it again") from error


def _read(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(name) as stream:
        shape, dtype = _header(stream)
        size = math.prod(shape) * dtype.itemsize
        if dtype.kind not in _KINDS or stream.tell() + size != archive.getinfo(name).file_size:
            raise _BadArray(name)
    with archive.open(name) as stream:
        return npy.read_array(stream, allow_pickle=False)


def _header(stream: Any) -> tuple[tuple[int, ...], np.dtype]:
    version = npy.read_magic(stream)
    if version == (1, 0):
        shape, _, dtype = npy.read_array_header_1_0(stream)
    elif version == (2, 0):
        shape, _, dtype = npy.read_array_header_2_0(stream)
    else:  # for records with names in other scripts
        raise _BadArray(str(version))
    if min(shape, default=0) < 0:
        raise _BadArray(str(shape))
    return shape, dtype
