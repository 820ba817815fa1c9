"""Is a camera fit to be calibrated?  What its pictures of the empty surface say, and the remedy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.calibration.heights import heights_of_camera, what_moved
from cornertouchd.guiding.strip_light import FULL_SCALE, StripLight, measure_strip_light
from cornertouchd.model import FloatArray, Picture
from cornertouchd.vision.strip import Strip, StripNotFoundError, find_strip

Severity = Literal["bad", "doubtful"]
Kind = Literal[
    "strip",
    "level",
    "saturation",
    "ambient",
    "flicker",
    "focus",
    "band",
    "dark columns",
    "view",
    "moved",
]

GOOD_LEVELS = (0.6, 0.9)
USABLE_LEVELS = (0.25, 0.97)
TARGET_LEVEL = 0.75
"""Above 60 % of full scale a shadow stands out by a hundred times the noise; the ripple of the
LEDs reaches 15 % over the level and would be cut off beyond 90 %."""


@dataclass(frozen=True, slots=True)
class Limits:
    """From where on a measure is doubtful, and from where on bad."""

    doubtful: float
    bad: float

    def severity(self, value: float) -> Severity | None:
        """Return what is to be said of a value; None of one that is good, or NaN."""
        if value > self.bad:
            return "bad"
        return "doubtful" if value > self.doubtful else None


MOSTLY = 0.5
"""With more of the strip at full scale its level is only known to be higher than that."""

GENTLE_STEP = 0.85
"""What takes the ripple of the LEDs off full scale when their mean is below it."""

SATURATED = Limits(0.02, 0.15)
"""Where light is cut off, depth and edges of a shadow are wrong.  The brightest LEDs of a good
picture (80 % of full scale) touch full scale in .3 % of the columns, in the sun in 25 %."""

AMBIENT = Limits(0.05, 0.15)
"""Stray light in a good picture is .5 % of the strip's, beside a sunlit side 20 % and more."""

FLICKER = Limits(0.03, 0.08)
"""`vision.gain` evens it out, but not within one picture; good LEDs and cameras show .5 %."""

BLUR_PX = Limits(1.6, 3.0)
"""Edges are exact to a tenth of their blur, and the settings take .9 px for granted."""

DARK_COLUMNS = Limits(0.05, 0.2)
"""Frame corners and the far camera darken 2 %; a side of the frame is 30 % and more."""

SMALLEST_MARGIN_PX, CUT_OFF_PX = 4.0, 1.5
"""Rows between strip and border of the picture: the strip finder needs one, a lens that warms up
or a knock moves the picture by two."""

SMALLEST_VIEW = 0.6
"""Even a lens of 115 degrees shows the two far sides in three quarters of its columns."""

NOISE_LEVELS = 25.0
"""Grey levels from one picture to the next; a sensor has under 5, a bad cable 50 and more."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that is not as it should be; the text has the number and the remedy."""

    kind: Kind
    severity: Severity
    text: str


@dataclass(frozen=True, slots=True)
class InForce:
    """The calibration in force of a camera whose pictures have the same format now."""

    camera: CameraCalibration
    surface_mm: tuple[float, float]


@dataclass(frozen=True, slots=True)
class CameraCheck:
    """What was found out about one camera; `light` is None when no strip was found."""

    camera: str
    light: StripLight | None
    findings: tuple[Finding, ...]

    @property
    def verdict(self) -> Literal["good", "doubtful", "bad"]:
        """The worst of the findings; good if there are none."""
        severities = {finding.severity for finding in self.findings}
        if "bad" in severities:
            return "bad"
        return "doubtful" if severities else "good"


def check_camera(
    camera_id: str,
    pictures: Sequence[Picture] | Picture,
    dark: Sequence[Picture] | Picture | None = None,
    in_force: InForce | None = None,
) -> CameraCheck:
    """Judge one camera by its pictures of the empty surface, (N, rows, width_px).

    `dark` are pictures taken with all LEDs off, if there are any.  With a calibration `in_force` it
    is told whether the camera has moved since.
    """
    stack = np.asarray(pictures, np.uint8)
    if not len(stack):
        nothing = Finding("strip", "bad", "no picture came: check cable, power and USB port")
        return CameraCheck(camera_id, None, (nothing,))
    mean = stack.mean(axis=0)
    try:
        strip = find_strip(mean)
    except StripNotFoundError as error:
        return CameraCheck(camera_id, None, (_why_no_strip(stack, mean, str(error)),))
    dark_mean = None if dark is None or not len(dark) else np.asarray(dark, np.uint8).mean(axis=0)
    light = measure_strip_light(stack, mean, strip, dark_mean)
    findings = (
        _level(light),
        _saturation(light),
        _ambient(light),
        _flicker(light),
        _focus(light),
        _band(light),
        _dark_columns(light),
        _view(light),
        _moved(camera_id, strip, in_force),
    )
    return CameraCheck(camera_id, light, tuple(one for one in findings if one is not None))


def _why_no_strip(stack: NDArray[np.uint8], mean: FloatArray, reason: str) -> Finding:
    noise = float(np.median(stack.std(axis=0)))
    if noise > NOISE_LEVELS:
        reason = (
            f"pictures are noise: pixels change by {noise:.0f} of 255 from one to the next; "
            "check the cable and its plugs, try another USB port"
        )
    elif (full := float(np.mean(mean >= FULL_SCALE - 1))) > 0.25:
        reason = (
            f"{full:.0%} of the picture is at full scale: lower the exposure to a quarter, and "
            "keep sun and lamps off the frame"
        )
    elif float(np.percentile(mean, 99.5)) < USABLE_LEVELS[0] * FULL_SCALE:
        reason += "; look whether something covers the lens"
    return Finding("strip", "bad", reason)


def _level(light: StripLight) -> Finding | None:
    low, high = GOOD_LEVELS
    if low <= light.level_share <= high:
        return None
    usable = USABLE_LEVELS[0] <= light.level_share <= USABLE_LEVELS[1]
    remedy = (
        f"raise the exposure or the LED current {light.factor_to(TARGET_LEVEL):.1f} times"
        if light.level_share < low
        else _less_exposure(light)
    )
    return Finding(
        "level",
        "doubtful" if usable else "bad",
        f"the strip is at {light.level_share:.1%} of full scale ({low:.0%} to {high:.0%} is "
        f"good): {remedy}",
    )


def _less_exposure(light: StripLight) -> str:
    if light.saturated_share > MOSTLY:
        return "halve the exposure and check again: how bright the strip really is cannot be seen"
    factor = min(light.factor_to(TARGET_LEVEL), GENTLE_STEP)
    return f"lower the exposure or the LED current to {factor:.0%} of what it is"


def _saturation(light: StripLight) -> Finding | None:
    severity = SATURATED.severity(light.saturated_share)
    if severity is None or light.level_share > GOOD_LEVELS[1]:  # then the level has told it
        return None
    remedy = (
        "keep sun and lamps off the frame"
        if AMBIENT.severity(light.ambient_share)
        else _less_exposure(light)
    )
    return Finding(
        "saturation",
        severity,
        f"{light.saturated_share:.1%} of the strip's columns are at full scale "
        f"({SATURATED.doubtful:.0%} at most is good): {remedy}",
    )


def _ambient(light: StripLight) -> Finding | None:
    severity = AMBIENT.severity(light.ambient_share)
    if severity is None:
        return None
    return Finding(
        "ambient",
        severity,
        f"stray light is {light.ambient_share:.1%} as bright as the strip ({AMBIENT.doubtful:.0%} "
        "at most is good): draw a curtain, move lamps, or more LED current and less exposure",
    )


def _flicker(light: StripLight) -> Finding | None:
    severity = FLICKER.severity(light.flicker_share)
    if severity is None:
        return None
    return Finding(
        "flicker",
        severity,
        f"the strip's brightness changes by {light.flicker_share:.1%} between pictures "
        f"({FLICKER.doubtful:.0%} at most is good): switch automatic exposure and gain off; let "
        "the LED frame trigger the cameras, or drive the LEDs without dimming",
    )


def _focus(light: StripLight) -> Finding | None:
    severity = BLUR_PX.severity(light.blur_px)
    if severity is None:
        return None
    return Finding(
        "focus",
        severity,
        f"edges are blurred by {light.blur_px:.1f} px ({BLUR_PX.doubtful:g} at most is good): "
        "focus and clean the lens, or set vision.edge_blur_px",
    )


def _band(light: StripLight) -> Finding | None:
    above, below = light.rows_above_px, light.rows_below_px
    if min(above, below) >= SMALLEST_MARGIN_PX:
        return None
    end, border, way = ("upper", "first", "up") if above < below else ("lower", "last", "down")
    off_centre = abs(above - below) / 2
    missing = 2 * (SMALLEST_MARGIN_PX - (above + below) / 2)
    remedy = f"move it {way} by {np.ceil(off_centre):.0f} rows or more (row_offset_px)"
    if missing > 0:
        remedy += f" and make it {np.ceil(missing):.0f} rows higher (rows_px)"
    return Finding(
        "band",
        "bad" if min(above, below) < CUT_OFF_PX else "doubtful",
        f"the strip's {end} end comes within {min(above, below):.1f} px of the band's {border} "
        f"row ({SMALLEST_MARGIN_PX:g} or more is good): {remedy}",
    )


def _dark_columns(light: StripLight) -> Finding | None:
    severity = DARK_COLUMNS.severity(light.dark_columns_share)
    if severity is None:
        return None
    first, last = light.widest_dark_run
    return Finding(
        "dark columns",
        severity,
        f"{light.dark_columns_share:.1%} of the columns are dark, most of them {first} to {last}: "
        "are all sides of the LED frame on, and nothing before the lens?",
    )


def _view(light: StripLight) -> Finding | None:
    if light.visible_share >= SMALLEST_VIEW or DARK_COLUMNS.severity(light.dark_columns_share):
        return None
    return Finding(
        "view",
        "doubtful",
        f"the strip is clear in only {light.visible_share:.1%} of the columns "
        f"({SMALLEST_VIEW:.0%} or more is good): mend what else is told of this camera, or turn "
        "it to the far corner",
    )


def _moved(camera_id: str, strip: Strip, in_force: InForce | None) -> Finding | None:
    if in_force is None or in_force.camera.heights is None:
        return None
    found = heights_of_camera(camera_id, strip, in_force.camera.model, in_force.surface_mm)
    if found is None:
        return None
    moved = what_moved(in_force.camera.heights, found, len(strip.visible))
    if moved is None:
        return None
    return Finding(
        "moved",
        "doubtful",
        f"{moved} since the calibration in force; fasten it well: the new one takes it as it "
        "stands now",
    )
