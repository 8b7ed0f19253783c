from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from getup_jax.config import Config, ConfigError
from getup_jax.config.convert import section
from getup_jax.config.load import dump_yaml, load_config, to_dict

EPOCHS = "expected a whole number (int) from 1 to 1000"


@pytest.fixture
def write(tmp_path):
    def write(text: str | bytes) -> Path:
        file = tmp_path / "run.yaml"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return file

    return write


def test_no_file_and_no_overrides_give_the_defaults():
    assert load_config(None) == Config()


def test_a_file_changes_only_what_it_names(write):
    config = load_config(write("seed: 3\nppo:\n  epochs: 7\n"))
    expected = dataclasses.replace(
        Config(), seed=3, ppo=dataclasses.replace(Config().ppo, epochs=7)
    )
    assert config == expected


def test_overrides_win_over_the_file_and_later_over_earlier(write):
    file = write("ppo: {epochs: 7, clip: 0.3}\n")
    config = load_config(file, ["ppo.epochs=8", "ppo.epochs=9"])
    assert (config.ppo.epochs, config.ppo.clip) == (9, 0.3)


@pytest.mark.parametrize("text", ["", "# nothing but a comment\n", "ppo: {}\n"])
def test_empty_files_and_sections_are_no_difference(write, text):
    assert load_config(write(text)) == Config()


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("seed=12", 12),
        ("train.total_steps=1e8", 100_000_000),
        ("train.total_steps=2_000", 2000),
        ("prior.learning_rate=3e-4", 3e-4),
        ("ppo.discount=0", 0.0),
        ("ppo.popart=true", True),
        ("physics.character=007", "007"),
        ("physics.character=off", "off"),
        ("physics.character='a b'", "a b"),
        ("network.hidden_sizes=[64, 32]", (64, 32)),
        ("ppo.learning_rate=[3e-4, 1]", (3e-4, 1.0)),
        ("motion.source=[deepmimic, clips]", ("deepmimic", "clips")),
        ("ppo.target_clip_fraction=0.15", 0.15),
        ("ppo.target_clip_fraction=null", None),
        ("train.init_from=runs/a=b", "runs/a=b"),
    ],
)
def test_values_convert_by_annotation(override, expected):
    value = load_config(None, [override])
    for name in override.partition("=")[0].split("."):
        value = getattr(value, name)
    assert value == expected
    assert type(value) is type(expected)


def test_numbers_that_yaml_takes_for_text_convert_in_files_too(write):
    config = load_config(write("ppo:\n  learning_rate: [3e-4, 1e-5]\n  discount: 99e-2\n"))
    assert config.ppo.learning_rate == (3e-4, 1e-5)
    assert config.ppo.discount == 0.99


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("ppo.learnig_rate=1", "ppo.learnig_rate: unknown key; did you mean 'learning_rate'?"),
        ("pppo.epochs=1", "pppo: unknown key; did you mean 'ppo'?"),
        ("zzz=1", "zzz: unknown key; known keys are: seed, physics, "),
        ("ppo.epochs=many", f"ppo.epochs: {EPOCHS}, got 'many' (str)"),
        ("ppo.epochs=1.5", f"ppo.epochs: {EPOCHS}, got 1.5 (float)"),
        ("ppo.epochs=true", f"ppo.epochs: {EPOCHS}, got True (bool)"),
        ("ppo.epochs=", f"ppo.epochs: {EPOCHS}, got None (NoneType)"),
        ("ppo.clip=.nan", "expected a number (float) more than 0 and at most 10, got nan (float)"),
        (
            f"ppo.clip={10**400}",
            "and at most 10, got a number of over 308 digits (int)",
        ),
        ("ppo.popart=1", "ppo.popart: expected true or false (bool), got 1 (int)"),
        (
            "network.hidden_sizes=64",
            "expected a list, got 64 (int); write network.hidden_sizes=[64]",
        ),
        ("network.hidden_sizes=[64, x]", "network.hidden_sizes[1]: expected a whole number (int)"),
        ("ppo=3", "ppo: expected a mapping of settings, got 3 (int)"),
        ("ppo=null", "ppo: expected a mapping of settings, got None (NoneType); leave it out"),
        ("seed.x=3", "seed: expected a whole number (int) from 0 to 4294967295, got {'x': 3}"),
        ("ppo.minibatch_size=1000", "ppo.minibatch_size: expected a divisor"),
        (
            "ppo.std_scale=[1.0, 0.4]",
            "ppo.std_scale: expected (1.0, 1.0) where network.initial_std is null",
        ),
        ("ppo.epochs", "'ppo.epochs': expected section.key=value"),
        ("ppo.=1", "'ppo.=1': expected section.key=value"),
        (["ppo.epochs=4"], "overrides: expected texts, each of section.key=value, got ['ppo.ep"),
        ({"ppo.epochs": 4}, "overrides: expected texts, each of section.key=value, got {'ppo.ep"),
        ("ppo.epochs=[1", "ppo.epochs: broken YAML in '[1'"),
    ],
)
def test_errors_of_overrides(override, message):
    with pytest.raises(ConfigError) as caught:
        load_config(None, [override])
    assert message in str(caught.value)


def test_the_suggestion_is_the_whole_message():
    with pytest.raises(ConfigError) as caught:
        load_config(None, ["ppo.learnig_rate=1"])
    assert str(caught.value) == "ppo.learnig_rate: unknown key; did you mean 'learning_rate'?"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seed: 1\nppo: }\n", "run.yaml, line 2: broken YAML"),
        ("seed: 1\nseed: 2\n", "run.yaml, line 2: broken YAML: the key 'seed' appears twice"),
        ("ppo:\n", "ppo: expected a mapping of settings, got None (NoneType); leave it out for"),
        ("- 1\n", "run.yaml: expected a mapping of settings, got [1] (list)"),
        (b"\xff\xfe\x00", "run.yaml: broken YAML: not text: truncated data (0x00 at position 2)"),
        (
            b"seed: 1\0",
            "run.yaml: broken YAML: not text: special characters are not allowed (0x00 at",
        ),
        ("seed: " + "9" * 5000, "run.yaml, line 1: broken YAML: '99999"),
        ("a: " * 500_000, "run.yaml: broken YAML: expected at most 500000 bytes, got 1500000"),
        ("physics:\n  character: 7\n", "expected text (str), got 7 (int); put it in quotes (in "),
        ("ppo:\n  epoch: 7\n", "ppo.epoch: unknown key; did you mean 'epochs'? (in "),
    ],
)
def test_errors_of_files_name_the_file(write, text, message):
    file = write(text)
    with pytest.raises(ConfigError) as caught:
        load_config(file, ["seed=1"])
    assert message in str(caught.value)
    assert str(file) in str(caught.value)


def test_an_error_of_an_override_does_not_blame_the_file(write):
    file = write("seed: 1\n")
    with pytest.raises(ConfigError) as caught:
        load_config(file, ["seed=x"])
    assert str(file) not in str(caught.value)


def test_a_missing_file_lists_the_shipped_configs():
    with pytest.raises(ConfigError, match=r"no/such.yaml: no such config file; the .*flat.*quick"):
        load_config("no/such.yaml")


@pytest.mark.parametrize("name", ["flat.yam", "configs/flt.yaml", "Flat"])
def test_a_missing_file_with_almost_a_shipped_name_suggests_it(name):
    with pytest.raises(ConfigError, match=r"no such config file; did you mean 'flat'\? the "):
        load_config(name)


def test_shipped_configs_are_found_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first, *others = (load_config(name) for name in ("quick", "quick.yaml", "configs/quick.yaml"))
    assert first != Config()
    assert others == [first, first]


def test_a_local_file_wins_over_a_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("configs").mkdir()
    Path("configs/quick.yaml").write_text("seed: 77\n")
    assert load_config("configs/quick.yaml").seed == 77


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["ppo.learning_rate=[1e-7, 3e-5]", "ppo.target_clip_fraction=0.1", "seed=9"],
        ["train.init_from=off", "physics.character='null'", "motion.curves=['1', a b, 'yes']"],
    ],
)
def test_round_trip(write, overrides):
    config = load_config(None, overrides)
    assert load_config(write(dump_yaml(config))) == config
    assert section(to_dict(config), Config, "", None) == config


# --- what Config may grow: optional sub-configs, lists of them, mappings, required fields


@dataclasses.dataclass(frozen=True)
class Group:
    name: str
    weight: float = 1.0


@dataclasses.dataclass(frozen=True)
class Extra:
    groups: tuple[Group, ...] = ()
    scale: dict[str, float] = dataclasses.field(default_factory=dict)
    pair: tuple[int, str] = (1, "a")


@dataclasses.dataclass(frozen=True)
class Root:
    extra: Extra | None = None
    preset: Extra | None = dataclasses.field(default_factory=lambda: Extra(pair=(5, "b")))


def root(values) -> Root:
    return section(values, Root, "", None)


def test_optional_sub_configs_are_null_or_a_mapping():
    assert root({}) == Root()
    assert root({"extra": {}}).extra == Extra()
    assert root({"extra": {"pair": [2, "z"]}}).extra == Extra(pair=(2, "z"))
    assert root({"preset": None}).preset is None


def test_a_sub_config_differs_from_its_fields_default_not_from_its_class():
    assert root({"preset": {"scale": {"x": 1}}}).preset == Extra(scale={"x": 1.0}, pair=(5, "b"))


def test_lists_of_sub_configs():
    values = {"extra": {"groups": [{"name": "upper"}, {"name": "lower", "weight": "5e-1"}]}}
    expected = Extra(groups=(Group("upper"), Group("lower", 0.5)))
    assert root(values).extra == expected
    assert root(to_dict(Root(extra=expected))).extra == expected


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"groups": [{"weight": 1}]}, "extra.groups[0].name: missing; it has no default"),
        ({"groups": [{"nam": "a"}]}, "extra.groups[0].nam: unknown key; did you mean 'name'?"),
        ({"scale": [1]}, "extra.scale: expected a mapping, got [1] (list)"),
        ({"scale": {"x": "y"}}, "extra.scale.x: expected a number (float), got 'y' (str)"),
        ({"pair": [1]}, "extra.pair: expected 2 values, got 1: [1]"),
    ],
)
def test_errors_in_sub_configs_name_the_whole_key(values, message):
    with pytest.raises(ConfigError) as caught:
        root({"extra": values})
    assert message in str(caught.value)


# --- a config based on another


def write_all(folder, **files: str) -> None:
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)


def test_a_config_changes_its_base(tmp_path):
    write_all(
        tmp_path, one="ppo: {num_envs: 8, epochs: 3}\nseed: 4", two="base: one\nppo: {epochs: 2}"
    )
    write_all(tmp_path, three="base: two.yaml\nseed: 5", shipped="base: flat\nseed: 6")
    config = load_config(tmp_path / "three.yaml", ["ppo.num_steps=7", "ppo.minibatch_size=56"])
    assert (config.ppo.num_envs, config.ppo.epochs, config.ppo.num_steps) == (8, 2, 7)
    assert config.seed == 5
    assert load_config(tmp_path / "shipped.yaml") == load_config("flat", ["seed=6"])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("base: other", r"a\.yaml: base: comes back to itself"),
        ("base: nothing", r"a\.yaml: base: nothing: no such config file; the shipped configs are"),
        ("base: [flat]", r"a\.yaml: base: expected the name of a config, got \["),
        ("base: flat\nppo: {epochs: 0}", r"ppo\.epochs: .*a\.yaml"),
    ],
)
def test_a_base_that_cannot_be(tmp_path, text, problem):
    write_all(tmp_path, a=text, other="base: a")
    with pytest.raises(ConfigError, match=problem):
        load_config(tmp_path / "a.yaml")


def test_what_a_run_saves_has_no_base():
    saved = dump_yaml(load_config("composite_walk_heading"))
    assert "base:" not in saved
