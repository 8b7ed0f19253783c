"""Authored motions: the public names of the keyframe files and of the library made from them."""

from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import Keyframe, KeyframeMotion, read_keyframes
from getup_jax.motion.authoring.library import load_authored
from getup_jax.motion.authoring.pose_augmentation import authored_poses

__all__ = [
    "Keyframe",
    "KeyframeMotion",
    "authored_poses",
    "clip_from_keyframes",
    "load_authored",
    "read_keyframes",
]
