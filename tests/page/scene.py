"""Scenes for the live page, in the bytes and words that a daemon would tell them in."""

import math
import struct
from dataclasses import dataclass, field
from typing import Any

SURFACE_MM = (700.0, 400.0)
WIDTH_PX, ROWS_PX = 640, 48
CORNERS_MM = ((-8.0, -8.0), (708.0, -8.0), (708.0, 408.0), (-8.0, 408.0))


@dataclass(frozen=True)
class Touch:
    id: int
    x_mm: float
    y_mm: float
    vx_mm_s: float = 0.0
    vy_mm_s: float = 0.0
    diameter_mm: float = 12.0
    age_s: float = 1.0


@dataclass(frozen=True)
class Contact:
    x_mm: float
    y_mm: float
    diameter_mm: float = 12.0
    confidence: float = 0.95
    lean_deg: float = 0.0
    azimuth_deg: float = math.nan
    touching: bool = True
    kind: int = 0
    refused: bool = False


def encode_moment(
    captured_at_s: float,
    touches: list[Touch],
    contacts: list[Contact],
    shadows: dict[int, list[tuple[float, float]]],
    latency_ms: float = 7.5,
    skew_ms: float = 0.4,
) -> bytes:
    parts = [
        struct.pack(
            "<4Bdff", 1, len(touches), len(contacts), len(shadows),
            captured_at_s, latency_ms, skew_ms,
        )
    ]  # fmt: skip
    parts += [
        struct.pack(
            "<i6f", t.id, t.x_mm, t.y_mm, t.vx_mm_s, t.vy_mm_s, t.diameter_mm, t.age_s
        )
        for t in touches
    ]  # fmt: skip
    parts += [
        struct.pack(
            "<6fB3x", c.x_mm, c.y_mm, c.diameter_mm, c.confidence, c.lean_deg, c.azimuth_deg,
            c.touching | c.kind << 1 | c.refused << 3,
        )
        for c in contacts
    ]  # fmt: skip
    for camera, between in shadows.items():
        parts.append(struct.pack("<BBH", camera, len(between), 0))
        parts += [struct.pack("<ff", first, last) for first, last in between]
    return b"".join(parts)


def encode_strip(camera: int, captured_at_s: float, shadows_px: list[tuple[float, float]]) -> bytes:
    reference = [
        int(175 + 25 * math.sin(u / 17.0) - 60 * abs(u / WIDTH_PX - 0.5)) for u in range(WIDTH_PX)
    ]
    light = [1.0] * WIDTH_PX
    for left, right in shadows_px:
        for u in range(max(0, int(left) - 4), min(WIDTH_PX, int(right) + 5)):
            inside = min((u - left) / 3.0, (right - u) / 3.0)
            light[u] = min(light[u], 1.0 - 0.93 / (1.0 + math.exp(-3.0 * inside)))
    state = [1 if camera == 2 and 500 <= u < 530 else 0 for u in range(WIDTH_PX)]
    rows = [math.exp(-(((row - ROWS_PX / 2) / 7.0) ** 2)) for row in range(ROWS_PX)]
    picture = bytes(
        int(4 + (reference[u] * light[u]) * rows[row])
        for row in range(ROWS_PX)
        for u in range(WIDTH_PX)
    )
    edges = [edge for pair in shadows_px for edge in pair]
    header = struct.pack(
        "<BBHHHdffff", 2, camera, WIDTH_PX, ROWS_PX, len(edges), captured_at_s,
        168.0, 0.91, 4.2 if camera != 1 else math.nan, 0.0,
    )  # fmt: skip
    return b"".join(
        (
            header,
            picture,
            bytes(min(250, int(200 * value)) for value in light),
            bytes(reference),
            bytes(state),
            struct.pack(f"<{len(edges)}f", *edges),
        )
    )


def health(live: bool = True) -> dict[str, Any]:
    """What the daemon tells of itself, in its own form."""
    cameras = [
        {
            "id": f"C{number}", "live": live, "pictures_per_s": 100.2, "pictures": 27_384_570,
            "faults": 0, "reopened": 1 if number == 3 else 0, "resets": 0,
            "lost": 4 if number == 3 else 0, "damaged": 0, "left_out": 0,
            "masked_columns": 30 if number == 3 else 0, "blind": [], "strip_shift": "",
            "strip": {"level": 168.0, "contrast": 0.91, "saturated_share": 0.003},
        }
        for number in (1, 2, 3, 4)
    ]  # fmt: skip
    return {
        "state": "healthy" if live else "degraded",
        "problems": [] if live else [f"camera C{number} lost" for number in (1, 2, 3, 4)],
        "hints": ["camera C3: columns 500 to 530 are blind: clean the border there"],
        "up_s": 273845.0,
        "frame_sets_per_s": 100.0 if live else 0.0,
        "fusion": {
            "frame_sets": 27384500, "partial": 12, "skipped": 3, "touches_begun": 18320,
            "touches_now": 7, "faults": 0, "dropped": 0, "turns": 1, "ghosts": 214,
            "latency": {
                "bounds_s": [0.002, 0.004, 0.006, 0.008, 0.01, 0.012, 0.015, 0.02, 0.05, 0.1],
                "counts": [0, 90, 8100, 40210, 22400, 6400, 1900, 410, 60, 4, 1],
                "sum_s": 640.0,
            },
        },
        "cameras": cameras,
        "destinations": [
            {"host": "127.0.0.1", "port": 3333, "packets_sent": 27384123, "errors": 0,
             "fault": None},
        ],
        "light": {
            "port": "/dev/cornertouch/leds", "controller": "armed", "faults": [],
            "pattern": "steady", "levels": [200, 200, 200, 200], "dimmed": False,
            "temperature_c": 41.0, "connections": 1, "bad_messages": 0, "pictures": {},
            "masked": [],
        },
        "last": {"contacts": 7, "refused": 1, "skew_s": 0.0004, "least_support": 0.8},
        "process": {"cpu_s": 101234.5, "memory_bytes": 312_000_000},
        "cpu_share": 0.37,
        "version": "0.1.0",
        "calibrated_at": "2026-11-20T10:00:00+00:00",
        "residual_mm": 0.31,
    }  # fmt: skip


@dataclass
class Scene:
    """What the server shows; a test may change it while it is shown."""

    touches: int = 7
    token: str = ""
    may_act: bool = True
    cameras: int = 4
    live: bool = True
    moments: bool = True
    malformed: bool = False
    rate_hz: float = 60.0
    saved: list[dict[str, Any]] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    strips_wanted: list[bool] = field(default_factory=list)

    def moving(self, now_s: float) -> list[Touch]:
        width, height = SURFACE_MM
        across = max(1, math.ceil(math.sqrt(self.touches * width / height)))
        down = max(1, math.ceil(self.touches / across))
        found = []
        for number in range(self.touches):
            column, row = number % across, number // across
            turn = 0.9 * now_s + 1.7 * number
            reach = 0.34 * min(width / across, height / down)
            found.append(
                Touch(
                    id=100 + number,
                    x_mm=width * (column + 0.5) / across + reach * math.sin(1.3 * turn),
                    y_mm=height * (row + 0.5) / down + reach * math.cos(turn),
                    vx_mm_s=1.17 * reach * math.cos(1.3 * turn),
                    vy_mm_s=-0.9 * reach * math.sin(turn),
                    diameter_mm=9.0 + 5.0 * (number % 3) if self.touches < 40 else 9.0,
                    age_s=now_s % 1000.0,
                )
            )
        return found

    def contacts(self, touches: list[Touch]) -> list[Contact]:
        found = [
            Contact(
                touch.x_mm, touch.y_mm, touch.diameter_mm, 0.6 + 0.05 * (touch.id % 9),
                lean_deg=12.0 * (touch.id % 5),
                azimuth_deg=40.0 * touch.id % 360 if touch.id % 3 else math.nan,
            )
            for touch in touches
        ]  # fmt: skip
        if self.touches:
            found += [
                Contact(90.0, 320.0, 14.0, 0.2, refused=True),
                Contact(610.0, 70.0, 16.0, 0.5, touching=False),
                Contact(600.0, 300.0, 62.0, 0.8, kind=1),
            ]
        return found[:255]

    def lines(self, contacts: list[Contact]) -> dict[int, list[tuple[float, float]]]:
        shadows: dict[int, list[tuple[float, float]]] = {}
        for camera in range(self.cameras):
            x_mm, y_mm = CORNERS_MM[camera]
            shadows[camera] = []
            for contact in contacts:
                if contact.refused or len(shadows[camera]) == 200:
                    continue
                dx, dy = contact.x_mm - x_mm, contact.y_mm - y_mm
                half = contact.diameter_mm / 2 / math.hypot(dx, dy)
                angle = math.atan2(dy, dx)
                shadows[camera].append((angle - half, angle + half))
        return shadows


LOG = (
    ("INFO", "cornertouchd 0.1.0: 4 cameras, TUIO to 127.0.0.1:3333"),
    ("INFO", "camera C1: /dev/cornertouch/c1 gives 640x480 at 100 Hz"),
    ("WARNING", "camera C3: no picture for 0.50 s: opening it anew"),
    ("INFO", "camera C3: back after 0.8 s"),
    ("ERROR", "LED frame: /dev/cornertouch/leds: refused <b>3</b> messages & more"),
)
