from __future__ import annotations

import numpy as np
import pytest

import gradient_noise


@pytest.mark.parametrize("noise", [0.5, 2.0])
def test_signal_and_noise_of_gradients_that_are_known(noise):
    """G has length 1, and each gradient noise of the squared length noise^2."""
    rng = np.random.default_rng(0)
    truth = np.zeros(400)
    truth[3] = 1.0
    gradients = truth + noise / 20 * rng.normal(size=(64, 400))
    snr, error = gradient_noise.snr_of(gradients @ gradients.T)
    assert abs(snr - 1 / noise**2) < 3 * error + 0.02 / noise**2
    assert 0 < error < 0.2 / noise**2


def test_noise_alone_has_no_signal():
    gradients = np.random.default_rng(1).normal(size=(48, 400))
    snr, error = gradient_noise.snr_of(gradients @ gradients.T)
    assert abs(snr) < 3 * error < 0.1


def test_without_a_run_it_is_skipped(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["gradient_noise.py", "--quick"])
    gradient_noise.main()
    assert capsys.readouterr().out == "skipped: needs a run folder\n"
