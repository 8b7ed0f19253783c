"""Answers that may take a while: opening, importing, saving and exporting."""

from __future__ import annotations

import json
from typing import Any

from getup_jax.editor import messages
from getup_jax.editor.export import export
from getup_jax.editor.imports import curves_of
from getup_jax.editor.messages import Request
from getup_jax.editor.session import Session
from getup_jax.motion.io.curve_file import dump, parse_text
from getup_jax.motion.retarget.subprocess_job import Stop


def answer(request: Request, session: Session, stop: Stop) -> str | bytes:
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
        curves = curves_of(request.name, request.content, session.simulator.character, stop)
        return json.dumps({"type": "curves", **header, "curves": [c.plain() for c in curves]})
    assert request.curve is not None
    if request.type == "save":
        name = f"{request.curve.name}.yaml"
        return messages.pack({"type": "file", **header, "name": name}, dump(request.curve).encode())
    motion = session.motion(request)
    stop.check()
    content = export(motion, session.simulator.character, request.format, stop)
    name = f"{request.curve.name}.{request.format}"
    return messages.pack({"type": "file", **header, "name": name}, content)
