"""OSC packets written by hand, right or wrong as they are wanted."""

import struct


def string(text: str | bytes) -> bytes:
    raw = text if isinstance(text, bytes) else text.encode()
    return raw + b"\0" * (4 - len(raw) % 4)


def message(address: str, *arguments: object, tags: str | None = None) -> bytes:
    """A message; the type of each argument is that of Python's, unless `tags` says otherwise."""
    letters = {int: "i", float: "f", str: "s"}
    tags = tags if tags is not None else "".join(letters[type(each)] for each in arguments)
    packed = b""
    for tag, value in zip(tags, arguments, strict=True):
        packed += string(value) if tag == "s" else struct.pack(f">{LAYOUTS.get(tag, tag)}", value)
    return string(address) + string("," + tags) + packed


LAYOUTS = {"h": "q"}


def bundle(*elements: bytes) -> bytes:
    sized = b"".join(struct.pack(">i", len(element)) + element for element in elements)
    return b"#bundle\0" + struct.pack(">Q", 1) + sized
