"""The page's files and who may ask for them: a fixed table of names, and checks of the sender.

The page names its files by a folder that is called after what is in them: a browser keeps them for
as long as it likes, and asks for other ones when they change.
"""

from __future__ import annotations

import dataclasses
import hashlib
import hmac
import re
import urllib.parse
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from getup_jax.editor.options import is_loopback

PAGE = Path(__file__).parent / "page"
SOCKET = "/socket"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}
# A name or an IPv4 address, or an IPv6 address in brackets; then perhaps a port. Nothing else: what
# a lenient reader would take for the name may be what stands before an @.
_HOST = re.compile(r"(?:([A-Za-z0-9_.-]{1,255})|\[([0-9A-Fa-f:.]{2,45})\])(?::[0-9]{1,5})?")
_NEVER, _FOREVER = "no-store", "max-age=31536000, immutable"  # whether a browser keeps it
_TEXT = "text/plain; charset=utf-8"
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


@dataclasses.dataclass(frozen=True)
class Site:
    """What is served, and to whom."""

    files: dict[str, tuple[bytes, str]]  # path of the address -> content and type
    token: str | None  # what the page's address and its socket must say; None: nothing
    version: str = ""  # folder of those that never change

    @classmethod
    def of(cls, token: str | None, index: str = "index.html") -> Site:
        """The files of the package, read once: no name of a request reaches the disk.

        index: the page that is shown at the address itself.
        """
        files = {}
        for path in sorted(PAGE.rglob("*")):
            if path.suffix in _TYPES:
                name = path.relative_to(PAGE).as_posix()
                files[name] = (path.read_bytes(), _TYPES[path.suffix])
        version = hashlib.sha256(b"".join(content for content, _ in files.values())).hexdigest()[
            :16
        ]
        pages = {name: files.pop(name) for name in list(files) if name.endswith(".html")}
        page, kind = pages[index]
        table = {f"/{name}": file for name, file in files.items()}
        kept = {f"/{version}/{name}": file for name, file in files.items()}
        return cls({**table, **kept, "/": (_versioned(page, version, files), kind)}, token, version)

    def answer(self, request: Request) -> Response | None:
        """The file or the refusal; None lets a WebSocket in."""
        path, _, query = request.path.partition("?")
        if not path.startswith("/"):  # the whole address, as for a proxy
            return _response(HTTPStatus.BAD_REQUEST, b"expected a path that begins with /\n", _TEXT)
        refusal = self._refusal(request.headers, path, query)
        if refusal is not None:
            return _response(HTTPStatus.FORBIDDEN, refusal.encode(), _TEXT)
        if path == SOCKET:
            return None
        found = self.files.get(path)
        if found is None:
            return _response(HTTPStatus.NOT_FOUND, b"not found\n", _TEXT)
        stays = bool(self.version) and path.startswith(f"/{self.version}/")
        return _response(HTTPStatus.OK, *found, _FOREVER if stays else _NEVER)

    def _refusal(self, headers: Headers, path: str, query: str) -> str | None:
        """Why a request is not answered."""
        hosts = headers.get_all("Host")
        name = host_name(hosts[0]) if len(hosts) == 1 else None
        if name is None or (self.token is None and not is_loopback(name)):
            # a name of another site that was made to point here
            return "Host: expected localhost or 127.0.0.1\n"
        origins = headers.get_all("Origin")
        if any(origin not in (f"http://{hosts[0]}", f"https://{hosts[0]}") for origin in origins):
            return "Origin: the editor answers its own page only\n"
        if self.token is not None and path in ("/", SOCKET):
            said = urllib.parse.parse_qs(query, errors="replace").get("token", [""])[0]
            if not hmac.compare_digest(said.encode(errors="replace"), self.token.encode()):
                return "token: open the address that getup-edit printed\n"
        return None


def host_name(host: str) -> str | None:
    """The name or address in a Host header, in lower case; None where it is not a plain one."""
    match = _HOST.fullmatch(host)
    return None if match is None else (match[1] or match[2]).lower()


def _versioned(page: bytes, version: str, files: Mapping[str, tuple[bytes, str]]) -> bytes:
    """The page with its files in their folder, and its modules asked for all at once."""

    def moved(match: re.Match[str]) -> str:
        attribute, name = match.groups()
        return f'{attribute}="{version}/{name}"' if name in files else match[0]

    text = re.sub(r'(href|src)="([^"]+)"', moved, page.decode())
    modules = sorted(_imported(re.findall(rb'src="([^"]+\.js)"', page), files))
    links = "".join(f'  <link rel="modulepreload" href="{version}/{name}">\n' for name in modules)
    return text.replace("</head>", f"{links}</head>").encode()


def _imported(names: list[bytes], files: Mapping[str, tuple[bytes, str]]) -> set[str]:
    """The modules with these names, and all that they import."""
    found, open_ = set(), [name.decode() for name in names]
    while open_:
        name = open_.pop()
        if name in files and name not in found:
            found.add(name)
            folder = name.rpartition("/")[0]
            for other in re.findall(rb'from "\./([^"]+)"', files[name][0]):
                open_.append(f"{folder}/{other.decode()}".lstrip("/"))
    return found


def _response(status: HTTPStatus, body: bytes, kind: str, cache: str = _NEVER) -> Response:
    headers = Headers(
        {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": cache,
            "Content-Security-Policy": _POLICY,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Connection": "close",
        }
    )
    return Response(status.value, status.phrase, headers, body)
