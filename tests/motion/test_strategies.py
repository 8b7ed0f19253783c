from __future__ import annotations

import numpy as np
import pytest

from getup_jax.motion.getup import strategies

LINKS = ("thigh_l", "thigh_r", "neck", "pelvis", "hand_l", "hand_r", "shin_l", "shin_r")
SIZE = 0.92

# Joint centres (m) of coarse poses: x forward of the feet, y left, z up.
SUPINE = {"pelvis": (0, 0, 0.1), "neck": (-0.5, 0, 0.12), "hand": 0.1, "knee": (0.1, 0.1)}
PRONE = {"pelvis": (0, 0, 0.1), "neck": (0.5, 0, 0.12), "hand": 0.1, "knee": (0.1, 0.1)}
SITTING = {"pelvis": (0, 0, 0.1), "neck": (-0.1, 0, 0.6), "hand": 0.3, "knee": (0.1, 0.1)}
ALL_FOURS = {"pelvis": (0, 0, 0.45), "neck": (0.5, 0, 0.4), "hand": 0.08, "knee": (0.08, 0.08)}
KNEELING = {"pelvis": (0, 0, 0.5), "neck": (0.1, 0, 1.0), "hand": 0.5, "knee": (0.08, 0.5)}
STANDING = {"pelvis": (0, 0, 0.92), "neck": (0, 0, 1.45), "hand": 0.8, "knee": (0.5, 0.5)}
ASIDE = {"aside": True, **SUPINE}


class Character:
    """As much of a character as the rules need."""

    neutral_qpos = np.array([0, 0, SIZE])

    def link(self, name):
        return LINKS.index(name)

    def links(self, names):
        return [self.link(name) for name in names]


def pose(what):
    place = np.zeros((len(LINKS), 3))
    pelvis = np.array(what["pelvis"], float)
    side = (0, 0, 0.09) if what.get("aside") else (0, 0.09, 0)
    place[0], place[1] = pelvis + side, pelvis - side
    place[2], place[3] = what["neck"], pelvis
    place[4:6, 2] = what["hand"]
    place[6, 2], place[7, 2] = what["knee"]
    return place


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        ((PRONE, ALL_FOURS, STANDING), strategies.PRONE_PUSH_UP),
        ((SUPINE, ALL_FOURS, STANDING), strategies.SUPINE_PUSH_UP),
        ((SUPINE, SITTING, ALL_FOURS, STANDING), strategies.SIT_UP),
        ((SUPINE, SITTING, KNEELING, STANDING), strategies.SIDE_SIT),
        ((ASIDE, SITTING, ALL_FOURS, STANDING), strategies.SIDE_SIT),
        ((SUPINE, KNEELING, STANDING), strategies.SIDE_SIT),
        ((SUPINE, SITTING, STANDING), strategies.OTHER),
        ((SITTING, PRONE, ALL_FOURS, STANDING), strategies.PRONE_PUSH_UP),
    ],
)
def test_a_strategy_is_the_order_of_its_phases(phases, expected):
    positions = np.concatenate([np.tile(pose(phase), (10, 1, 1)) for phase in phases])
    assert strategies.classify(positions, 30.0, Character()) == expected


def test_a_phase_of_one_frame_does_not_count():
    frames = [SUPINE] * 10 + [SITTING] + [ALL_FOURS] * 10 + [STANDING] * 5
    positions = np.stack([pose(frame) for frame in frames])
    assert strategies.classify(positions, 30.0, Character()) == strategies.SUPINE_PUSH_UP
