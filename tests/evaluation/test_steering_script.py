from __future__ import annotations

import pytest

from getup_jax.config import ConfigError
from getup_jax.evaluation.steering_script import read_script

GOOD = """\
duration_s: 20
commands:
  - {at_s: 6, policy: runs/crouch, target_location: {place: [3, -1.5]}}
  - {at_s: 0, target_location: {place: [3, 0], within_s: 3}, aiming: {yaw_deg: 90}}
"""


def write(folder, text: str):
    path = folder / "script.yaml"
    path.write_text(text)
    return path


def test_commands_come_in_the_order_of_their_times_with_defaults(tmp_path):
    script = read_script(write(tmp_path, GOOD))
    assert script.duration_s == 20.0
    first, second = script.commands
    assert (first.at_s, first.policy) == (0.0, None)
    assert first.targets == {
        "target_location": {"place": (3.0, 0.0), "within_s": 3.0},
        "aiming": {"yaw_deg": 90.0, "pitch_deg": 0.0},
    }
    assert second.policy == "runs/crouch"
    assert second.targets["target_location"] == {"place": (3.0, -1.5), "within_s": 4.0}
    assert second.text == "policy runs/crouch; target_location: place (3.0, -1.5), within_s 4.0"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1, 2]", "expected a file with duration_s and a list of commands"),
        ("a: [", "line 1: broken YAML"),
        ("[" * 5000, "line 1: broken YAML: nested more than 40 deep"),
        ("duration_s: .inf\ncommands: [{at_s: 0, policy: x}]", "duration_s: .*, got inf"),
        (f"duration_s: {'9' * 400}\ncommands: [{{at_s: 0, policy: x}}]", "a number of over 308"),
        ("duration_s: 5\ncommands: []", "commands: expected at least one"),
        ("duration_s: 5\nsteps: 1\ncommands: [{at_s: 0, policy: x}]", "unknown 'steps'"),
        (
            "duration_s: -5\ncommands: [{at_s: 0, policy: x}]",
            r"duration_s: .*from 0\.1 to .*, got -5",
        ),
        ("duration_s: 5\ncommands: [{at_s: 0}]", r"commands\[0\]: expected a policy or one of"),
        ("duration_s: 5\ncommands: [{policy: x}]", r"commands\[0\]\.at_s: expected a number"),
        ("duration_s: 5\ncommands: [{at_s: 6, policy: x}]", r"at_s: expected less than duration_s"),
        ("duration_s: 5\ncommands: [{at_s: 0, policy: 3}]", "policy: expected a run folder"),
        ("duration_s: 5\ncommands: [{at_s: 0, target_locatio: {}}]", "did you mean 'target_loc"),
        (
            "duration_s: 5\ncommands: [{at_s: 0, target_location: {within_s: 2}}]",
            r"target_location\.place: missing; expected a list of 2 numbers",
        ),
        (
            "duration_s: 5\ncommands: [{at_s: 0, target_location: {place: [1]}}]",
            r"place: expected a list of 2 numbers, got \[1\]",
        ),
        (
            "duration_s: 5\ncommands: [{at_s: 0, target_location: {place: [1, x]}}]",
            "place: expected a number from .* to .*, got 'x'",
        ),
        (
            "duration_s: 5\ncommands: [{at_s: 0, aiming: {yaw: 3}}]",
            r"commands\[0\]\.aiming: unknown 'yaw'; did you mean 'yaw_deg'",
        ),
        ("duration_s: 5\ncommands: [{at_s: 0, juggling: {}}]", "juggling: cannot be steered"),
    ],
)
def test_bad_files_are_clear_errors(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message):
        read_script(write(tmp_path, text))


def test_a_missing_file(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.yaml: cannot be read"):
        read_script(tmp_path / "none.yaml")
