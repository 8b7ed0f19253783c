"""The server of the page in which a character is steered."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from getup_jax.editor.outbox import Outbox
from getup_jax.editor.scene import shapes
from getup_jax.editor.server import App
from getup_jax.editor.site import Site
from getup_jax.editor.steer import messages
from getup_jax.editor.steer.messages import Request
from getup_jax.editor.steer.policies import Policies, choose
from getup_jax.editor.steer.session import Session
from getup_jax.runtime.checkpoint import LoadedPolicy

PAGE = "steer.html"


class SteerApp(App):
    """Pages with a character each."""

    most_pages = 4  # simulated at once, in real time

    def _read(self, message: str | bytes) -> Request:
        return messages.read(message)

    def _do(self, page: int, request: Request, box: Outbox) -> None:
        self._session.submit(page, request, box.put_from_thread)


def steering(
    first: str, loaded: LoadedPolicy, others: Sequence[str], getup: str | None, token: str | None
) -> SteerApp:
    """The server, not running yet; what does not fit the first policy is told now.

    Raises CheckpointError and ConfigError.
    """
    policies = choose(first, loaded, others, getup)
    return SteerApp(lambda log: build_session(policies, log), Site.of(token, PAGE))


def build_session(policies: Policies, log: Callable[[str], None]) -> tuple[Session, dict[str, Any]]:
    """The session of some policies, compiled, and what pages must know of it."""
    policies.build(log)
    task = policies.players[policies.first].task
    scene = {
        "control_dt": task.engine.control_dt,
        "shapes": shapes(task.character),
        "links": task.character.link_names,
        "policies": policies.describe(),
        "getup": None if policies.getup is None else policies.getup.path.name,
    }
    return Session(policies), scene
