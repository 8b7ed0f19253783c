"""A policy that gets up as ONNX, for programs without JAX or this package.

    getup-export flat --onnx flat.onnx

writes flat.onnx (observation to servo targets), flat_observation.onnx (a state to the
observation), flat_start.onnx (a pose to the first action of the filter) and flat.xml, the MuJoCo
model; see `onnx_graphs.py`. What else is needed, such as rates, joints and curves, is JSON in the
metadata of flat.onnx, under the key `getup_jax`. See docs/onnx.md.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax import __version__
from getup_jax.config import ConfigError
from getup_jax.core.output_file import write_bytes, write_text
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.build import make_task
from getup_jax.evaluation.getup import evaluation_config, restore_policy
from getup_jax.evaluation.scenario import Scenario
from getup_jax.motion.library import load_motions
from getup_jax.physics.character import load_character
from getup_jax.physics.model_file import character_xml
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.release.onnx_graphs import Graph, PolicyParts, graphs
from getup_jax.runtime import checkpoint
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.extras import load_extra

METADATA = "getup_jax"
_OPSET = 21


def export_onnx(source: str | Path, file: Path) -> list[Path]:
    """Write the graphs and the model beside `file`; gives the files.

    Raises ConfigError for a policy of composite motion, whose observations have goals in them, and
    where the extra `onnx` is missing; CheckpointError where there is no such policy.
    """
    load_extra("jax2onnx", "onnx", "--onnx")
    loaded = checkpoint.load_policy(source)
    if loaded.config.composite_motion:
        raise ConfigError(
            f"--onnx: expected a policy that gets up, {loaded.path} is of composite motion"
        )
    parts = policy_parts(loaded)
    files = []
    for name, graph in graphs(parts).items():
        model = to_onnx(name, graph)
        if name == "policy":
            entry = model.metadata_props.add()
            entry.key, entry.value = METADATA, json.dumps(metadata(loaded, parts))
        files.append(file if name == "policy" else file.with_name(f"{file.stem}_{name}.onnx"))
        write_bytes(files[-1], model.SerializeToString())
    files.append(file.with_suffix(".xml"))
    write_text(files[-1], character_xml(loaded.config.physics))
    return files


def policy_parts(loaded: LoadedPolicy) -> PolicyParts:
    """The policy's networks and what stands before and behind them; no start states are made."""
    # as in an evaluation: what only helps to train changes the filter's first action
    config = evaluation_config(loaded.config, Scenario(episodes=1))
    character = load_character(config.physics)
    prior = pose_prior.from_checkpoint(loaded.prior)
    task = make_task(config, character, character, prior)
    learner, policy = restore_policy(loaded, task)
    margin = config.task.target_margin_rad
    return PolicyParts(
        task=task,
        decoder=ActionDecoder(
            prior, config.task.offset_scale, jnp.asarray(character.neutral_qpos[7:])
        ),
        act=lambda observation: learner.act(policy, observation),
        target_lower=(character.joint_lower - margin).astype(np.float32),
        target_upper=(character.joint_upper + margin).astype(np.float32),
    )


def to_onnx(name: str, graph: Graph) -> Any:
    """The graph as a checked ONNX ModelProto."""
    onnx = load_extra("onnx", "onnx", "--onnx")
    convert = load_extra("jax2onnx", "onnx", "--onnx").to_onnx
    model = convert(
        graph.function,
        [jax.ShapeDtypeStruct((1, *shape), jnp.float32) for shape in graph.inputs.values()],
        model_name=f"getup_jax_{name}",
        opset=_OPSET,
        input_names=list(graph.inputs),
        output_names=list(graph.outputs),
    )
    used = {name for node in model.graph.node for name in node.input}
    for unused in [x for x in model.graph.initializer if x.name not in used]:
        model.graph.initializer.remove(unused)  # a runtime would warn of each
    onnx.checker.check_model(model)
    return model


def metadata(loaded: LoadedPolicy, parts: PolicyParts) -> dict[str, Any]:
    """What a program must know beside the graphs; JSON values."""
    task, physics = parts.task, loaded.config.physics
    character = task.character
    styles = load_motions(loaded.config.motion, character).getups
    return {
        "version": __version__,
        "steps": loaded.metadata.get("steps", 0),
        "control_hz": physics.control_hz,
        "substeps": physics.substeps,
        "stand_time_s": task.config.stand_time_s,
        "joints": character.joint_names,
        "links": character.link_names,
        "observation": dict(task.observer.table),
        "latent_size": task.latent_size,
        "styles": {
            style.name: {
                "duration": style.duration,
                "points": np.round(style.points, 6).tolist(),
                "start": None if style.clip is None else np.round(style.clip.qpos[0], 6).tolist(),
            }
            for style in styles
        },
    }
