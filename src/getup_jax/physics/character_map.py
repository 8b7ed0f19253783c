"""Characters whose MJCF file has other names: a YAML map beside it says which is which.

mjcf: humanoid.xml              # beside this file, or package:NAME/FOLDER/FILE.xml
bodies: {root: pelvis, ltibia: shin_l}
joints: {ltibiarx: shin_l_flex}
geoms: {lsole: foot_l}
keyframes: {stand: neutral}

Names that are not listed stay. `physics.character` takes the map in place of the MJCF file.
"""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco

from getup_jax.config import ConfigError, yaml_text
from getup_jax.config.check import shown
from getup_jax.config.registry import check_name

SUFFIX = ".yaml"
_PACKAGE = "package:"
_KINDS = ("bodies", "joints", "geoms", "keyframes")
_SPEC = {"bodies": "bodies", "joints": "joints", "geoms": "geoms", "keyframes": "keys"}


def read_mapped(path: Path) -> mujoco.MjSpec:
    """The character of a map, by the names that the code looks up.

    Raises ConfigError for a map that is wrong; the MJCF file's own errors are MuJoCo's.
    """
    content = _content(path)
    spec = mujoco.MjSpec.from_file(str(_mjcf(path, content["mjcf"])))
    for kind in _KINDS:
        names = content.get(kind) or {}
        if not isinstance(names, Mapping):
            raise ConfigError(f"{path}: {kind}: expected {{name in the file: name}}, got {names!r}")
        _rename(spec, kind, {str(old): str(new) for old, new in names.items()}, f"{path}: {kind}")
    return spec


def _content(path: Path) -> Mapping[str, Any]:
    content = yaml_text.read(path)
    if not isinstance(content, Mapping) or not isinstance(content.get("mjcf"), str):
        raise ConfigError(
            f"{path}: expected a map of a character, with mjcf: FILE.xml and names; see "
            f"docs/character.md; got {shown(content)}"
        )
    for key in content:
        check_name(str(key), ("mjcf", *_KINDS), str(path))
    return content


def _mjcf(path: Path, name: str) -> Path:
    """The MJCF file: beside the map, or in a package, which is not imported."""
    if not name.startswith(_PACKAGE):
        file = path.parent / name
    else:
        package, _, inner = name.removeprefix(_PACKAGE).partition("/")
        found = importlib.util.find_spec(package) if package.isidentifier() else None
        if found is None or not found.submodule_search_locations:
            raise ConfigError(f"{path}: mjcf: no package {package!r} is installed")
        file = Path(next(iter(found.submodule_search_locations))) / inner
    if not file.is_file():
        raise ConfigError(f"{path}: mjcf: no file {file}")
    return file


def _rename(spec: mujoco.MjSpec, kind: str, names: Mapping[str, str], where: str) -> None:
    """Give elements their new names, at once, so that two may change places."""
    elements = {x.name: x for x in getattr(spec, _SPEC[kind])}
    for old in names:
        if old not in elements:
            close = difflib.get_close_matches(old, elements, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise ConfigError(f"{where}: {old!r}: not in the file{hint}")
    after = [names.get(name, name) for name in elements if name]
    twice = sorted({name for name in after if after.count(name) > 1})
    if twice:
        raise ConfigError(f"{where}: {', '.join(twice)}: would be the name of two")
    for old in names:
        elements[old].name = f"\n{old}"  # no name of a file
    for old, new in names.items():
        elements[old].name = new
    _refer(spec, kind, names)


def _refer(spec: mujoco.MjSpec, kind: str, names: Mapping[str, str]) -> None:
    """What refers to the elements by name."""
    if kind == "joints":
        for actuator in spec.actuators:
            if actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT:
                actuator.target = names.get(actuator.target, actuator.target)
    if kind == "bodies":
        for exclude in spec.excludes:
            exclude.bodyname1 = names.get(exclude.bodyname1, exclude.bodyname1)
            exclude.bodyname2 = names.get(exclude.bodyname2, exclude.bodyname2)
    if kind == "geoms":
        for pair in spec.pairs:
            pair.geomname1 = names.get(pair.geomname1, pair.geomname1)
            pair.geomname2 = names.get(pair.geomname2, pair.geomname2)
