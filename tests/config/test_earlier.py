from __future__ import annotations

import pytest
import yaml

from getup_jax.config import Config, ConfigError
from getup_jax.config.earlier import THEN, completed
from getup_jax.config.load import dump_yaml, load_config, to_dict
from getup_jax.runtime.checkpoint import load_policy


def saved_then(**changes) -> dict:
    """A config as it was saved before there were the keys of the table."""
    values = to_dict(Config()) | changes
    for key in THEN:
        section, name = key.split(".")
        if values[section] is not None:
            del values[section][name]
    return values


def write(tmp_path, values) -> str:
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(values))
    return str(path)


def test_every_key_is_a_setting_of_another_default():
    for key, value in THEN.items():
        section, name = key.split(".")
        assert getattr(getattr(Config(), section), name) != value


def test_a_saved_config_without_the_keys_means_what_was_so_then(tmp_path):
    config = load_config(write(tmp_path, saved_then()))
    assert (config.network.mirror, config.prior.mirror) == (False, False)
    assert to_dict(config) == to_dict(Config()) | {
        "network": to_dict(Config().network) | {"mirror": False},
        "prior": to_dict(Config().prior) | {"mirror": False},
    }


def test_a_section_that_is_switched_off_stays_so(tmp_path):
    config = load_config(write(tmp_path, saved_then(prior=None)))
    assert config.prior is None
    assert not config.network.mirror


def test_keys_that_a_saved_config_has_stay_and_overrides_win(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(dump_yaml(Config()))
    assert load_config(path) == Config()
    old = write(tmp_path, saved_then())
    assert load_config(old, ["network.mirror=true", "prior.mirror=true"]).network.mirror


def test_a_config_of_differences_has_todays_defaults(tmp_path):
    values = {"network": {"activation": "tanh"}, "seed": 3}
    assert completed(values) == values
    assert load_config(write(tmp_path, values)).network.mirror


def test_mirrored_networks_need_a_mirrored_prior():
    with pytest.raises(ConfigError, match=r"network\.mirror: expected false where prior\.mirror"):
        load_config(None, ["prior.mirror=false"])
    assert not load_config(None, ["prior.mirror=false", "network.mirror=false"]).prior.mirror
    assert load_config(None, ["prior=null"]).network.mirror


@pytest.mark.parametrize("name", ["flat", "terrain", "walk", "walk_aim", "wave_squat"])
def test_policies_that_were_shipped_before_are_not_mirrored(name):
    loaded = load_policy(name)
    assert not loaded.config.network.mirror
    assert loaded.prior is None or "mirror" not in loaded.prior["variables"]
