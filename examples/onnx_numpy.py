"""A policy gets the character up with NumPy, MuJoCo and onnxruntime alone.

getup-export flat --onnx flat.onnx; python examples/onnx_numpy.py flat.onnx
"""

import argparse
import json
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime

parser = argparse.ArgumentParser(description="Let an exported policy get up.")
parser.add_argument("policy", type=Path, help="a file of getup-export --onnx")
parser.add_argument("--style", help="one of the styles that are in it (default: the first one)")
args = parser.parse_args()
policy, observe, start = (
    onnxruntime.InferenceSession(args.policy.with_name(f"{args.policy.stem}{name}.onnx"))
    for name in ("", "_observation", "_start")
)
facts = json.loads(policy.get_modelmeta().custom_metadata_map["getup_jax"])
styles = {name: style for name, style in facts["styles"].items() if style["start"]}
if args.style not in (None, *styles):
    parser.error(f"--style: expected one of {', '.join(styles)}, got {args.style}")
style = styles[args.style or next(iter(styles))]
model = mujoco.MjModel.from_xml_path(str(args.policy.with_suffix(".xml")))
data = mujoco.MjData(model)
data.qpos[:] = style["start"]
data.ctrl[:] = data.qpos[7:]
mujoco.mj_step(model, data, nstep=facts["substeps"] * facts["control_hz"] // 2)  # settle


def run(session: onnxruntime.InferenceSession, **values: object) -> list[np.ndarray]:
    """The results of a graph, whose arguments have a leading axis of one character."""
    return session.run(None, {k: np.asarray(v, np.float32)[None] for k, v in values.items()})


curve = {"points": style["points"], "duration": style["duration"]}
(action,) = run(start, qpos=data.qpos, time=0.0, **curve)
steps = round((style["duration"] + facts["stand_time_s"]) * facts["control_hz"])
for step in range(steps):
    state = {"qpos": data.qpos, "qvel": data.qvel, "ground": np.zeros(25), "action": action[0]}
    (observation,) = run(observe, **state, time=step / facts["control_hz"], **curve)
    target, action = run(policy, observation=observation[0])
    data.ctrl[:] = target[0]
    mujoco.mj_step(model, data, nstep=facts["substeps"])
print(f"the pelvis is {data.qpos[2]:.2f} m above the floor after {steps} steps")
