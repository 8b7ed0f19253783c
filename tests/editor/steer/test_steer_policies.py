"""Which policies may be steered together; what does not fit is said before anything is compiled."""

from __future__ import annotations

import pytest

from getup_jax.cli import main
from getup_jax.config import ConfigError
from getup_jax.editor.steer.policies import choose
from getup_jax.runtime.checkpoint import load_policy
from steering_samples import config_with, save


def test_named_policies_come_first_and_shipped_ones_that_fit_are_offered():
    found = choose("walk", load_policy("walk"), ["walk_aim", "walk_aim"], None)
    assert list(found.offers)[:2] == ["walk", "walk_aim"]
    assert "wave_squat" in found.offers
    assert not {"flat", "getup", "terrain"} & found.offers.keys()  # another task, another character
    assert found.asked == ("walk", "walk_aim")
    assert (found.first, found.getup, found.players) == ("walk", None, {})
    said = {policy["name"]: policy for policy in found.describe()}
    location = said["walk"]["goals"]["target_location"]
    assert location["orders"] == {"place": 2, "within_s": 1}
    assert (location["slack"], location["radius_m"], said["walk"]["ready"]) == (1.3, 0.5, False)
    assert list(said["walk_aim"]["goals"]) == ["target_location", "aiming"]
    assert said["wave_squat"]["goals"] == {}


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--with", "nobody"], "nobody: no such folder; shipped policies: "),
        (["--getup", "nobody"], "nobody: no such folder; shipped policies: "),
        (["--with", "walk_aim", "flat"], "--with flat: is of the get-up task; expected one of com"),
        (["--getup", "walk"], "--getup walk: is of composite motion; expected a policy that gets"),
        (["--getup", "terrain"], "--getup terrain: was trained on irregular ground; expected one"),
        (["--getup", "flat"], "--getup flat: moves another character (humanoid49) than the first"),
    ],
)
def test_what_does_not_fit_is_one_line(options, text, capsys):
    assert main.edit_main(["--ckpt", "walk", *options, "--port", "0"]) == 2
    said = capsys.readouterr().err
    assert text in said
    assert said.count("\n") == 1
    assert "Traceback" not in said


def test_other_physics_and_other_balls_do_not_fit(tmp_path):
    walk = load_policy("walk")
    soft = str(save(tmp_path / "soft", config_with({"target_location": {}}, gain_scale=0.5)))
    with pytest.raises(ConfigError, match=r"--with .*was trained with other physics"):
        choose("walk", walk, [soft], None)
    juggler = str(save(tmp_path / "ball", config_with({"juggling": {}})))
    with pytest.raises(ConfigError, match=r"--with .*other balls or rackets"):
        choose("walk", walk, [juggler], None)
    assert list(choose(juggler, load_policy(juggler), [], None).offers) == [juggler]


def test_a_getup_policy_of_the_same_body_fits_under_other_names(getup_path):
    found = choose("walk", load_policy("walk"), [], str(getup_path))
    assert found.getup is not None
    assert found.getup.path == getup_path
    assert found.getup.config.physics.character == "humanoid28_getup"
