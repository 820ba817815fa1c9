"""What the pictures (PNG) of a calibration have in common: ink, text, axes that end evenly."""

from math import floor, log10

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]
"""Blue, green, red, as OpenCV wants them."""

WHITE: Colour = (255, 255, 255)
INK: Colour = (45, 45, 45)
NOTHING: Colour = (205, 205, 205)
"""Where there is nothing to tell."""

FONT = cv2.FONT_HERSHEY_SIMPLEX
SMALL, LARGE = 0.5, 0.7
TITLE_PX = 76
"""Height of what `write_title` fills."""


def blank(width_px: int, height_px: int) -> Image:
    """Return a white picture, (height_px, width_px, 3)."""
    return np.full((height_px, width_px, 3), 255, np.uint8)


def to_png(image: Image) -> bytes:
    """Return the picture as a PNG, as small as can be."""
    _, png = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return png.tobytes()


def write(
    image: Image, text: str, start: tuple[int, int], size: float = SMALL, colour: Colour = INK
) -> None:
    """Write text to the right of a place on its base line."""
    cv2.putText(image, text, start, FONT, size, colour, 1, cv2.LINE_AA)


def write_before(image: Image, text: str, end: tuple[int, int], colour: Colour = INK) -> None:
    """Write small text that ends at a place on its base line."""
    wide, _ = cv2.getTextSize(text, FONT, SMALL, 1)[0]
    write(image, text, (end[0] - wide, end[1]), SMALL, colour)


def write_around(
    image: Image,
    text: str,
    centre: tuple[int, int],
    size: float,
    colour: Colour,
    outline: Colour | None = None,
) -> None:
    """Write text around a centre, with an outline where the ground may be of any colour."""
    wide, high = cv2.getTextSize(text, FONT, size, 1)[0]
    start = (centre[0] - wide // 2, centre[1] + high // 2)
    if outline is not None:
        cv2.putText(image, text, start, FONT, size, outline, 3, cv2.LINE_AA)
    write(image, text, start, size, colour)


def write_title(image: Image, title: str, origin: str, margin_px: int) -> None:
    """Write what the picture shows, and below it of what; smaller where there is no room."""
    for text, size, y in ((title, LARGE, 34), (origin, SMALL, 62)):
        room = image.shape[1] - margin_px
        fitting = size * min(1.0, room / cv2.getTextSize(text, FONT, size, 1)[0][0])
        write(image, text, (margin_px // 2, y), fitting)


def round_up(value: float) -> float:
    """Return the next larger number whose quarters are short; the value is above 0."""
    power = 10.0 ** floor(log10(value))
    steps = (1.0, 1.2, 1.6, 2.0, 2.4, 3.2, 4.0, 6.0, 8.0, 10.0)
    return float(next(step * power for step in steps if step * power >= value))
