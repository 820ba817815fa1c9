"""The empty strip over time as a picture (PNG), like Fig. 3 of Wang et al. 2011."""

from collections.abc import Sequence

import cv2
import numpy as np

from cornertouchd.calibration.drawing import (
    FONT,
    INK,
    LARGE,
    NOTHING,
    SMALL,
    TITLE_PX,
    Colour,
    Image,
    blank,
    round_up,
    to_png,
    write,
    write_around,
    write_before,
    write_title,
)
from cornertouchd.guiding.light_statistics import DimRun, LightStatistics
from cornertouchd.model import FloatArray

PANEL_PX = (640, 200)
"""Width and height of a camera's curves: a column of the usual camera is one pixel."""

LEFT_PX, RIGHT_PX, BETWEEN_PX, LEGEND_PX = 56, 264, 44, 36
"""Room for the axes and the text beside them."""

FULL_SCALE = 256.0
NOISE_SHARE = 0.3
"""The noise has the lowest part of a panel to itself, where only dim LEDs reach."""

MINIMUM: Colour = (178, 114, 0)
MAXIMUM: Colour = (0, 94, 213)
MEAN: Colour = INK
NOISE: Colour = (115, 158, 0)
DIM: Colour = (170, 225, 250)
"""Blue, vermilion, green and a pale orange of Okabe and Ito: apart for the colour-blind."""

SUBPIXEL_BITS = 4


def draw_strip_statistics(statistics: Sequence[LightStatistics]) -> bytes:
    """Return a panel for each camera as a PNG: brightness and noise by column, dim LEDs, T1.

    Grey is where no strip is seen.
    """
    width, height = PANEL_PX
    top = TITLE_PX + LEGEND_PX
    image = blank(LEFT_PX + width + RIGHT_PX, top + len(statistics) * (height + BETWEEN_PX))
    _write_title(image, statistics)
    _draw_legend(image, (LEFT_PX, TITLE_PX + LEGEND_PX // 2 - 4))
    noisiest = max((float(np.nanmax(one.noise_sigma)) for one in statistics), default=1.0)
    noise_end = round_up(max(noisiest, 0.1))
    for number, one in enumerate(statistics):
        corner = LEFT_PX, top + number * (height + BETWEEN_PX)
        _draw_panel(image, corner, one, noise_end)
        _write_findings(image, (LEFT_PX + width + 64, corner[1] + 14), one)
    return to_png(image)


def _draw_panel(
    image: Image, corner: tuple[int, int], one: LightStatistics, noise_end: float
) -> None:
    (left, top), (width, height) = corner, PANEL_PX
    panel = image[top : top + height, left : left + width]
    px_column = width / len(one.mean)
    unseen = ~np.isfinite(one.mean)
    panel[:, unseen[(np.arange(width) / px_column).astype(int)]] = NOTHING
    for run in one.dim_runs:
        panel[:, round(run.first_px * px_column) : round((run.last_px + 1) * px_column)] = DIM
    _draw_curve(panel, one.noise_sigma / noise_end * NOISE_SHARE, NOISE)
    _draw_curve(panel, one.minimum / FULL_SCALE, MINIMUM, 2)
    _draw_curve(panel, one.maximum / FULL_SCALE, MAXIMUM, 2)
    _draw_curve(panel, one.mean / FULL_SCALE, MEAN)
    cv2.rectangle(image, (left, top), (left + width, top + height), INK, 1)
    _draw_axes(image, corner, len(one.mean), noise_end)


def _draw_curve(panel: Image, shares: FloatArray, colour: Colour, thickness_px: int = 1) -> None:
    """Draw shares of the panel's height by column, with a gap where they are not known.

    Hard edges: smoothed ones would make the file four times as large.
    """
    height, width = panel.shape[:2]
    x = (np.arange(len(shares)) + 0.5) * width / len(shares)
    points = np.stack([x, (1.0 - shares) * height], axis=1) * 2**SUBPIXEL_BITS
    known = np.flatnonzero(np.isfinite(shares))
    runs = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    lines = [np.rint(points[run]).astype(np.int32) for run in runs if len(run)]
    cv2.polylines(panel, lines, False, colour, thickness_px, cv2.LINE_8, SUBPIXEL_BITS)


def _draw_axes(image: Image, corner: tuple[int, int], columns: int, noise_end: float) -> None:
    """Draw grey levels at the left, columns below, the noise at the right."""
    (left, top), (width, height) = corner, PANEL_PX
    bottom, right = top + height, left + width
    for level in range(0, 257, 64):
        y = bottom - round(level / FULL_SCALE * height)
        cv2.line(image, (left - 6, y), (left, y), INK, 1)
        write_before(image, f"{level}", (left - 10, y + 5))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        x = left + round(share * width)
        cv2.line(image, (x, bottom), (x, bottom + 6), INK, 1)
        write_around(image, f"{share * columns:.0f}", (x, bottom + 16), SMALL, INK)
    for share in (0.0, 1.0):
        y = bottom - round(share * NOISE_SHARE * height)
        cv2.line(image, (right, y), (right + 6, y), NOISE, 1)
        write(image, f"{share * noise_end:g}", (right + 10, y + 5), SMALL, NOISE)


def _write_findings(image: Image, start: tuple[int, int], one: LightStatistics) -> None:
    x, y = start
    write(image, one.camera, start, LARGE)
    t1 = one.suggested_t1
    lines = (
        "no T1 keeps fingers apart" if t1 is None else f"suggested T1 {t1:.0f}",
        f"gradient: strip up to {one.strip_gradient:.0f},",
        f"fingers from {one.finger_gradient:.0f}",
        f"signal / noise {one.signal_to_noise:.0f}",
        *_dim_lines(one.dim_runs),
    )
    for number, line in enumerate(lines, start=1):
        write(image, line, (x, y + 22 * number))


def _dim_lines(runs: Sequence[DimRun]) -> tuple[str, ...]:
    if not runs:
        return ("no dim LEDs",)
    first = min(runs, key=lambda run: run.share)
    return (
        f"{len(runs)} dim LED" + ("s, worst" if len(runs) > 1 else ""),
        f"{first.first_px}-{first.last_px}: {first.share:.0%} of its light",
    )


def _draw_legend(image: Image, start: tuple[int, int]) -> None:
    x, y = start
    for name, colour, half_px in (
        ("minimum", MINIMUM, 1),
        ("mean", MEAN, 1),
        ("maximum", MAXIMUM, 1),
        ("noise, standard deviation (right)", NOISE, 1),
        ("dim LEDs", DIM, 7),
        ("no strip", NOTHING, 7),
    ):
        cv2.rectangle(image, (x, y - half_px), (x + 24, y + half_px), colour, -1)
        write(image, name, (x + 32, y + 5))
        x += 60 + cv2.getTextSize(name, FONT, SMALL, 1)[0][0]


def _write_title(image: Image, statistics: Sequence[LightStatistics]) -> None:
    pictures = min((one.pictures for one in statistics), default=0)
    write_title(
        image,
        "The empty strip over time, column by column",
        f"3x3 mean along the strip line, {pictures} pictures a camera; grey levels of 8 bits",
        LEFT_PX,
    )
