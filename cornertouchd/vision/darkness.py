"""What pictures without LEDs show, pixel by pixel: sun and lamps, on the strip and on fingers.

Averaged where it stays as it is, so that its noise does not add to that of the lit pictures; taken
at once where it changes, as it does on a finger that moves.
"""

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import compiled
from cornertouchd.model import FloatArray, Picture

PIXEL_CHANGE_GREY, COLUMN_CHANGE_GREY = 6.0, 3.0
"""Two standard deviations of noise at 60 % of full scale, of a pixel and of the mean of a column's
(rendered pictures): what changes by more is no noise."""

MeanPicture = NDArray[np.float32]


def follow_pixels(mean: MeanPicture, dark: Picture, share: float) -> MeanPicture:
    """Return the mean of dark pictures (rows, width_px), moved by `share` towards another one."""
    return _follow_pixels(mean, dark, share, PIXEL_CHANGE_GREY)


def follow_columns(mean: FloatArray, dark: FloatArray, share: float) -> FloatArray:
    """Return the mean of dark columns (width_px,), moved by `share` towards those of another."""
    change = dark - mean
    return mean + np.where(np.abs(change) > COLUMN_CHANGE_GREY, 1.0, share) * change


def unevenness(seen: FloatArray, expected: FloatArray) -> float:
    """Return by how much columns differ from the light expected, but for a factor."""
    ratio = seen / np.maximum(expected, 1.0)
    usual = float(np.median(ratio))
    return float(np.median(np.abs(ratio - usual))) / max(abs(usual), 0.01)


@compiled(
    "u1[:,::1](Array(u1, 2, 'A', readonly=True), Array(f4, 2, 'C', readonly=True), f8[::1], f8)"
)
def light_of_leds(
    picture: Picture, dark: MeanPicture, black: FloatArray, saturated_grey: float
) -> Picture:
    """Return what LEDs add to dark pictures, on top of the black of each column (width_px,).

    The sun lights the rows of a column differently, and fingers from one side only: one black for
    all rows, that of the horizon, moves touches by .1 mm (rendered pictures).  What is at full
    scale stays there.
    """
    height, width = picture.shape
    leds = np.empty((height, width), np.uint8)
    for row in range(height):
        for column in range(width):
            grey = float(picture[row, column])
            if grey < saturated_grey:
                grey += black[column] - dark[row, column] + 0.5
                grey = min(max(grey, 0.0), 255.0)
            leds[row, column] = int(grey)
    return leds


@compiled("f4[:,::1](Array(f4, 2, 'C', readonly=True), Array(u1, 2, 'A', readonly=True), f8, f8)")
def _follow_pixels(
    mean: MeanPicture, dark: Picture, share: float, change_grey: float
) -> MeanPicture:
    followed = np.empty(mean.shape, np.float32)
    part, limit = np.float32(share), np.float32(change_grey)
    for row in range(mean.shape[0]):
        for column in range(mean.shape[1]):
            change = np.float32(dark[row, column]) - mean[row, column]
            if abs(change) <= limit:
                change *= part
            followed[row, column] = mean[row, column] + change
    return followed
