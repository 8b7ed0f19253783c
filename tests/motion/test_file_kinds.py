"""Files as exporters write them: each kind gives the clip of the plain file, or one clear line."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bvh_samples import (
    BASE,
    FRAMES,
    HEADER,
    MOTION,
    ROWS,
    TIMING,
    body_of,
    human_bvh,
    imported,
    with_rows,
    write,
)

from getup_jax.motion.io.bvh import Y_UP
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.io.readers import read_motion
from getup_jax.motion.io.recording import turned
from getup_jax.motion.retarget.identify import identify

PROP = "ROOT Sword\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\n"
KEYWORD = re.compile(r"^\s*(HIERARCHY|ROOT|JOINT|OFFSET|CHANNELS|End Site|MOTION|Frame\w*)", re.M)


def in_pieces(row):
    words = row.split()
    return "\n".join(" ".join(words[i : i + 7]) for i in range(0, len(words), 7))


def spine(name, encoding):
    """The file with a vertebra of that name."""
    return BASE.replace("Spine1", name).encode(encoding)


AS_BASE = {
    "UTF-8 with a mark": BASE.encode("utf-8-sig"),
    "UTF-16": BASE.encode("utf-16"),
    "UTF-16, big endian": b"\xfe\xff" + BASE.encode("utf-16-be"),
    "UTF-16 without a mark": BASE.encode("utf-16-le"),
    "UTF-16 without a mark, big endian": BASE.encode("utf-16-be"),
    "UTF-32": BASE.encode("utf-32"),
    "a name in UTF-8": spine("Wirbelsäule", "utf-8"),
    "a name in Latin-1": spine("Wirbelsäule", "latin-1"),
    "a name of two accents in Latin-1": spine("Größe", "latin-1"),
    "a name in cp1252": spine("Dos…1", "cp1252"),
    "a name in Mac Roman": spine("Épine", "mac-roman"),
    "a name in Shift-JIS that holds a brace": spine("背骨ボーン", "cp932"),
    "a name in GBK": spine("脊柱骨", "gbk"),
    "a head with a name of its own": BASE.replace("JOINT Head", "JOINT Kopf").encode("latin-1"),
    "CR and LF": BASE.replace("\n", "\r\n"),
    "CR alone": BASE.replace("\n", "\r"),
    "NULs at the end": BASE + "\0" * 300,
    "a comment of NULs at the end": BASE + "# \0",
    "Control-Z at the end": BASE + "\x1a",
    "Control-Z and the rest of a block": BASE + "\x1arest of an older file 1 2 3\n",
    "a comment before": "# made by hand\n" + BASE,
    "other comments before": "// made by hand\n; and edited\n" + BASE,
    "comments behind lines": BASE.replace("rotation\n", "rotation  # degrees\n"),
    "a comment after": BASE + "# end\n",
    "words after the last row": BASE + "END\nof the file\n",
    "blank lines before": "\n\n" + BASE,
    "blank lines everywhere": BASE.replace("\n", "\n \t\n"),
    "keywords in lower case": KEYWORD.sub(lambda m: m[0].lower(), BASE),
    "keywords in upper case": KEYWORD.sub(lambda m: m[0].upper(), BASE),
    "channels in lower case": BASE.replace("Xrot", "xrot").replace("Yposition", "yposition"),
    "channels in upper case": BASE.replace("Zrotation", "ZROTATION"),
    "Motion": BASE.replace("HIERARCHY", "Hierarchy").replace("MOTION", "Motion"),
    "MOTION:": BASE.replace("MOTION", "MOTION:"),
    "EndSite": BASE.replace("End Site", "EndSite"),
    "End site": BASE.replace("End Site", "End site"),
    "End Sites with names": BASE.replace("End Site", "End Site LeftToe_End"),
    "End Sites that are joints": BASE.replace("OFFSET 0 5 0", "OFFSET 0 5 0\nCHANNELS 0"),
    "braces behind names": re.sub(r"\n\t*{", " {", BASE),
    "braces glued to names": re.sub(r"\n\t*{", "{", BASE),
    "closing braces in one line": re.sub(r"}\s*(?=})", "} ", BASE),
    "a header in one line": HEADER.replace("\n", " ") + "\nMOTION\n" + MOTION,
    "everything but rows in one line": BASE.removesuffix(ROWS).replace("\n", " ") + "\n" + ROWS,
    "values below their keywords": BASE.replace("OFFSET ", "OFFSET\n").replace("3 Z", "3\nZ"),
    "names in quotes": re.sub(r"(ROOT|JOINT) (\w+)", r'\1 "\2"', BASE),
    "tabs": BASE.replace(" ", "\t"),
    "spaces": BASE.replace("\t", "  "),
    "no colons": BASE.replace("Frames:", "Frames").replace("Time:", "Time"),
    "spaces before colons": BASE.replace("Frames:", "Frames :").replace("Time:", "Time :"),
    "nothing behind colons": BASE.replace("Frames: ", "Frames:").replace("Time: ", "Time:"),
    "FrameTime": BASE.replace("Frame Time:", "FrameTime:"),
    "frame time first": BASE.replace(TIMING, "\n".join(TIMING.splitlines()[::-1]) + "\n"),
    "both in one line": BASE.replace(TIMING, TIMING.replace("\n", " ") + "\n"),
    "exponents": BASE.replace("10.000000", "1.0e+01").replace("12.000000", "1.2E1"),
    "rows over several lines": with_rows(HEADER, in_pieces),
    "all rows in one line": BASE.removesuffix(ROWS) + ROWS.replace("\n", " "),
    "a second ROOT": with_rows(HEADER + PROP, "{} 1 2 3".format),
    "a ROOT before": with_rows(HEADER.replace("ROOT", PROP + "ROOT", 1), "1 2 3 {}".format),
    "position channels without OFFSETs": human_bvh(places="bones"),
    "position channels of nothing": human_bvh(places="zero"),
}


@pytest.mark.parametrize("kind", AS_BASE)
def test_a_file_of_another_form_has_the_same_motion(tmp_path, kind):
    found, fps = body_of(write(tmp_path, AS_BASE[kind]))
    expected, base_fps = body_of(write(tmp_path, BASE))
    assert fps == base_fps
    assert found.keys() == expected.keys()
    for link, values in expected.items():
        np.testing.assert_allclose(found[link], values, atol=1e-5)


WITH_A_WARNING = {
    "words after the last row": "line 145: 'END' is behind the last row, and not read",
    "a second ROOT": r"only the skeleton under ROOT Hips is used; left out: Sword \(1 joints\)",
    "a ROOT before": r"only the skeleton under ROOT Hips is used; left out: Sword \(1 joints\)",
    "position channels of nothing": "position channels of Spine, Spine1, .* taken to add to them",
}


@pytest.mark.parametrize("kind", WITH_A_WARNING)
def test_what_is_left_out_or_guessed_is_said(tmp_path, kind):
    recording, _ = identify(read_motion(write(tmp_path, AS_BASE[kind])))
    assert re.search(WITH_A_WARNING[kind], "\n".join(recording.warnings))


@pytest.mark.parametrize(
    "prefix",
    [
        *("mixamorig:", "mixamorig1:", "mixamorig_", "mixamorig", "Character1_", "Robot_"),
        *("scene:robot:", "Armature|", "/rig/", "Bip01_", "J_Bip_", "CC_Base_", "rig-", "R_"),
    ],
)
def test_a_prefix_of_all_joints_is_no_part_of_their_names(tmp_path, prefix):
    found, _ = body_of(write(tmp_path, human_bvh(rename=lambda name: prefix + name)))
    expected, _ = body_of(write(tmp_path, BASE))
    assert found.keys() == expected.keys()
    for link, values in expected.items():
        np.testing.assert_array_equal(found[link], values)


BIPED = {"Hips": "", "UpLeg": "Thigh", "Leg": "Calf", "Shoulder": "Clavicle", "Toe": "Toe0"}
VROID = {"Hips": "C_Hips", "UpLeg": "UpperLeg", "Leg": "LowerLeg", "ForeArm": "LowerArm"}
DAZ = {"Hips": "hip", "UpLeg": "Thigh", "Leg": "Shin", "Shoulder": "Collar", "Arm": "Shldr"}
XSENS = {"UpLeg": "Hip", "Leg": "Knee", "Foot": "Ankle", "Shoulder": "Collar", "Arm": "Shoulder"}


def called(names, prefix, left, right):
    """What a rig calls the joints: sides and limbs in its own words."""

    def rename(name):
        side = {"L": left, "R": right}[name[0]] if name.startswith(("Left", "Right")) else ""
        limb = name.removeprefix("Left").removeprefix("Right")
        return f"{prefix}{side}{names.get(limb, limb)}".strip()

    return rename


@pytest.mark.parametrize(
    "rename",
    [
        called(BIPED, "Bip001 ", "L ", "R "),
        called(BIPED, "Bip01_", "L_", "R_"),
        called(VROID, "J_Bip_", "L_", "R_"),
        called(DAZ, "", "l", "r"),
        called(XSENS, "", "Left", "Right"),
        str.lower,
    ],
    ids=["3ds Max", "3ds Max with underscores", "VRoid", "Daz", "Xsens", "lower case"],
)
def test_rigs_with_words_of_their_own(tmp_path, rename):
    found, _ = body_of(write(tmp_path, human_bvh(rename=rename)))
    expected, _ = body_of(write(tmp_path, BASE))
    assert found.keys() == expected.keys()
    for link, values in expected.items():
        np.testing.assert_array_equal(found[link], values)


def upright(tmp_path):
    """The file with Z up, as our own axes are."""
    write_bvh(turned(read_motion(write(tmp_path, BASE)), Y_UP), tmp_path / "z.bvh")
    return (tmp_path / "z.bvh").read_bytes()


def test_other_forms_end_in_the_same_clip_with_exit_code_0(tmp_path, character, cache):
    code, base, entry = imported(tmp_path, character, BASE)
    assert (code, entry["warnings"][:-1], len(base.qpos)) == (0, [], FRAMES)
    for content in (
        AS_BASE["UTF-16"],
        AS_BASE["a second ROOT"],
        human_bvh(rename=called(BIPED, "Bip001 ", "L ", "R ")),
        human_bvh(places="zero"),
        upright(tmp_path),
    ):
        code, clip, entry = imported(tmp_path, character, content)
        assert (code, entry["errors"]) == (0, [])
        np.testing.assert_allclose(clip.qpos, base.qpos, atol=1e-4)
