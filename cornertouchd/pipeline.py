"""From pictures to touches: the stages in order.  Read this first.

CameraPipeline, one per capture thread:   Frame -> shadows, outlines -> Observation
SurfacePipeline, in the fusion thread:    FrameSet -> directing lines -> contacts -> touches
"""

import contextlib
import logging

from cornertouchd.calibration.calibration import Calibration, CalibrationError, CameraCalibration
from cornertouchd.calibration.drift import Drift, DriftWatch
from cornertouchd.calibration.heights import height_table
from cornertouchd.config import Settings
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.crossing import Crossing, make_crossing
from cornertouchd.fusion.denial import Darkness, left_out, without_denied
from cornertouchd.fusion.dirt import Dirt, DirtWatch
from cornertouchd.fusion.kinds import KindsOfContacts
from cornertouchd.fusion.motion import CommonTime
from cornertouchd.fusion.tips import TipFinder, Tips
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.locating.height_table import HeightsError
from cornertouchd.locating.line_table import LineTable, tabulate
from cornertouchd.model import (
    BoolArray,
    Contact,
    FloatArray,
    Frame,
    FrameSet,
    Observation,
    Outlines,
    Shadows,
    Touch,
)
from cornertouchd.vision.background import Background, MaskedColumns, NotDarkError
from cornertouchd.vision.blindness import BlindnessWatch
from cornertouchd.vision.darkness import MeanPicture
from cornertouchd.vision.finder import ProfileFinder, make_finder
from cornertouchd.vision.outlines import OutlineTracer
from cornertouchd.vision.profile import NoiseError, shows_strip
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import StripNotFoundError, find_strip
from cornertouchd.vision.strip_shift import StripShift, StripShiftWatch
from cornertouchd.vision.strip_view import StripView, plain_view, shown_rows, view_of

_log = logging.getLogger("cornertouchd")

MOST_SHADOWS = 64
"""A picture with more shadows is garbage: twenty fingers throw at most twenty."""


class PictureError(Exception):
    """A picture has another size than the calibration expects, or does not show the strip."""


class CameraPipeline:
    """One camera: pictures in, shadows out.  Owned by its capture thread.

    `observe` follows how the empty strip changes, `find` keeps nothing.  Both are for pictures with
    all sides lit.
    """

    def __init__(self, calibration: CameraCalibration, settings: Settings) -> None:
        self._camera = calibration.id
        self._shape = (calibration.format.rows_px, calibration.format.width_px)
        try:
            self._strip = find_strip(calibration.empty)
        except StripNotFoundError as error:
            raise CalibrationError(f"camera {calibration.id}: no strip found: {error}") from None
        self._settings = settings
        self._traces = settings.touch_point.enabled
        self._dark_pictures = 0
        self._shift = StripShiftWatch(self._strip, calibration.empty)
        self._shown_rows = shown_rows(self._strip, calibration.format.rows_px)
        self.learn_background(calibration.empty)

    def learn_background(self, empty: FloatArray) -> None:
        """Measure from now on against `empty`, the mean of empty pictures (rows_px, width_px).

        Raises `CalibrationError` if they have another size or do not show the strip.
        """
        if empty.shape != self._shape:
            raise CalibrationError(
                f"camera {self._camera}: empty pictures of {empty.shape[1]}x{empty.shape[0]} "
                f"pixels, calibrated with {self._shape[1]}x{self._shape[0]}"
            )
        vision = self._settings.vision
        if not shows_strip(self._strip, empty, vision):
            raise CalibrationError(
                f"camera {self._camera}: the strip is dark in the empty pictures: was the LED "
                "frame off, or the lens covered? Record them anew"
            )
        self._finder = make_finder(self._strip, empty, vision)
        self._background: Background | None = None
        if isinstance(self._finder, ProfileFinder):
            reference = self._finder.sampler.reference
            self._background = Background(self._finder, vision, self._settings.background)
            self._tracer = OutlineTracer(self._strip, empty, reference, vision)
        self._blindness = BlindnessWatch(self.masked_columns)

    def find(self, frame: Frame) -> Observation:
        """Return the shadows in a picture, whatever was before.  Raises `PictureError`."""
        self._require_size(frame)
        if not isinstance(self._finder, ProfileFinder):
            shadows = self._finder.find(frame.pixels)
            _require_believable(shadows)
            return self._observation(frame, shadows, None)
        try:
            shadows, gain = self._finder.find_with_hidden(frame.pixels)
        except NoiseError as error:
            raise PictureError(str(error)) from None
        return self._outlined(frame, shadows, self._finder.sampler.reference, gain)

    def observe(self, frame: Frame) -> Observation:
        """Return the shadows in a picture, and learn from it.  Raises `PictureError`."""
        if self._background is None:  # the paper's method compares with nothing
            return self.find(frame)
        self._require_size(frame)
        try:
            sight = self._background.look(frame.pixels, frame.captured_at_s)
        except NoiseError as error:
            raise PictureError(str(error)) from None
        reference = self._background.reference
        observation = self._outlined(
            frame, sight.shadows, reference, sight.measured.gain, self._background.dark
        )
        self._background.learn(sight)
        return observation

    def learn_dark(self, frame: Frame) -> None:
        """Learn the light of the surroundings where no LED was lit.  Raises `PictureError`."""
        self._require_size(frame)
        self._dark_pictures += 1
        if self._background is None:
            return
        try:
            self._background.learn_dark(frame.pixels, frame.captured_at_s)
        except NotDarkError as error:
            raise PictureError(str(error)) from None

    def suspect_dead_leds(self, columns: BoolArray) -> None:
        """Mask those of these columns (width_px,) that are dark in the next picture."""
        if self._background is not None:
            self._background.suspect(columns)

    def find_strip_shift(self, frame: Frame) -> StripShift | None:
        """Return by how much the strip is off the rows where it was calibrated, None if it is not.

        The same object until something changes.  A look a second takes half a millisecond, so it is
        for after the observation has been told.  Of pictures that were observed.
        """
        self._shift.look(frame.pixels, frame.captured_at_s)
        return self._shift.shift

    @property
    def strip_shift(self) -> StripShift | None:
        """By how much the strip is off at present.  Any thread may ask."""
        return self._shift.shift

    def find_blind_columns(self, frame: Frame) -> tuple[MaskedColumns, ...]:
        """Return the columns that have been blind for a while, up to a picture that was observed.

        The same objects until something changes.  Two looks a second take .3 ms each, so it is for
        after the observation has been told.
        """
        if self._blindness.is_due(frame.captured_at_s):
            self._blindness.look(self.masked_columns, frame.captured_at_s)
        return self._blindness.blind

    @property
    def blind_columns(self) -> tuple[MaskedColumns, ...]:
        """The columns that have been blind for a while.  Any thread may ask."""
        return self._blindness.blind

    def show(self, frame: Frame) -> StripView:
        """Return what people are shown of a picture; learns nothing.  Any thread may ask.

        Raises `PictureError` if it has another size.
        """
        self._require_size(frame)
        finder, background = self._finder, self._background
        if background is None or not isinstance(finder, ProfileFinder):
            return plain_view(frame, self._shown_rows, finder.find(frame.pixels))
        return view_of(
            frame,
            self._shown_rows,
            finder.look(frame.pixels, background.reference),
            background.reference,
            knows_darkness=background.dark is not None,
        )

    def reset(self) -> None:
        """Forget what was learned from pictures."""
        if self._background is not None:
            self._background.reset()

    @property
    def masked_columns(self) -> tuple[MaskedColumns, ...]:
        """Columns that are blind now, from left to right.  Any thread may ask."""
        return () if self._background is None else self._background.masked_columns

    def _require_size(self, frame: Frame) -> None:
        if frame.pixels.shape != self._shape:
            rows, width = frame.pixels.shape[:2]
            raise PictureError(
                f"picture of {width}x{rows} pixels, calibrated with "
                f"{self._shape[1]}x{self._shape[0]}"
            )

    def _outlined(
        self,
        frame: Frame,
        shadows: Shadows,
        reference: Reference,
        gain: float,
        dark: MeanPicture | None = None,
    ) -> Observation:
        _require_believable(shadows)
        outlines = None
        if self._traces:
            outlines = self._tracer.trace(frame.pixels, shadows, reference, gain, dark)
        return self._observation(frame, shadows, outlines)

    def _observation(
        self, frame: Frame, shadows: Shadows, outlines: Outlines | None
    ) -> Observation:
        # dark pictures are not missing: only lit ones are counted
        number = frame.sequence - self._dark_pictures
        return Observation(frame.camera, number, frame.captured_at_s, shadows, outlines)


def _require_believable(shadows: Shadows) -> None:
    if len(shadows) > MOST_SHADOWS:
        raise PictureError(
            f"{len(shadows)} shadows in one picture, {MOST_SHADOWS} are believed: "
            "noise, or the LED frame flickers"
        )


def line_tables(calibration: Calibration) -> dict[str, LineTable]:
    """Return the directing lines of every camera, by its name."""
    return {
        camera.id: tabulate(camera.id, camera.model, camera.format.width_px)
        for camera in calibration.cameras
    }


def calibrated_crossing(calibration: Calibration, settings: Settings) -> Crossing:
    """Return the crossing that the settings choose for a rig that was calibrated so."""
    return make_crossing(
        settings.crossing,
        calibration.surface_mm,
        reconstructed=calibration.method == "reconstruction",
    )


def find_tips(calibration: Calibration, settings: Settings) -> TipFinder | None:
    """Return what finds the tips of fingers; None if it is off, or nothing tells heights.

    Logs which cameras do not tell them.
    """
    if not settings.touch_point.enabled or settings.vision.edges == "paper":
        return None
    tables, matt = {}, []
    for camera in calibration.cameras:
        if camera.heights is None:
            continue
        with contextlib.suppress(HeightsError, StripNotFoundError):
            strip = find_strip(camera.empty)
            tables[camera.id] = height_table(
                camera.id, strip, camera.model, calibration.surface_mm, camera.heights
            )
            matt += [] if strip.mirrored else [camera.id]
    if matt:
        _log.warning(
            "camera %s: sees no mirror image of the strip in the screen, so touches are located "
            "less exactly, and what hovers counts as touching",
            ", ".join(matt),
        )
    lacking = [camera.id for camera in calibration.cameras if camera.id not in tables]
    if lacking:
        _log.warning(
            "camera %s: tells nothing about heights, so touches are located less exactly; "
            "run `cornertouchd calibrate`",
            ", ".join(lacking),
        )
    return TipFinder(tables, settings.touch_point, calibration.surface_mm) if tables else None


class SurfacePipeline:
    """All cameras: frame sets in, contacts and touches out.  Owned by the fusion thread."""

    def __init__(self, calibration: Calibration, settings: Settings) -> None:
        self._lines = line_tables(calibration)
        self._edge_sigma_px = settings.crossing.edge_sigma_px
        self._crossing = calibrated_crossing(calibration, settings)
        self._kinds = (
            KindsOfContacts(settings.crossing, calibration.surface_mm)
            if settings.crossing.method == "default"
            else None  # the paper knows but fingers
        )
        self._tips = find_tips(calibration, settings)
        self._dirt = DirtWatch(settings.dirt, self._lines.values())
        self._common_time = CommonTime(
            settings.motion,
            {camera.id: camera.format.width_px for camera in calibration.cameras},
        )
        self._tracker = Tracker(
            settings.tracking, calibration.surface_mm, 1.0 / settings.cameras.rate_hz
        )
        self._drift = DriftWatch(calibration)
        self._refused: tuple[Contact, ...] = ()
        self._supports = Crossed.nothing().supports

    def cross(self, frame_set: FrameSet) -> tuple[Contact, ...]:
        """Return what touches the surface in one frame set, whatever was before."""
        seen = self._lay(frame_set)
        return self._located(self._crossed(seen, None), seen, frame_set)[0]

    def follow(self, frame_set: FrameSet) -> tuple[tuple[Contact, ...], tuple[Touch, ...]]:
        """Return what touches the surface now, and the touches that it continues or begins."""
        now_s = frame_set.captured_at_s
        carried = self._common_time.carry(self._dirt.set_aside(frame_set))
        seen = self._lay(carried)
        crossed = self._crossed(seen, self._tracker.predict(now_s))
        contacts, tips = self._located(crossed, seen, carried)
        self._dirt.learn(frame_set, crossed.contacts)
        whole = len(frame_set.observations) == len(self._lines)
        touches = self._tracker.update(now_s, crossed, tips=tips, whole=whole, hides=seen.hides)
        return contacts, touches

    def _lay(self, frame_set: FrameSet) -> Darkness:
        """Lay all shadows on the surface."""
        return Darkness(
            [
                self._lines[seen.camera].lay(seen.shadows, self._edge_sigma_px)
                for seen in frame_set.observations
                if len(seen.shadows)
            ],
            [self._lines[seen.camera] for seen in frame_set.observations if not len(seen.shadows)],
        )

    def _crossed(self, seen: Darkness, predictions: Predictions | None) -> Crossed:
        self._refused = ()
        if not seen.lines:
            nothing = Crossed.nothing()
            self._supports = nothing.supports
            return nothing
        eyes = [*(self._lines[one.camera] for one in seen.lines), *seen.silent]
        found = self._crossing.cross(seen.lines, predictions)
        crossed = without_denied(found, seen.silent, eyes)
        self._refused, self._supports = left_out(found, crossed), crossed.supports
        return self._kinds.tell(crossed, seen.lines) if self._kinds else crossed

    def _located(
        self, crossed: Crossed, seen: Darkness, frame_set: FrameSet
    ) -> tuple[tuple[Contact, ...], Tips]:
        """Return the contacts where they touch; without heights, where their sections are."""
        if self._tips is None:
            return crossed.contacts, Tips.unknown(len(crossed.contacts))
        return self._tips.find(crossed, seen.lines, frame_set.observations)

    @property
    def refused(self) -> tuple[Contact, ...]:
        """What was found in the last frame set and denied by cameras that see light there."""
        return self._refused

    @property
    def supports(self) -> FloatArray:
        """How firmly the contacts of the last frame set are believed (`Crossed.supports`)."""
        return self._supports

    @property
    def dirt(self) -> tuple[Dirt, ...]:
        """What hangs before the strips at present: the same objects until something changes."""
        return self._dirt.dirt

    def find_drift(
        self, frame_set: FrameSet, contacts: tuple[Contact, ...], touches: tuple[Touch, ...]
    ) -> Drift | None:
        """Return what has moved since it was calibrated, as far as touches up to these tell.

        The same object until something changes.  Every tenth new place of a touch costs half a
        millisecond (median; some milliseconds at worst), so it is for after they have been told.
        """
        self._drift.follow(frame_set, contacts, touches)
        return self._drift.drift

    def reset(self) -> None:
        """Forget all touches; the next ones get new ids.  Dirt stays where it is."""
        self._common_time.reset()
        self._tracker.reset()
