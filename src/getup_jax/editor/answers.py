"""Answers that may take a while: opening, importing, saving and exporting."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from getup_jax.editor import messages
from getup_jax.editor.export import export
from getup_jax.editor.films import Progress
from getup_jax.editor.imports import curve_of, getups_of
from getup_jax.editor.messages import MessageError, Request
from getup_jax.editor.recordings import packed
from getup_jax.editor.session import Session
from getup_jax.editor.simulate import Simulator
from getup_jax.editor.verdict import outcome
from getup_jax.motion.io.curve_file import dump, parse_text
from getup_jax.motion.retarget.subprocess_job import Stop


def answer(
    request: Request,
    session: Session,
    stop: Stop,
    progress: Progress = lambda share: None,
) -> str | bytes:
    """The answer to a request that may take a while; runs in a thread of its own.

    Raises AbandonedError soon after the stop is set, without an answer.
    """
    header: dict[str, Any] = {"number": request.number}
    if request.type == "load":
        curve = parse_text(request.content, request.name)
        curve.start_clip(session.simulator.starts.clips, session.simulator.character)
        return json.dumps({"type": "curves", **header, "curves": [curve.plain()]})
    if request.type == "import":
        assert isinstance(request.content, bytes)
        return _imported(request, request.content, session, stop)
    if request.type == "recording":
        return _recording(request.name, session.simulator, header)
    assert request.curve is not None
    if request.type == "save":
        name = f"{request.curve.name}.yaml"
        return messages.pack({"type": "file", **header, "name": name}, dump(request.curve).encode())
    motion = session.motion(request, stop.check)
    stop.check()
    if request.type == "judge":
        return json.dumps({"type": "judged", **header, **outcome(motion)})
    motion = dataclasses.replace(motion, curve=request.curve)  # which may be called otherwise
    character = session.simulator.character
    content = export(motion, character, request.format, request.cut, stop, progress)
    name = f"{request.curve.name}.{request.format}"
    return messages.pack({"type": "file", **header, "name": name}, content)


def _imported(request: Request, content: bytes, session: Session, stop: Stop) -> bytes:
    """The curves of a motion file, and the motions that they are of."""
    character = session.simulator.character
    getups = getups_of(request.name, content, character, stop)
    clips = [getup.clip for getup in getups if getup.clip is not None]
    heads, frames = packed(clips, character)
    curves = [curve_of(getup).plain() for getup in getups]
    header = {"type": "curves", "number": request.number, "curves": curves, "recordings": heads}
    return messages.pack(header, frames)


def _recording(name: str, simulator: Simulator, header: dict[str, Any]) -> bytes:
    """The reference motion of a name."""
    clip = simulator.starts.clips.get(name)
    if clip is None:
        raise MessageError(f"name: expected a reference motion, got {name[:80]!r}")
    heads, frames = packed([clip], simulator.character)
    return messages.pack({"type": "recording", **header, "recordings": heads}, frames)
