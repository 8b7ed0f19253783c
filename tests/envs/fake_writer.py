"""In place of imageio, for the tests of films."""

from __future__ import annotations

from pathlib import Path

import numpy as np


class FakeWriter:
    """Notes what is written, and with which settings."""

    def __init__(self) -> None:
        self.images: list[np.ndarray] = []
        self.settings: dict = {}

    def get_writer(self, path, **settings):
        self.settings = settings
        Path(path).touch()  # a film is written beside its place, and then takes it
        return self

    def append_data(self, image) -> None:
        self.images.append(image)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None
