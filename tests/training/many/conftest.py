from __future__ import annotations

import pytest
from launching import Launcher


@pytest.fixture(scope="module")
def launch():
    launcher = Launcher()
    yield launcher
    for process in launcher.started:
        if process.popen.poll() is None:
            process.popen.kill()
            process.popen.wait()
