"""What the live page is told, as bytes: moments and strips, little-endian.

The same bytes go through the daemon's socket, each message after its length (u32), and to browsers
as binary WebSocket messages.  docs/live-protocol.md describes them.
"""

import struct
from collections.abc import Iterator, Sequence
from math import degrees, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cornertouchd.model import Contact, DirectingLines, FrameSet, Touch
from cornertouchd.vision.strip_view import StripView

MOMENT, STRIP = 1, 2
MOST = 255
"""Touches, contacts, cameras, shadows of a camera: each count is one byte."""

BRIGHTNESS_STEPS = 200.0
BRIGHTEST = 250

TOUCHING, REFUSED = 1, 8
KINDS = {"finger": 0, "palm": 2, "pen": 4}

_LENGTH = struct.Struct("<I")
_MOMENT = struct.Struct("<BBBBdff")
_TOUCH = struct.Struct("<iffffff")
_CONTACT = struct.Struct("<ffffffB3x")
_CAMERA = struct.Struct("<BBH")
_STRIP = struct.Struct("<BBHHHdffff")


class Moment(NamedTuple):
    """What came of one frame set, and when that had been told.

    `refused` are contacts that were found and not believed.  A tuple, since it is made for every
    frame set.
    """

    frame_set: FrameSet
    contacts: Sequence[Contact]
    touches: Sequence[Touch]
    refused: Sequence[Contact]
    told_at_s: float


def with_length(message: bytes) -> bytes:
    """Return a message as it goes through the daemon's socket."""
    return _LENGTH.pack(len(message)) + message


def encode_moment(moment: Moment, lines: Sequence[tuple[int, DirectingLines]]) -> bytes:
    """Return a moment as a message.

    `lines` are the directing lines of each camera that saw shadows, with its number.
    """
    at_s = moment.frame_set.captured_at_s
    captured = [seen.captured_at_s for seen in moment.frame_set.observations] or [at_s]
    touches, lines = moment.touches[:MOST], lines[:MOST]
    contacts = [*_contacts(moment)][:MOST]
    return b"".join(
        (
            _MOMENT.pack(
                MOMENT,
                len(touches),
                len(contacts),
                len(lines),
                at_s,
                1000.0 * (moment.told_at_s - at_s),
                1000.0 * (max(captured) - min(captured)),
            ),
            *map(_touch, touches),
            *contacts,
            *(_camera(number, one) for number, one in lines),
        )
    )


def _touch(touch: Touch) -> bytes:
    return _TOUCH.pack(
        touch.id,
        touch.x_mm,
        touch.y_mm,
        touch.vx_mm_s,
        touch.vy_mm_s,
        touch.diameter_mm,
        touch.age_s,
    )


def _contacts(moment: Moment) -> Iterator[bytes]:
    for contact in moment.contacts:
        yield _contact(contact, 0)
    for contact in moment.refused:
        yield _contact(contact, REFUSED)


def _contact(contact: Contact, refused: int) -> bytes:
    lean = contact.lean
    return _CONTACT.pack(
        contact.x_mm,
        contact.y_mm,
        contact.diameter_mm,
        contact.confidence,
        nan if lean is None else degrees(lean.angle_rad),
        nan if lean is None else degrees(lean.azimuth_rad),
        (TOUCHING if contact.touching else 0) | KINDS[contact.kind] | refused,
    )


def _camera(number: int, lines: DirectingLines) -> bytes:
    bounds = np.column_stack((lines.first_rad, lines.last_rad))[:MOST]
    return _CAMERA.pack(number, len(bounds), 0) + bounds.astype("<f4").tobytes()


def encode_strip(camera: int, view: StripView) -> bytes:
    """Return what a camera sees as a message; `camera` is its number."""
    rows, width = view.picture.shape
    edges = view.edges_px.astype("<f4")
    return b"".join(
        (
            _STRIP.pack(
                STRIP,
                camera,
                width,
                rows,
                len(edges),
                view.captured_at_s,
                view.level,
                view.contrast,
                view.dark_level,
                0.0,
            ),
            view.picture.tobytes(),
            _grey(view.brightness * BRIGHTNESS_STEPS, BRIGHTEST).tobytes(),
            _grey(view.reference, 255).tobytes(),
            (~view.known).astype(np.uint8).tobytes(),
            edges.tobytes(),
        )
    )


def _grey(values: NDArray[np.float64], largest: int) -> NDArray[np.uint8]:
    return np.clip(np.nan_to_num(values) + 0.5, 0, largest).astype(np.uint8)
