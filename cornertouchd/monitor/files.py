"""The files of the page, all read at the start: nothing a request says becomes a file's name."""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files

CONTENT_TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
INDEX, TARGETS = "index.html", "targets.html"


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file as it is served; `etag` tells its versions apart."""

    content: bytes
    content_type: str
    etag: str


def page_files() -> Mapping[str, PageFile]:
    """Return every file by the path that it is served at."""
    found = {
        file.name: file.read_bytes()
        for file in files("cornertouchd.monitor").joinpath("page").iterdir()
        if file.is_file()
    }
    served = {
        f"/page/{name}": PageFile(content, content_type, sha256(content).hexdigest()[:16])
        for name, content in found.items()
        for suffix, content_type in CONTENT_TYPES.items()
        if name.endswith(suffix)
    }
    return {"/": served[f"/page/{INDEX}"], "/targets": served[f"/page/{TARGETS}"], **served}
