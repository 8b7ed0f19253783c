"""What JAX's distributed runtime says when a process is lost, as one line.

Where its C++ threads notice first, they end the process at once, with a stack trace on the standard
error stream that tells a user nothing. So that stream goes through a child process, which outlives
this one: it passes on every line but those.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import IO

LOST = (
    "ProcessError: another process of this run is gone; start all of them again with --resume to "
    "go on from the last checkpoint\n"
)
_FATAL = re.compile(rb"F\d{4} .*(distributed service detected fatal|missed heartbeat)")
_NOISE = re.compile(rb"[EW]\d{4} .*coordination_service(_agent)?\.cc")
_MORE_NOISE = re.compile(rb"\d*\s*$|The tasks have|RPC: /")  # lines that only follow such a line


def translate_stderr() -> None:
    """From here on, what this process and its C++ threads print as errors is translated."""
    sys.stderr.flush()
    reader, writer = os.pipe()
    # -S and -I: nothing but the standard library, so that it starts in no time
    command = [sys.executable, "-ISu", os.path.abspath(__file__)]
    subprocess.Popen(command, stdin=reader, stdout=subprocess.DEVNULL, start_new_session=True)
    os.close(reader)
    os.dup2(writer, 2)
    os.close(writer)


def translate(source: IO[bytes], target: IO[bytes]) -> None:
    """Copy lines until the source ends, with LOST for the runtime's account of a lost process.

    Where this process has said so itself, because its own thread noticed first, it is not repeated.
    """
    noise = said = False
    for line in source:
        said |= line.startswith(b"ProcessError: ")
        if _FATAL.match(line):
            if not said:
                target.write(LOST.encode())
                target.flush()
            source.read()  # the rest is the stack
            return
        noise = bool(_NOISE.match(line) or (noise and _MORE_NOISE.match(line)))
        if not noise:
            target.write(line)
            target.flush()


if __name__ == "__main__":
    translate(sys.stdin.buffer, sys.stderr.buffer)
