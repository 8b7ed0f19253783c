from __future__ import annotations

import pytest

from getup_jax.config.yaml_text import YamlError, parse


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("3", 3),
        ("[1, 2.5, x]", [1, 2.5, "x"]),
        ("a: {b: null}\n", {"a": {"b": None}}),
        ("a: &x [1]\nb: *x\n", {"a": [1], "b": [1]}),
        ("a: &x {c: 1}\nb: {<<: *x, d: 2}\n", {"a": {"c": 1}, "b": {"c": 1, "d": 2}}),
        (b"\xef\xbb\xbfa: \xc3\xbc\n", {"a": "ü"}),
        ("a: ü\n".encode("utf-16"), {"a": "ü"}),
        ("[" * 40 + "]" * 40, None),
    ],
)
def test_values(text, value):
    found = parse(text)
    if value is not None or not text:
        assert found == value


@pytest.mark.parametrize(
    ("text", "problem", "line"),
    [
        ("a: 1\nb: }", "found", 2),
        ("a: 1\na: 2", "the key 'a' appears twice", 2),
        ("\n{a: 1, a: 2}", "the key 'a' appears twice", 2),
        ("[" * 5000, "nested more than 40 deep", 1),
        ("[" * 5000 + "]" * 5000, "nested more than 40 deep", 1),
        ("{a: " * 5000, "nested more than 40 deep", 1),
        ("- " * 5000 + "1", "nested more than 40 deep", 1),
        ("a: 1\nb: " + "1" * 5000, "'111.*111' cannot be read as int", 2),
        ("!!int ''", "'' cannot be read as int", 1),
        ("!!float x", "'x' cannot be read as float", 1),
        ("!!bool perhaps", "'perhaps' cannot be read as bool", 1),
        ("!!timestamp then", "'then' cannot be read as timestamp", 1),
        ("2020-13-45", "'2020-13-45' cannot be read as timestamp", 1),
        ("{[1]: 2}", "unhashable", 1),
        ("!!python/object:os.system x", "could not determine a constructor", 1),
        (f"!{'a' * 5000} x", "could not determine a constructor", 1),
        ("*a", "undefined alias", 1),
        ("a: 1\n---\nb: 2\n", "another document", 2),
        ("a\0b", r"not text: special characters are not allowed \(0x00 at position 1\)", None),
        (b"\xff", r"not text: invalid start byte \(0xff at position 0\)", None),
        ("#" * 600_000, "expected at most 500000 bytes, got 600000", None),
    ],
)
def test_what_is_wrong_is_one_short_line(text, problem, line):
    with pytest.raises(YamlError, match=problem) as caught:
        parse(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 120
    assert line is None or caught.value.line == line
