"""Characters whose MJCF file has other names: a YAML map beside it says which is which.

mjcf: humanoid.xml              # beside this file, or package:NAME/FOLDER/FILE.xml
bodies: {root: pelvis, ltibia: shin_l}
joints: {ltibiarx: shin_l_flex}
geoms: {lsole: foot_l}
keyframes: {stand: neutral}
root: pelvis                    # where the file's free body is another one, by its name there
add: ...                        # what the file lacks, by our names: see character_additions.py
servos: ...
neutral: ...

Names that are not listed stay. `physics.character` takes the map in place of the MJCF file.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco

from getup_jax.config import ConfigError, yaml_text
from getup_jax.config.check import did_you_mean, shown
from getup_jax.config.registry import check_name
from getup_jax.physics.character_additions import ADDITIONS, add_what_lacks
from getup_jax.physics.reroot import rerooted

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
    if (root := content.get("root")) is not None:
        spec = rerooted(spec, str(root), str(path))
    for kind in _KINDS:
        names = content.get(kind) or {}
        if not isinstance(names, Mapping):
            raise ConfigError(f"{path}: {kind}: expected {{name in the file: name}}, got {names!r}")
        _rename(spec, kind, {str(old): str(new) for old, new in names.items()}, f"{path}: {kind}")
    add_what_lacks(spec, content, str(path))
    return spec


def _content(path: Path) -> Mapping[str, Any]:
    content = yaml_text.read(path)
    if not isinstance(content, Mapping) or not isinstance(content.get("mjcf"), str):
        raise ConfigError(
            f"{path}: expected a map of a character, with mjcf: FILE.xml and names; see "
            f"docs/character.md; got {shown(content)}"
        )
    for key in content:
        check_name(str(key), ("mjcf", "root", *_KINDS, *ADDITIONS), str(path))
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
            hint = did_you_mean(old, elements, "; ")
            raise ConfigError(f"{where}: {old!r}: not in the file{hint}")
    after = [names.get(name, name) for name in elements if name]
    twice = sorted({name for name in after if after.count(name) > 1})
    if twice:
        raise ConfigError(f"{where}: {', '.join(twice)}: would be the name of two")
    if kind in ("joints", "geoms"):
        _without_tendons(spec, where)
    for old in names:
        elements[old].name = f"\n{old}"  # no name of a file
    for old, new in names.items():
        elements[old].name = new
    _refer(spec, kind, names)


def _without_tendons(spec: mujoco.MjSpec, where: str) -> None:
    """Take out tendons that only measure; their joints cannot get other names."""
    for tendon in list(spec.tendons):
        forces = (*tendon.stiffness, *tendon.damping, tendon.frictionloss, *tendon.range)
        if any(forces):
            raise ConfigError(
                f"{where}: tendon {tendon.name!r} pulls at joints; what it does is lost with other "
                "names; take it out of a copy of the file"
            )
        spec.delete(tendon)


_OBJ, _EQ = mujoco.mjtObj, mujoco.mjtEq
# What refers to an element by name: list of the spec, field with the name, field with the kind of
# what it names, and the kinds that are meant here.
_REFERENCES: dict[str, tuple[tuple[str, str, str, tuple], ...]] = {
    "joints": (
        ("actuators", "target", "trntype", (mujoco.mjtTrn.mjTRN_JOINT,)),
        *(("equalities", f"name{k}", "type", (_EQ.mjEQ_JOINT,)) for k in (1, 2)),
        ("sensors", "objname", "objtype", (_OBJ.mjOBJ_JOINT,)),
    ),
    "bodies": (
        *(("excludes", f"bodyname{k}", "", ()) for k in (1, 2)),
        *(("equalities", f"name{k}", "objtype", (_OBJ.mjOBJ_BODY,)) for k in (1, 2)),
        ("sensors", "objname", "objtype", (_OBJ.mjOBJ_BODY, _OBJ.mjOBJ_XBODY)),
        ("sensors", "refname", "reftype", (_OBJ.mjOBJ_BODY, _OBJ.mjOBJ_XBODY)),
        ("cameras", "targetbody", "", ()),
        ("lights", "targetbody", "", ()),
    ),
    "geoms": (
        *(("pairs", f"geomname{k}", "", ()) for k in (1, 2)),
        ("sensors", "objname", "objtype", (_OBJ.mjOBJ_GEOM,)),
        ("sensors", "refname", "reftype", (_OBJ.mjOBJ_GEOM,)),
    ),
    "keyframes": (),
}


def _refer(spec: mujoco.MjSpec, kind: str, names: Mapping[str, str]) -> None:
    """Give the new names to what refers to the elements."""
    for group, field, kind_field, kinds in _REFERENCES[kind]:
        for element in getattr(spec, group):
            if not kind_field or getattr(element, kind_field) in kinds:
                old = getattr(element, field)
                setattr(element, field, names.get(old, old))
