"""Follow how the empty strip looks while touches come and go: LEDs, exposure, sun, dark pictures.

A column is followed where nothing stands before it, and behind a touch the strip is taken to
change as it does on either side: so what rests never becomes background.  Time arrives with the
pictures.
"""

from dataclasses import dataclass
from math import exp
from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import compiled, inlined
from cornertouchd.config import BackgroundSettings, VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Picture, Shadows
from cornertouchd.vision.darkness import MeanPicture, follow_columns, follow_pixels, unevenness
from cornertouchd.vision.dead_leds import DeadLeds, how_dim
from cornertouchd.vision.filling import fill_in
from cornertouchd.vision.finder import ProfileFinder
from cornertouchd.vision.gain import most_frequent_brightness
from cornertouchd.vision.profile import Measured
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.shadows import find_shadows, is_cover

LEARN_EVERY_S = 0.05
"""Twenty times a second is plenty for what takes half a minute, and costs nothing."""

LONGEST_STEP_S = 1.0
"""After a pause one picture does not count for more than this."""

FEWEST_MASKED = 3
"""Fewer columns are the blurred end of the view or the camera in the far corner (rendered)."""


FEWEST_FRESH = 20
"""With fewer columns in the light nothing is known of the others: the LEDs are off, or a hand is
over the lens."""

NOISE_GREY = 5.0
"""The brightest pixel of a column is this steady."""

LIGHT_FROM_OUTSIDE = 1.3
"""A strip this much brighter than when it was calibrated is lit by more than its LEDs."""


LESS_LIGHT = "lower the exposure, shade the sun, or let the LED frame send dark frames"
MEND_THE_LED = "replace the LED, or take away what covers it"
UNCOVER_THE_LENS = "uncover the lens, and see whether the LED frame shines and the exposure is set"

LARGEST_SHARE_IN_THE_DARK = 0.75
"""Of the light of the last lit picture, over the black of the calibration; more is the strip
itself, in spite of what the picture is labelled."""


class NotDarkError(Exception):
    """A picture that is said to be dark is as bright as those with the LEDs on."""


@dataclass(frozen=True, slots=True)
class MaskedColumns:
    """Columns first_px to last_px see little or nothing: why, and what to do."""

    first_px: int
    last_px: int
    why: str
    remedy: str

    def __str__(self) -> str:
        where = f"columns {self.first_px}..{self.last_px}"
        return f"{where} see little or nothing: {self.why}; {self.remedy}"


class Sight(NamedTuple):
    """What one picture gave.  A tuple, since it is made for every picture."""

    captured_at_s: float
    measured: Measured
    shadows: Shadows


class Background:
    """The empty strip of one camera, now.  Owned by one thread; any may read `masked_columns`.

    `look` and then `learn` for every picture with all LEDs lit, `learn_dark` for those with none.
    """

    def __init__(
        self, finder: ProfileFinder, vision: VisionSettings, settings: BackgroundSettings
    ) -> None:
        self._sampler = finder.sampler
        self._vision = vision
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Go back to the empty pictures of the calibration; forget dark pictures."""
        self._reference = self._sampler.reference
        self._gain = 1.0
        self._learned_at_s: float | None = None
        self._lit: Measured | None = None
        self._dark_at_s: float | None = None
        self._dark: MeanPicture | None = None
        self._known = self._reference.usable
        self._covered = False
        self._dead = DeadLeds(len(self._known))
        self._suspected: BoolArray | None = None

    def suspect(self, columns: BoolArray) -> None:
        """Mask what is dark of these columns (width_px,) in the next picture: LEDs are dead."""
        self._suspected = columns

    def look(self, picture: Picture, captured_at_s: float) -> Sight:
        """Return what a picture (rows, width_px) shows, measured against the strip as it is now.

        Raises `NoiseError` for a picture that cannot show the strip.
        """
        self._forget_old_darkness(captured_at_s)
        measured = self._sampler.measure(picture, self._reference, self._gain)
        if self._follow_dead_leds(measured):
            measured = self._sampler.measure(picture, self._reference, self._gain)
        measured.require_strip()
        shadows = find_shadows(
            measured.profile,
            self._vision,
            sunlit=measured.sunlit,
            hiding=self._reference.on_strip,
        )
        self._known = measured.profile.known
        self._covered = is_cover(shadows, self._reference.on_strip)
        return Sight(captured_at_s, measured, shadows)

    def learn(self, sight: Sight) -> None:
        """Follow what a picture shows of the empty strip."""
        measured, at_s = sight.measured, sight.captured_at_s
        self._gain = measured.gain
        self._lit = measured
        if self._learned_at_s is None or at_s < self._learned_at_s:
            self._learned_at_s = at_s
        passed_s = at_s - self._learned_at_s
        if not self._settings.learn or passed_s < LEARN_EVERY_S:
            return
        self._learned_at_s = at_s
        share = 1.0 - exp(-min(passed_s, LONGEST_STEP_S) / self._settings.time_constant_s)
        light, peak, anchor = _follow(
            self._reference.black,
            self._reference.light,
            self._sampler.reference.scale,
            self._reference.peak,
            measured.light,
            measured.peak,
            measured.profile.brightness,
            measured.profile.known,
            sight.shadows.edges_px,
            sight.shadows.depth,
            measured.gain,
            share,
            self._vision.shadow_below,
            self._settings.margin_px,
        )
        self._gain = measured.gain * anchor
        self._refer_to(self._reference.black, light, peak)

    def learn_dark(self, picture: Picture, captured_at_s: float) -> None:
        """Take the light of the surroundings from a picture (rows, width_px) without any LED.

        Raises `NotDarkError` if the strip is lit.
        """
        seen = self._sampler.measure(picture, self._reference).light
        reference, black = self._reference, self._sampler.reference.black
        lit = reference.light if self._lit is None else self._lit.light - black
        share_lit = (seen - black) / np.maximum(lit, 1.0)
        if float(np.median(share_lit[reference.on_strip])) > LARGEST_SHARE_IN_THE_DARK:
            raise NotDarkError(
                "the strip is lit in a picture that is said to be taken without LEDs"
            )
        before_s, self._dark_at_s = self._dark_at_s, captured_at_s
        if self._dark is None or before_s is None or captured_at_s < before_s:
            self._dark = picture.astype(np.float32)
            if self._is_new_light(seen):
                self._refer_to(seen, reference.light, reference.peak)
            else:
                self._darken(seen)
            return
        share = 1.0 - exp((before_s - captured_at_s) / self._settings.ambient_smoothing_s)
        self._dark = follow_pixels(self._dark, picture, share)
        black = follow_columns(reference.black, seen, share)
        self._refer_to(black, reference.light, reference.peak)

    @property
    def reference(self) -> Reference:
        """The empty strip as it is now: what the next picture is measured against."""
        return self._reference

    @property
    def dark(self) -> MeanPicture | None:
        """What pictures without LEDs show (rows, width_px), while there are such."""
        return self._dark

    @property
    def masked_columns(self) -> tuple[MaskedColumns, ...]:
        """The columns of the strip that are blind now, from left to right.

        In the sun, those that are at full scale without a touch, too: shadows show there, but not
        those of fingers that the sun lights up.
        """
        reference, known = self._reference, self._known
        strip = reference.on_strip
        ends = np.flatnonzero(strip)[[0, -1]].tolist()
        if self._covered:
            return (MaskedColumns(ends[0], ends[1], "all of the strip is dark", UNCOVER_THE_LENS),)
        usual = max(float(np.median(reference.light[strip])), 1.0)
        dim = [
            MaskedColumns(
                first, last, how_dim(reference.light[first : last + 1] / usual), MEND_THE_LED
            )
            for first, last in _runs(strip & ~reference.usable)
            if first > ends[0] and last < ends[1]  # where the view ends the strip fades
        ]
        full = ~known
        if reference.sunlit:
            full |= reference.peak >= self._vision.saturated_grey
        bright = [
            MaskedColumns(first, last, "at full scale, by light from outside", LESS_LIGHT)
            for first, last in _runs(reference.usable & full)
        ]
        return tuple(sorted(dim + bright, key=lambda one: one.first_px))

    def _follow_dead_leds(self, measured: Measured) -> bool:
        """Mask what is suspected and dark, unmask what shines again; tell whether that changed."""
        reference, suspected = self._reference, self._suspected
        light = self._dead.follow(suspected, measured, reference)
        self._suspected = None
        if light is not None:
            self._refer_to(reference.black, light, reference.peak)
        return light is not None

    def _is_new_light(self, dark: FloatArray) -> bool:
        """Tell whether what the first dark picture shows is no part yet of the light as learned.

        So it is when the sun has shone since before the start, but not when the rig was calibrated:
        what the last lit picture shows more is then as the light was, column by column.
        """
        reference = self._reference
        if self._lit is None:
            return False
        strip, leds = reference.on_strip, self._lit.light - dark
        without = reference.light + (reference.black - dark) / self._gain
        return unevenness(leds[strip], reference.light[strip]) < unevenness(
            leds[strip], without[strip]
        )

    def _forget_old_darkness(self, now_s: float) -> None:
        """Without dark pictures the surroundings count as a part of the strip's light again."""
        if self._dark_at_s is None:
            return
        if not 0.0 <= now_s - self._dark_at_s <= self._settings.ambient_age_s:
            self._dark_at_s = self._dark = None
            self._darken(self._sampler.reference.black)

    def _darken(self, black: FloatArray) -> None:
        """Measure from another black on; how bright the lit strip should be stays as it was."""
        reference = self._reference
        light = reference.light + (reference.black - black) / self._gain
        self._refer_to(black, light, reference.peak)

    def _refer_to(self, black: FloatArray, light: FloatArray, peak: FloatArray) -> None:
        self._reference = Reference.of(
            black, light, peak, self._reference.least_light, self._vision.saturated_grey
        )


def _runs(chosen: BoolArray) -> list[tuple[int, int]]:
    """Return first and last column of every run that is long enough to be told."""
    steps = np.diff(chosen.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(steps > 0), np.flatnonzero(steps < 0)
    return [
        (int(start), int(stop) - 1)
        for start, stop in zip(starts, stops, strict=True)
        if stop - start >= FEWEST_MASKED
    ]


@inlined
def _covered_columns(
    brightness: FloatArray, edges_px: FloatArray, depth: FloatArray, below: float, margin_px: int
) -> BoolArray:
    """Tell the columns of shadows, with all that is dark around them and a margin."""
    width = len(brightness)
    covered = np.zeros(width, np.bool_)
    for number in range(len(depth)):
        if depth[number] > 0.0:
            first = min(max(int(edges_px[number, 0]), 0), width - 1)
            last = min(max(int(edges_px[number, 1]), first), width - 1)
            while first > 0 and brightness[first - 1] < below:
                first -= 1
            while last < width - 1 and brightness[last + 1] < below:
                last += 1
            for column in range(max(first - margin_px, 0), min(last + margin_px + 1, width)):
                covered[column] = True
    return covered


@inlined
def _take_over_where_light_went(
    now: FloatArray,
    seen_peak: FloatArray,
    light: FloatArray,
    calibrated_scale: FloatArray,
    edges_px: FloatArray,
    depth: FloatArray,
    below: float,
    new_light: FloatArray,
    new_peak: FloatArray,
    relative: FloatArray,
) -> None:
    """Take the strip as it is where all that made a shadow is that the sun or a lamp has gone.

    There each column was learned much brighter than it was calibrated, and is as bright as then.
    """
    width = len(now)
    for number in range(len(depth)):
        first = min(max(int(edges_px[number, 0]), 0), width - 1)
        last = min(max(int(edges_px[number, 1]), first), width - 1)
        went = depth[number] > 0.0
        for column in range(first, last + 1):
            went &= light[column] * calibrated_scale[column] > LIGHT_FROM_OUTSIDE
            went &= now[column] * calibrated_scale[column] >= below
        if went:
            for column in range(first, last + 1):
                new_light[column], new_peak[column] = now[column], seen_peak[column]
                relative[column] = now[column] * calibrated_scale[column]


@compiled(
    "Tuple((f8[::1], f8[::1], f8))(f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], "
    "b1[::1], f8[:,::1], f8[::1], f8, f8, f8, i8)"
)
def _follow(
    black: FloatArray,
    light: FloatArray,
    calibrated_scale: FloatArray,
    peak: FloatArray,
    seen_light: FloatArray,
    seen_peak: FloatArray,
    brightness: FloatArray,
    known: BoolArray,
    edges_px: FloatArray,
    depth: FloatArray,
    gain: float,
    share: float,
    below: float,
    margin_px: int,
) -> tuple[FloatArray, FloatArray, float]:
    """Return light and peak of the empty strip, moved by `share` towards what is seen.

    Covered columns change as the nearest ones do that are not.  Gain and light could drift apart,
    one up, the other down: so most of the light is held at that of the calibration.  The last value
    is what the gain has to be multiplied by.
    """
    width = len(black)
    covered = _covered_columns(brightness, edges_px, depth, below, margin_px)
    new_light, new_peak = np.empty(width), np.empty(width)
    change, relative, fresh = np.empty(width), np.empty(width), np.empty(width, np.bool_)
    now, in_the_light = np.empty(width), 0
    for column in range(width):
        now[column] = (seen_light[column] - black[column]) / gain
        new_light[column] = light[column] + share * (now[column] - light[column])
        new_peak[column] = min(  # what is no longer at full scale is known again at once
            peak[column] + share * (seen_peak[column] - peak[column]),
            seen_peak[column] + NOISE_GREY,
        )
        change[column] = new_light[column] / max(light[column], 1.0)
        fresh[column] = known[column] & (not covered[column])
        in_the_light += int(fresh[column])
    if in_the_light < FEWEST_FRESH:
        return light.copy(), peak.copy(), 1.0
    fill_in(change, fresh)
    for column in range(width):
        if covered[column]:
            new_light[column] = light[column] * change[column]
            new_peak[column] = peak[column]
        relative[column] = new_light[column] * calibrated_scale[column]
    _take_over_where_light_went(
        now,
        seen_peak,
        light,
        calibrated_scale,
        edges_px,
        depth,
        below,
        new_light,
        new_peak,
        relative,
    )
    anchor = most_frequent_brightness(relative, fresh, 1.0)
    for column in range(width):
        new_light[column] /= anchor
    return new_light, new_peak, anchor
