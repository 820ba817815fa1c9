"""Reads the messages of the live page, as a browser does; written from docs/live-protocol.md."""

import struct
from typing import Any, NamedTuple


class ToldContact(NamedTuple):
    x_mm: float
    y_mm: float
    diameter_mm: float
    confidence: float
    lean_deg: float
    azimuth_deg: float
    touching: bool
    kind: str
    refused: bool


class ToldTouch(NamedTuple):
    id: int
    x_mm: float
    y_mm: float
    vx_mm_s: float
    vy_mm_s: float
    diameter_mm: float
    age_s: float


class ToldMoment(NamedTuple):
    captured_at_s: float
    latency_ms: float
    skew_ms: float
    touches: list[ToldTouch]
    contacts: list[ToldContact]
    lines: dict[int, list[tuple[float, float]]]


class ToldStrip(NamedTuple):
    camera: int
    width_px: int
    rows: int
    captured_at_s: float
    level: float
    contrast: float
    dark_level: float
    picture: bytes
    brightness: bytes
    reference: bytes
    state: bytes
    edges_px: list[float]


class _Reader:
    def __init__(self, message: bytes) -> None:
        self._left = memoryview(message)

    def take(self, form: str) -> tuple[Any, ...]:
        size = struct.calcsize(f"<{form}")
        values = struct.unpack(f"<{form}", self._left[:size])
        self._left = self._left[size:]
        return values

    def bytes(self, count: int) -> bytes:
        taken, self._left = self._left[:count], self._left[count:]
        assert len(taken) == count
        return bytes(taken)

    def end(self) -> None:
        assert not self._left, f"{len(self._left)} bytes too many"


def read_message(message: bytes) -> ToldMoment | ToldStrip:
    reader = _Reader(message)
    (kind,) = reader.take("B")
    told = {1: _moment, 2: _strip}[kind](reader)
    reader.end()
    return told


def _moment(reader: _Reader) -> ToldMoment:
    touches, contacts, cameras = reader.take("BBB")
    at_s, latency_ms, skew_ms = reader.take("dff")
    return ToldMoment(
        at_s,
        latency_ms,
        skew_ms,
        [ToldTouch(*reader.take("iffffff")) for _ in range(touches)],
        [_contact(reader) for _ in range(contacts)],
        dict(_camera(reader) for _ in range(cameras)),
    )


def _contact(reader: _Reader) -> ToldContact:
    *values, flags = reader.take("ffffffB")
    assert reader.bytes(3) == bytes(3)
    kind = ("finger", "palm", "pen")[flags >> 1 & 3]
    return ToldContact(*values, bool(flags & 1), kind, bool(flags & 8))


def _camera(reader: _Reader) -> tuple[int, list[tuple[float, float]]]:
    number, shadows, zero = reader.take("BBH")
    assert zero == 0
    return number, [reader.take("ff") for _ in range(shadows)]


def _strip(reader: _Reader) -> ToldStrip:
    camera, width, rows, edges = reader.take("BHHH")
    at_s, level, contrast, dark_level, zero = reader.take("dffff")
    assert zero == 0.0
    return ToldStrip(
        camera,
        width,
        rows,
        at_s,
        level,
        contrast,
        dark_level,
        reader.bytes(rows * width),
        reader.bytes(width),
        reader.bytes(width),
        reader.bytes(width),
        [reader.take("f")[0] for _ in range(edges)],
    )
