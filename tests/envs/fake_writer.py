"""In place of imageio, for the tests of films."""

from __future__ import annotations

import numpy as np


class FakeWriter:
    """Notes what is written, and with which settings."""

    def __init__(self) -> None:
        self.images: list[np.ndarray] = []
        self.settings: dict = {}

    def get_writer(self, path, **settings):
        self.settings = settings
        return self

    def append_data(self, image) -> None:
        self.images.append(image)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None
