"""Messages that no page of ours sends: each is read, or refused in one line of our own words."""

from __future__ import annotations

import io
import json
import random
import re
import types

import numpy as np
import pytest
from edit_running import CURVE

from getup_jax.config import PhysicsConfig
from getup_jax.editor import messages
from getup_jax.editor.answers import answer
from getup_jax.editor.messages import pack, read
from getup_jax.editor.session import error_message
from getup_jax.editor.takes import Cut
from getup_jax.motion.clips import Clip
from getup_jax.motion.retarget.cache import write_npz
from getup_jax.motion.retarget.retarget import RetargetReport
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import load_character

PLAIN = {"number": 1, "curve": CURVE, "slot": 0, "region": 0, "place": 0}
TEXTS = {
    "simulate": PLAIN,
    "save": PLAIN,
    "export": {**PLAIN, "format": "csv"},
    "load": {"number": 1, "name": "a.yaml", "text": "name: x"},
    "recording": {"number": 1, "name": "prone"},
    "cancel": {"number": 2, "of": 1},
}
NUMBERS = [True, -1, 0.5, 2**31, 2**63, 10**400, -(10**400), 1e308, float("nan"), float("inf")]
WORDS = [
    "",
    "x" * 5000,
    "\ud800",
    "\udfff\ud800",
    "\0",
    "a\nb",
    "../a",
    "/etc/passwd",
    "a\u202eb",
]
DEEP: list = []
for _ in range(400):
    DEEP = [DEEP]
WRONG = [
    None,
    *NUMBERS,
    *WORDS,
    [],
    {},
    DEEP,
    [[1.0]] * 9,
    ["\ud800"] * 9,
    [10**400] * 9,
    [True] * 9,
]
WRONG += [{"a": 1}, {"\ud800": 1}, [None] * 2000, [float("nan")] * 9, [-float("inf")] * 9]
# Python's own words, and places on this machine
PYTHONS = re.compile(r"Error|Traceback|codec|argument|NoneType|/tmp|/home|\.py\b|convert")


@pytest.fixture(scope="module")
def session():
    """Enough of a session for what needs no simulation."""
    starts = types.SimpleNamespace(clips={})
    simulator = types.SimpleNamespace(character=load_character(PhysicsConfig()), starts=starts)
    return types.SimpleNamespace(simulator=simulator)


def said_of(session, message: str | bytes) -> str | None:
    """What a page is told about a message that is refused; None: it is answered."""
    request, refused = None, None
    try:
        request = read(message)
        if request.type not in ("simulate", "export", "cancel"):
            answer(request, session, Stop())
    except Exception as error:
        refused = error
    if refused is None:
        return None
    told = error_message(request, refused)
    text = json.loads(told)["text"]
    assert type(refused).__module__.startswith("getup_jax."), repr(refused)
    assert told.isascii()
    assert text == " ".join(text.split())
    assert 10 < len(text) < 500, text
    assert not PYTHONS.search(text), text
    return text


def test_the_messages_themselves_are_read(session):
    for kind, values in TEXTS.items():
        assert read(json.dumps({"type": kind, **values})).type == kind
    assert said_of(session, json.dumps({"type": "save", **PLAIN})) is None


@pytest.mark.parametrize("kind", TEXTS)
def test_a_wrong_value_in_any_field_is_refused(session, kind):
    for key in ("type", *TEXTS[kind]):
        if key == "type":
            continue  # below
        for value in WRONG:
            text = said_of(session, json.dumps({"type": kind, **TEXTS[kind], key: value}))
            assert text is not None, f"{kind}: {key}={value!r:.60}"


@pytest.mark.parametrize("key", [*CURVE, "pose"])
def test_a_wrong_value_in_any_field_of_a_curve_is_refused(session, key):
    for value in WRONG:
        curve = {**CURVE, key: value}
        text = said_of(session, json.dumps({"type": "save", **PLAIN, "curve": curve}))
        assert text is not None, f"curve: {key}={value!r:.60}"


@pytest.mark.parametrize("value", WRONG)
def test_a_wrong_type_of_message_is_refused(session, value):
    assert "unknown type" in (said_of(session, json.dumps({**PLAIN, "type": value})) or "")


@pytest.mark.parametrize(
    "message",
    [
        *(
            "[" * 100_000,
            "{" * 100_000,
            '{"a":' * 20_000,
            "[" * 60_000 + "]" * 60_000,
            "1" * 100_000,
        ),
        *(
            "NaN",
            "Infinity",
            "-Infinity",
            "1e999",
            "-0",
            "null",
            "true",
            '""',
            "[]",
            "\ufeff{}",
            "{}x",
        ),
        *(
            '{"type": "save", "type": "save"}',
            "\0",
            "{\0}",
            '"\\ud800"',
            "'",
            "//",
            "\ud800",
            "\x85",
        ),
        *(
            '{"type": NaN}',
            '{"type": "save", "number": Infinity}',
            '{"type": "save", "number": 1e999}',
        ),
        '{"type": "save", "number": ' + "9" * 5000 + "}",
        *(b"", b"\0", b"\0\0\0\0", b"\2\0\0\0{}", b"\xff" * 9, b"\1\0\0\0\0", b"\2\0\0\0[]x"),
        *(pack({}, b""), pack({"type": "import"}, b""), pack({"type": "load", "number": 1}, b"x")),
        *(pack({"type": "import", "number": 1, "name": w}, b"x") for w in WRONG),
    ],
)
def test_what_is_no_message_is_refused(session, message):
    assert said_of(session, message) is not None


def clip_file(character) -> bytes:
    """A clip of a body that stands still."""
    report = RetargetReport(40, 0.0, 0.0, 0.0, 0.0, 0.0, "", (), ())
    clip = Clip("still", 30.0, np.tile(character.neutral_qpos, (40, 1)))
    buffer = io.BytesIO()
    write_npz(buffer, clip, report, character)
    return buffer.getvalue()


def test_mutated_messages_are_read_or_refused(session):
    """Ten thousand of them, always the same ones."""
    rng = random.Random(0)
    bases = [json.dumps({"type": kind, **values}) for kind, values in TEXTS.items()]
    refused = 0
    for _ in range(10_000):
        refused += said_of(session, mutated_text(rng, rng.choice(bases))) is not None
    assert 5_000 < refused < 10_000


def mutated_text(rng: random.Random, text: str) -> str:
    """A message with a few pieces replaced: by values, by other pieces, by nothing."""
    for _ in range(rng.randint(1, 3)):
        start = rng.randrange(len(text))
        end = min(len(text), start + rng.randint(0, 8))
        piece = rng.choice(
            [json.dumps(rng.choice(WRONG)), text[: rng.randint(0, 9)], "", "}", '"', ","]
        )
        text = text[:start] + piece + text[end:]
    return text


def test_mutated_files_are_read_or_refused(session):
    rng = random.Random(0)
    content = clip_file(session.simulator.character)
    head = {"type": "import", "number": 1, "name": "a.npz"}
    assert "no get-up" in (said_of(session, pack(head, content)) or "")
    for _ in range(300):
        changed = bytearray(content)
        for _ in range(rng.randint(1, 4)):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
        cut = rng.choice([len(changed), rng.randrange(len(changed))])
        assert said_of(session, pack(head, bytes(changed[:cut]))) is not None


def test_a_failure_of_the_editor_is_named_to_the_page_and_said_on_the_terminal():
    with pytest.warns(UserWarning, match="load: KeyError: 'height'"):
        told = error_message(messages.Request("load", 3), KeyError("height"))
    text = "the editor failed at this (KeyError); its terminal says more"
    assert json.loads(told) == {"type": "error", "text": text, "number": 3, "of": "load"}


def test_a_file_of_32_mb_is_the_largest():
    head = {"type": "import", "number": 1, "name": "a.bvh"}
    assert len(read(pack(head, bytes(messages.MAX_FILE_BYTES))).content) == 32_000_000
    with pytest.raises(messages.MessageError, match="expected at most 32 MB"):
        read(pack(head, bytes(messages.MAX_FILE_BYTES + 1)))


@pytest.mark.parametrize("kind", ["simulate", "export"])
def test_a_motion_needs_no_name_and_a_file_gets_the_one_that_is_given(kind):
    curve = {key: value for key, value in CURVE.items() if key not in ("name", "strategy")}
    said = {"type": kind, "number": 1, "format": "bvh", "name": "late rise", "curve": curve}
    found = read(json.dumps(said)).curve
    assert found is not None
    assert found.name == ("late rise" if kind == "export" else "curve")


@pytest.mark.parametrize("key", ["rate", "from", "to", "turn"])
def test_a_wrong_part_of_a_motion_is_refused(session, key):
    good = {
        "type": "export",
        **PLAIN,
        "format": "bvh",
        "rate": 24,
        "from": 0.5,
        "to": 2,
        "turn": True,
    }
    assert read(json.dumps(good)).cut == Cut(24, 0.5, 2.0, True)
    for value in WRONG:
        if value is None or (key == "turn" and value is True):
            continue  # the default, and what turns
        if key in ("from", "to") and value == 0.5:
            continue
        assert said_of(session, json.dumps({**good, key: value})) is not None, f"{value!r:.60}"
