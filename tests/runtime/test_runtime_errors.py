from __future__ import annotations

import io

from getup_jax.runtime.runtime_errors import LOST, translate

# as JAX's runtime says it, shortened
ACCOUNT = b"""\
E1129 12:34:15.333559   26832 coordination_service.cc:1549] Use error polling: UNAVAILABLE:
1
The tasks have crashed. Check the task logs for an earlier error

RPC: /xla.coordination.CoordinationService/PollForError
E1129 12:34:15.333963   26843 coordination_service_agent.cc:289] Polled an error
F1129 12:34:15.334162   26843 client.h:80] Terminating process because the JAX distributed service \
detected fatal errors. This most likely indicates that another task died
1
*** Check failure stack trace: ***
    @     0x7f7a1fc40634  absl::lts_20260107::log_internal::LogMessage::SendToLog()
"""


def translated(text: bytes) -> str:
    target = io.BytesIO()
    translate(io.BytesIO(text), target)
    return target.getvalue().decode()


def test_a_lost_process_is_one_line():
    assert translated(b"warning: before\n" + ACCOUNT) == "warning: before\n" + LOST


def test_a_process_that_has_said_so_itself_is_one_line_too():
    own = "ProcessError: process 1 of 2: another process of this run is gone (why); start again\n"
    assert translated(own.encode() + ACCOUNT) == own


def test_everything_else_passes():
    text = b"Traceback (most recent call last):\n  1\n\nE1129 12:00:00.1 2 other.cc:1] why\n1\nend"
    assert translated(text) == text.decode()
