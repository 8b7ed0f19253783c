"""Who may ask for the page, told by the request alone; raw bytes over real sockets."""

from __future__ import annotations

import re
import socket as sockets

import pytest
from edit_running import TOKEN, Quick, get, running

from getup_jax.editor.site import PAGE, Site, host_name

HERE = "127.0.0.1:8421"
NAMES = {
    "localhost": "localhost",
    "LocalHost:8421": "localhost",
    "127.0.0.1": "127.0.0.1",
    "127.0.0.1:8421": "127.0.0.1",
    "[::1]": "::1",
    "[::1]:8421": "::1",
    "machine.example:1": "machine.example",
}
# fmt: off
NO_NAMES = (
    "", " ", ":", ":80", "a b", "a,b", "a/b", "a\\b", "a?b", "a#b", "a@b", "a:b@c", "a%00b", "a\n",
    "evil@127.0.0.1", "evil:1@127.0.0.1:80", "127.0.0.1@evil", "[::1", "::1", "::1]", "[]", "[]:1",
    "[::1]x", "[::1%25eth0]", "[[::1]]", "a:", "a:x", "a:1:2", "a:123456", "a:-1", "ü", "a" * 300,
)
OTHERS = (
    "evil", "evil:80", "127.0.0.1.evil", "localhost.evil", "localhost.", "0.0.0.0", "2130706433",
    "0x7f000001", "127.1", "[evil]", "[::2]", "[::ffff:1.2.3.4]",
)
TARGETS = {
    200: ("/", "/?", "/?a=[", "/?%", "/?//[", "/main.js?x", "/?" + "a&" * 500,
          "/?token=" + "[" * 3000),
    400: ("http://127.0.0.1/", "http://evil/", "http://[", "evil:80", "*", "?a", "x", "://", "@",
          "\\"),
    404: ("//", "//[", "//[::1", "//evil/", "/[", "/%", "/%00", "/\\..", "/index.html#a", "/;a",
          "/main.js/", "/MAIN.JS", "/" + "a" * 3000),
}
NO_REQUESTS = (
    b"\r\n\r\n", b"GET /\r\n\r\n", b"\x16\x03\x01", b"\xff" * 9999, b"GET /" + b"a" * 70_000,
    b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n", b"GET /\xff HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /?token=\xff HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\nabc",
    b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 500 + b"\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nbroken\r\n\r\n", b"GET / HTTP/1.1\r\nHost: \x00\r\n\r\n",
    b"GET /socket HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: x\r\n\r\n",
)
# fmt: on


@pytest.fixture(scope="module")
def site():
    """A server whose pages are never asked for a motion."""
    with running(lambda log: (Quick(None), {})) as server:
        yield server.wait(2)


@pytest.fixture(scope="module")
def token_site():
    with running(lambda log: (Quick(None), {}), token=TOKEN) as server:
        yield server.wait(2)


def status(site, target: str, *hosts: str | bytes) -> int:
    """The status of the answer to a request with these Host headers."""
    lines = [f"GET {target} HTTP/1.1".encode()]
    lines += [b"Host: " + (host if isinstance(host, bytes) else host.encode()) for host in hosts]
    with sockets.create_connection(("127.0.0.1", site.port), timeout=10) as connection:
        connection.sendall(b"\r\n".join([*lines, b"", b""]))
        return int(connection.recv(4096).split()[1])


@pytest.mark.parametrize(("host", "name"), [*NAMES.items(), *((text, None) for text in NO_NAMES)])
def test_the_name_in_a_host_header(host, name):
    assert host_name(host) == name


@pytest.mark.parametrize("host", ["localhost:1", "LOCALHOST", "127.0.0.1", "127.9.9.9", "[::1]:80"])
def test_this_machine_is_let_in(site, host):
    assert status(site, "/", host) == 200


@pytest.mark.parametrize(
    "host", [*(text for text in NO_NAMES if "\n" not in text), *OTHERS, b"\xff"]
)
def test_any_other_host_is_refused(site, host):
    assert status(site, "/", host) == 403


@pytest.mark.parametrize("hosts", [(), ("evil", HERE), (HERE, "evil"), (HERE, HERE)])
def test_a_request_has_one_host(site, hosts):
    assert status(site, "/", *hosts) == 403


@pytest.mark.parametrize(
    ("target", "code"), [(target, code) for code, targets in TARGETS.items() for target in targets]
)
def test_any_request_target_gets_an_answer(site, target, code):
    assert status(site, target, HERE) == code


def test_the_page_asks_at_once_for_all_of_its_files_and_a_browser_may_keep_them(site):
    _, page, headers = get(site, "/")
    assert headers["Cache-Control"] == "no-store"
    named = set(re.findall(r'(?:href|src)="([^"]+)"', page.decode()))
    folders = {name.split("/")[0] for name in named}
    assert len(folders) == 1
    modules = {path.relative_to(PAGE).as_posix() for path in PAGE.rglob("*.js")}
    steering = {name for name in modules if name.startswith("steer")}
    asked = {name.partition("/")[2] for name in named}
    assert asked >= modules - steering | {"style.css", "graph.css"}
    assert not asked & steering  # those of the other page
    for name in named:
        code, content, headers = get(site, f"/{name}")
        assert (code, headers["Cache-Control"]) == (200, "max-age=31536000, immutable")
        assert content == (PAGE / name.partition("/")[2]).read_bytes()


def test_other_content_is_in_another_folder(monkeypatch, tmp_path):
    (tmp_path / "index.html").write_text('<head><link href="a.js"></head>')
    found = []
    for text in ("1", "1", "2"):
        (tmp_path / "a.js").write_text(text)
        monkeypatch.setattr("getup_jax.editor.site.PAGE", tmp_path)
        found.append(Site.of(None).version)
    assert found[0] == found[1] != found[2]


@pytest.mark.parametrize("query", ["", "token", "token=", "token=%ff", "token=%ED%A0%80"])
@pytest.mark.parametrize("more", ["", "&token=" + TOKEN[:-1], "#" + TOKEN, "&TOKEN=" + TOKEN])
def test_no_query_but_the_token_lets_in(token_site, query, more):
    assert status(token_site, f"/?{query}{more}", "machine.example") == 403


def test_with_a_token_any_plain_host_is_let_in_and_no_other(token_site):
    assert status(token_site, f"/?token={TOKEN}", "machine.example:80") == 200
    assert status(token_site, f"/?token={TOKEN}", "evil@machine.example") == 403
    assert status(token_site, f"/?token={TOKEN}", "a", "b") == 403


@pytest.mark.parametrize("sent", NO_REQUESTS)
def test_what_is_no_request_says_nothing_on_the_terminal(site, sent, capfd):
    with sockets.create_connection(("127.0.0.1", site.port), timeout=10) as connection:
        connection.sendall(sent)
        connection.shutdown(sockets.SHUT_WR)
        answer = b""
        while part := connection.recv(65536):
            answer += part
    assert b"500" not in answer.split(b"\r\n")[0]
    assert get(site, "/")[0] == 200
    captured = capfd.readouterr()
    assert "Traceback" not in captured.out + captured.err


def test_the_page_that_steers_asks_for_its_own_files_alone():
    page = Site.of(None, "steer.html").files["/"][0].decode()
    assert "<title>getup-edit: steer</title>" in page
    asked = {name.partition("/")[2] for name in re.findall(r'(?:href|src)="([^"]+)"', page)}
    steering = {path.name for path in PAGE.glob("steer*") if path.suffix != ".html"}
    assert asked >= steering | {"style.css", "view.js", "link.js", "vendor/three.min.js"}
    assert not {"main.js", "graph.css", "steer.html", "index.html"} & asked
