from __future__ import annotations

from pathlib import Path

import pytest

from getup_jax.evaluation.options import eval_parser
from getup_jax.evaluation.scenario import DROPPED


def parse(*arguments: str):
    return eval_parser().parse_args(arguments)


def test_conditions():
    args = parse("--start-noise", "0.1", "--duration-scale", ".8,1.2", "--push", "20")
    assert (args.start_noise, args.duration_scale, args.push) == (0.1, (0.8, 1.2), 20.0)


@pytest.mark.parametrize(
    ("arguments", "blend"),
    [([], None), (["--blend"], "half"), (["--blend", "random", "--seed", "1"], "random")],
)
def test_blend(arguments, blend):
    assert parse(*arguments).blend == blend


def test_every_way_to_lie_is_an_option_of_drops():
    assert parse().drops is None
    for name in DROPPED:
        assert parse("--drops", name).drops == name
    with pytest.raises(SystemExit):
        parse("--drops", "gently")


def test_outputs_may_be_in_any_case_and_folder(tmp_path):
    file = tmp_path / "A.PNG"
    assert parse("--plot", str(file)).plot == file
    assert parse("--json", "a.json").json == Path("a.json")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--start-noise", "-0.1"], "--start-noise: expected a number, at least 0, got '-0.1'"),
        (["--start-noise", "nan"], "expected a number"),
        (["--duration-scale", "1.2,0.8"], "expected LOW,HIGH with 0 < LOW <= HIGH"),
        (["--duration-scale", "0.8"], "expected LOW,HIGH"),
        (["--duration-scale", "0,1"], "expected LOW,HIGH"),
        (["--duration-scale", "0.8,1,2"], "expected LOW,HIGH"),
        (["--push", "0"], "--push: expected a number above 0, got '0'"),
        (["--stand-time", "-1"], "--stand-time: expected a number above 0"),
        (["--blend", "third"], "invalid choice: 'third'"),
        (["--video", "a.avi"], "--video: expected a file that ends in .mp4, got 'a.avi'"),
        (["--plot", "a.jpg"], "expected a file that ends in .png or .pdf or .svg"),
        (["--json", "a.txt"], "expected a file that ends in .json"),
        (["--json", "no/such/a.json"], "no folder no/such; make it first"),
        (["--seed", "-1"], "--seed: expected a whole number, at least 0"),
    ],
)
def test_bad_values_are_refused(arguments, message, capsys):
    # "=" keeps a value that starts with a minus sign from looking like an option
    with pytest.raises(SystemExit) as caught:
        parse("=".join(arguments))
    assert caught.value.code == 2
    assert message in capsys.readouterr().err


def test_the_size_of_a_film_is_width_times_height():
    assert parse().size == (720, 1280)
    assert parse("--size", "640x480").size == (480, 640)


@pytest.mark.parametrize("text", ["640", "641x480", "0x480", "-640x480", "640x480x3", "9999x9998"])
def test_a_size_that_no_film_has_is_refused(text, capsys):
    with pytest.raises(SystemExit):
        parse(f"--size={text}")
    assert "expected WIDTHxHEIGHT in even numbers" in capsys.readouterr().err
