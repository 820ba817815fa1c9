"""The expected error over the surface as a picture (PNG), for people."""

import cv2
import numpy as np

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.drawing import (
    INK,
    NOTHING,
    SMALL,
    TITLE_PX,
    WHITE,
    Image,
    blank,
    round_up,
    to_png,
    write,
    write_around,
    write_title,
)
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.model import BoolArray, FloatArray

LONG_SIDE_PX = 640
MARGIN_PX, LEGEND_PX = 56, 90
SMALLEST_WIDTH_PX = 520
"""The title needs it, however narrow the surface."""

NUMBER_SPACING_PX = 120
SHADES = 48
"""More cannot be told apart, and make the file larger than 100 kB."""

FIRST_SHADE = 30
"""Viridis is even to the eye and holds for the colour-blind; its darkest shades would look like
ink."""


def draw_error_map(calibration: Calibration) -> bytes:
    """Return the expected errors as a PNG: colours, numbers in mm, the cameras in their places.

    Grey is where fewer than two cameras have a directing line.
    """
    width_mm, height_mm = calibration.surface_mm
    px_mm = LONG_SIDE_PX / max(width_mm, height_mm)
    width, height = round(width_mm * px_mm), round(height_mm * px_mm)
    left, top = MARGIN_PX, TITLE_PX + MARGIN_PX
    image_width = max(width + 2 * MARGIN_PX + LEGEND_PX, SMALLEST_WIDTH_PX)
    image = blank(image_width, top + height + MARGIN_PX)

    errors, nowhere = _errors_by_pixel(calibration.expected, px_mm, (width, height))
    end_mm = round_up(float(np.nanmax(calibration.expected.errors_mm, initial=0.01)))
    surface = image[top : top + height, left : left + width]
    surface[:] = _colours(errors / end_mm)
    surface[nowhere] = NOTHING
    _write_numbers(surface, errors, nowhere)
    cv2.rectangle(image, (left, top), (left + width, top + height), INK, 2)
    for camera in calibration.cameras:
        x_mm, y_mm = camera.model.position_mm
        _draw_camera(
            image, camera.id, (left + x_mm * px_mm, top + y_mm * px_mm), y_mm < height_mm / 2
        )
    _draw_scale(image, (left + width + MARGIN_PX, top), height, end_mm)
    _write_title(image, calibration)
    return to_png(image)


def _errors_by_pixel(
    expected: ErrorMap, px_mm: float, size: tuple[int, int]
) -> tuple[FloatArray, BoolArray]:
    """Return the error of every pixel (height, width), and which of them have none."""
    unknown = ~np.isfinite(expected.errors_mm)
    known = np.where(unknown, 0.0, expected.errors_mm).astype(np.float32)
    columns, rows = (
        np.interp((np.arange(count) + 0.5) / px_mm, places, np.arange(len(places)))
        for count, places in zip(size, (expected.x_mm, expected.y_mm), strict=True)
    )
    across, down = (grid.astype(np.float32) for grid in np.meshgrid(columns, rows))
    share = cv2.remap((~unknown).astype(np.float32), across, down, cv2.INTER_LINEAR)
    errors = cv2.remap(known, across, down, cv2.INTER_LINEAR)
    return errors / np.maximum(share, 0.01), share < 0.5


def _colours(shares: FloatArray) -> Image:
    """Return the colours (..., 3) of shares of the scale."""
    steps = np.rint(np.clip(shares, 0.0, 1.0) * SHADES) / SHADES
    shades = (FIRST_SHADE + steps * (255 - FIRST_SHADE)).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(shades, cv2.COLORMAP_VIRIDIS), np.uint8)


def _write_numbers(surface: Image, errors: FloatArray, nowhere: BoolArray) -> None:
    height, width = errors.shape
    columns, rows = (
        np.linspace(0.0, side, max(2, round(side / NUMBER_SPACING_PX)) * 2 + 1)[1::2].astype(int)
        for side in (width, height)
    )
    for row in rows.tolist():
        for column in columns.tolist():
            if not nowhere[row, column]:
                text = f"{errors[row, column]:.2f}"
                write_around(surface, text, (column, row), SMALL, WHITE, outline=INK)


def _draw_camera(image: Image, name: str, place_px: tuple[float, float], above: bool) -> None:
    """Draw a dot at the camera, its name beyond it; a camera outside the picture at its border."""
    height, width = image.shape[:2]
    x = int(np.clip(place_px[0], MARGIN_PX / 2, width - MARGIN_PX / 2))
    y = int(np.clip(place_px[1], TITLE_PX + MARGIN_PX / 2, height - MARGIN_PX / 2))
    cv2.circle(image, (x, y), 8, WHITE, -1, cv2.LINE_AA)
    cv2.circle(image, (x, y), 6, INK, -1, cv2.LINE_AA)
    write_around(image, name, (x, y - 22 if above else y + 22), SMALL, INK)


def _draw_scale(image: Image, corner: tuple[int, int], height: int, end_mm: float) -> None:
    """Draw the colours from the largest error (top) to none, with numbers."""
    x, top = corner
    bar = np.linspace(1.0, 0.0, height)[:, None].repeat(20, axis=1)
    image[top : top + height, x : x + 20] = _colours(bar)
    for tick in range(5):
        y = top + round(tick * (height - 1) / 4)
        cv2.line(image, (x + 20, y), (x + 26, y), INK, 1)
        text = f"{end_mm * (4 - tick) / 4:.3g}"
        write(image, text, (x + 30, y + 5))
    write_around(image, "mm", (x + 10, top - 14), SMALL, INK)


def _write_title(image: Image, calibration: Calibration) -> None:
    width_mm, height_mm = calibration.surface_mm
    expected = calibration.expected
    title = (
        f"Expected error of a touch: RMS {expected.rms_mm:.2f} mm, worst {expected.worst_mm:.2f} mm"
    )
    origin = (
        f"method {calibration.method}, {width_mm:g} x {height_mm:g} mm, "
        f"{calibration.reference_points} taps, {calibration.scribble_points} scribbled, "
        f"{calibration.created_at[:10]}"
    )
    if not np.isfinite(expected.errors_mm).all():
        origin += "; grey: not located"
    write_title(image, title, origin, MARGIN_PX)
