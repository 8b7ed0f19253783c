"""Which of Bohannon and Lusardi's strategies a get-up follows [P 6.2, figure 8].

The rules look at how the body lies when it leaves the floor, and at three phases after that:

    sitting    pelvis on the floor, trunk upright
    all fours  hands on the floor, pelvis raised, front facing down
    kneeling   one knee on the floor, the other up, trunk not facing down

    lies supine   sitting, then all fours    sit-up and roll-over
    lies supine   sitting, then kneeling     side-sit to half-kneel pivot
    lies aside    sitting                    side-sit to half-kneel pivot
    any           all fours, no sitting      quadruped push-up, supine or prone as it lies
    any           kneeling alone             side-sit to half-kneel pivot
    any           anything else              other (such as from sitting into a squat)
"""

from __future__ import annotations

import dataclasses

import numpy as np

from getup_jax.physics.character import CharacterSpec

SIT_UP = "sit-up and roll-over"
SIDE_SIT = "side-sit to half-kneel pivot"
SUPINE_PUSH_UP = "supine quadruped push-up"
PRONE_PUSH_UP = "prone quadruped push-up"
OTHER = "other"
STRATEGIES = (SUPINE_PUSH_UP, PRONE_PUSH_UP, SIT_UP, SIDE_SIT, OTHER)


@dataclasses.dataclass(frozen=True)
class StrategySettings:
    """Limits of the phases: shares of the neutral pelvis height, cosines, seconds."""

    seat: float = 0.25  # sitting: pelvis below this share ...
    sit_upright: float = 0.6  # ... and the cosine of the trunk to up above this
    raised: float = 0.3  # all fours: pelvis above this share ...
    face_down: float = 0.6  # ... and the cosine of the front to down above this
    aside: float = 0.6  # lying supine: cosine of the front to up above this
    floor: float = 0.05  # it leaves the floor when the neck is this share above its lowest
    touch: float = 0.14  # a hand or knee below this share of the pelvis height touches the floor
    knee_up: float = 0.35  # kneeling: the other knee above this share
    hold_s: float = 0.1  # a phase that is shorter does not count


def classify(
    positions: np.ndarray,
    fps: float,
    character: CharacterSpec,
    settings: StrategySettings = StrategySettings(),
) -> str:
    """The strategy of a get-up given as joint centres [F, L, 3] (m) over flat ground."""
    neck = positions[:, character.link("neck"), 2]
    leaves = np.flatnonzero(neck <= neck.min() + settings.floor * character.neutral_qpos[2])[-1]
    phases = find_phases(positions[leaves:], character, settings)
    hold = max(1, round(settings.hold_s * fps))
    sits, fours, kneels = (phases[name].sum() >= hold for name in ("sit", "fours", "kneel"))
    if sits and fours:  # sitting back from all fours is no sitting up
        sits = np.argmax(phases["sit"]) < np.argmax(phases["fours"])
    front_up = phases["front_up"][0]
    if sits and front_up < settings.aside:
        return SIDE_SIT
    if sits:
        return SIT_UP if fours else SIDE_SIT if kneels else OTHER
    if fours:
        return SUPINE_PUSH_UP if front_up > 0 else PRONE_PUSH_UP
    return SIDE_SIT if kneels else OTHER


def find_phases(
    positions: np.ndarray, character: CharacterSpec, settings: StrategySettings
) -> dict[str, np.ndarray]:
    """Masks [F] of the phases and the cosine `front_up` [F] between front and up."""

    def at(*names: str) -> np.ndarray:
        return positions[:, character.links(names)]

    hips, neck = at("thigh_l", "thigh_r"), at("neck")[:, 0]
    spine, side = neck - hips.mean(axis=1), hips[:, 1] - hips[:, 0]
    trunk_up, front_up = _up(spine), _up(np.cross(spine, side))
    size = character.neutral_qpos[2]
    pelvis = at("pelvis")[:, 0, 2] / size
    hands = at("hand_l", "hand_r")[..., 2] / size
    knees = at("shin_l", "shin_r")[..., 2] / size
    facing_down = front_up < -settings.face_down
    low_knee, high_knee = knees.min(axis=1), knees.max(axis=1)
    kneeling = (low_knee < settings.touch) & (high_knee > settings.knee_up) & ~facing_down
    return {
        "sit": (pelvis < settings.seat) & (trunk_up > settings.sit_upright),
        "fours": facing_down & (pelvis > settings.raised) & (hands.min(axis=1) < settings.touch),
        "kneel": kneeling & (pelvis > settings.raised),
        "front_up": front_up,
    }


def _up(vectors: np.ndarray) -> np.ndarray:
    """Cosine between vectors [F, 3] and up."""
    return vectors[:, 2] / np.maximum(np.linalg.norm(vectors, axis=-1), 1e-9)
