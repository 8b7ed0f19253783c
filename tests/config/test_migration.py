from __future__ import annotations

import copy
from typing import Any

import pytest
import yaml

from getup_jax.config import CompositeConfig, Config, ConfigError, CurriculumConfig
from getup_jax.config.load import dump_yaml, load_config, load_saved_config, to_dict
from getup_jax.config.migration import MOVED, RETIRED, THEN, migrated
from getup_jax.runtime.checkpoint import load_policy

COMPOSITE = {"groups": {"body": {"links": ["full"], "clips": ["walk"]}}, "discriminator": {}}


def put(values: dict[str, Any], key: str, value: Any) -> None:
    *sections, name = key.split(".")
    for section in sections:
        values = values.setdefault(section, {})
    values[name] = value


def saved_then(**changes) -> dict:
    """A config as it was saved before there were the keys of the tables."""
    values = to_dict(Config()) | copy.deepcopy(changes)
    del values["curriculum"]
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
    assert migrated(values) == values
    assert load_config(write(tmp_path, values)).network.mirror


def test_settings_that_moved_are_found_in_saved_configs(tmp_path):
    values = saved_then()
    put(values, "task.focus", 0.9)
    put(values, "task.assist", 0.5)
    put(values, "task.clip_start", 0.25)
    config = load_saved_config(tmp_path / write(tmp_path, values))
    aids = config.training_aids
    assert (aids.prioritisation, aids.assistive_wrench, aids.reference_start) == (0.9, 0.5, 0.25)
    assert load_config(write(tmp_path, values)) == config
    classes = {"curriculum": CurriculumConfig, "composite": CompositeConfig}
    for section, name in (new.split(".") for new in MOVED.values()):
        assert hasattr(classes[section], name)


def test_composite_motion_never_had_them(tmp_path):
    values = saved_then(composite=COMPOSITE)
    put(values, "task.focus", 0.0)
    assert load_config(write(tmp_path, values)).curriculum is None


@pytest.mark.parametrize("key", MOVED)
def test_settings_that_moved_are_answered_with_their_new_name(key):
    with pytest.raises(ConfigError) as caught:
        load_config(None, [f"{key}=0.5"])
    assert str(caught.value) == f"{key}: is {MOVED[key]} now"


@pytest.mark.parametrize("key", RETIRED)
def test_settings_that_are_no_more_are_read_where_they_meant_nothing(tmp_path, key):
    same, instead = RETIRED[key]
    values = saved_then(composite=COMPOSITE) if key.startswith("composite") else saved_then()
    put(values, key, 7 if same is None else same[0])
    assert load_config(write(tmp_path, values))
    with pytest.raises(ConfigError) as caught:
        load_config(None, [f"{key}=1"])
    assert str(caught.value) == f"{key}: is no setting any more; {instead}"
    if same is None:
        return
    put(values, key, 7)
    with pytest.raises(ConfigError, match=rf"{key}: .* with 7 needs .*config\.yaml"):
        load_config(write(tmp_path, values))


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
