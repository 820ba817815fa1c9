"""The LED frame in the daemon: it is kept as the settings say, and pictures learn how it shone.

The controller's reports come from the thread of the link, pictures from the capture threads; what
both touch is behind a lock that is never held for longer than a few microseconds.
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from cornertouchd.calibration.calibration import Calibration, CameraCalibration
from cornertouchd.config import LedFrameSettings, Settings
from cornertouchd.devices.serial_link import SerialLedFrame
from cornertouchd.model import BoolArray, Frame
from cornertouchd.ports import FaultReport, LedFrame, LedFrameListener
from cornertouchd.runtime.faults import FaultLog
from cornertouchd.runtime.light_levels import IdleWatch, LevelControl, Levels
from cornertouchd.runtime.lit_masks import FrameReports, MaskMatcher, MatchCounts
from cornertouchd.runtime.side_light import SideBrightness, SideLight
from cornertouchd.vision.background import MEND_THE_LED, MaskedColumns
from cornertouchd.wire.ledframe import SetLevels, SetPattern, SetTiming
from cornertouchd.wire.ledframe_faults import OPEN_LED_REMEDY, explain, open_sides, sides_of
from cornertouchd.wire.ledframe_reports import ControllerStatus, FaultsChanged, FrameLit, Identity
from cornertouchd.wire.ledframe_session import Light, Report

ALL_SIDES = 15

DARK_AFTER_S = 1.0
"""So long after the last report the controller is dark for certain: it waits for 0.5 s."""

LOOK_EVERY_S = 0.1
"""Pictures from which brightness is regulated."""

SETTLED_S = 0.2
"""After dimming, pictures that were on their way and the gain of the vision need so long."""

MakeLink = Callable[[str, LedFrameListener, FaultReport], LedFrame]


@dataclass(frozen=True, slots=True)
class LightState:
    """How the LED frame does.

    `controller` is what it does (idle, armed, safe, self_test), empty while it is not connected;
    `temperature_c` is None then.  `pictures` tells for each camera how many were matched;
    `masked` the columns that are blind, with the side that they look at.
    """

    port: str
    controller: str
    faults: tuple[str, ...]
    pattern: str
    levels: Levels
    dimmed: bool
    temperature_c: float | None
    connections: int
    bad_messages: int
    pictures: Mapping[str, MatchCounts]
    masked: tuple[str, ...] = ()

    @property
    def is_well(self) -> bool:
        """Whether it shines as it should."""
        return self.controller == "armed" and not self.faults

    def __str__(self) -> str:
        """Say it in a few words."""
        if not self.controller:
            return "LED frame lost"
        said = f"LED frame {self.controller}{', dimmed' if self.dimmed else ''}"
        return "; ".join([said, *self.faults])


class LedLight:
    """The LED frame while the daemon runs.

    `fits` tells whether it is the one that other settings ask for.
    """

    def __init__(
        self, settings: Settings, calibration: Calibration, make_link: MakeLink | None = None
    ) -> None:
        self._made_for = _what_counts(settings, calibration)
        self._settings = settings.led_frame
        self._period_us = self._settings.period_us(settings.cameras.rate_hz)
        self._make_link = make_link or _serial_link
        self._link: LedFrame | None = None
        self.reports = FrameReports(self._period_us / 1e6)
        self._lock = threading.Lock()
        self._control = LevelControl(self._settings)
        self._idle = IdleWatch(self._settings.dim_after_s)
        self._dimmed_at_s: float | None = None
        self._reported_at_s: float | None = None
        self._open_sides = 0
        self._cameras = {
            camera.id: CameraLight(self, camera, calibration.surface_mm, settings)
            for camera in calibration.cameras
            if camera.id in settings.cameras.enabled_ids
        }

    def fits(self, settings: Settings, calibration: Calibration) -> bool:
        """Tell whether one made for these would be the same."""
        return self._made_for == _what_counts(settings, calibration)

    def of(self, camera: str) -> "CameraLight":
        """Return the light in the pictures of one camera."""
        return self._cameras[camera]

    @property
    def settings(self) -> LedFrameSettings:
        """What it was made for."""
        return self._settings

    def start(self) -> None:
        """Look for the controller, set it up and let it shine."""
        link = self._link = self._make_link(self._settings.port, self, FaultLog("LED frame"))
        link.configure(self._light())
        link.arm()
        link.start()

    def close(self) -> None:
        """Switch the light off and give the port back; takes <= 1 s."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def __call__(self, report: Report, received_at_s: float) -> None:
        """Take a report of the controller; called from the thread of the link."""
        match report:
            case FrameLit():
                self.reports.add(report, received_at_s)
                self._reported_at_s = received_at_s
            case Identity():
                self.reports.begin_anew()
            case ControllerStatus():
                self._open_sides = open_sides(report.faults)
                self._regulate(received_at_s)
            case FaultsChanged():
                self._open_sides = open_sides(report.faults)
            case _:
                pass

    @property
    def open_sides(self) -> int:
        """The sides with dead LEDs, as the controller measures, bits 0 to 3 top to left."""
        return self._open_sides

    def is_dark_for_certain(self, now_s: float) -> bool:
        """Tell whether the controller has been silent for so long that it cannot shine."""
        reported_at_s = self._reported_at_s
        return reported_at_s is None or now_s - reported_at_s > DARK_AFTER_S

    def note_sides(self, camera: str, mask: int, seen: Sequence[SideBrightness]) -> None:
        """Take how bright the sides are in a picture whose mask is known."""
        with self._lock:
            for one in seen:
                if mask == 0:
                    self._control.see_dark(one.side, one.grey)
                elif mask == ALL_SIDES and self._dimmed_at_s is None:
                    self._control.see_lit(camera, one.side, one.grey, saturated=one.saturated)

    def note_shadows(self, camera: str, count: int, at_s: float) -> None:
        """Take how many shadows a picture shows; the first one wakes dimmed LEDs."""
        with self._lock:
            touched = self._idle.see(camera, count, at_s)
            dimmed_at_s = self._dimmed_at_s
            if not touched or dimmed_at_s is None or at_s - dimmed_at_s < SETTLED_S:
                return
            self._dimmed_at_s = None
            self._control.forget()
        self._configure()

    def state(self, masked: Mapping[str, Sequence[MaskedColumns]]) -> LightState:
        """Return how it does; `masked` are the blind columns of every camera.  Any thread."""
        link = self._link
        status = link.status if link is not None else None
        controller = status.controller if status is not None else None
        return LightState(
            self._settings.port,
            controller.state.name.lower() if controller else "",
            tuple(explain(controller.faults)) if controller else (),
            self._settings.pattern,
            self._levels(),
            self._dimmed_at_s is not None,
            controller.temperature_c if controller else None,
            status.connections if status else 0,
            status.bad_messages if status else 0,
            {camera: light.counts for camera, light in self._cameras.items()},
            tuple(
                f"camera {camera}: {self._cameras[camera].masked(columns)}"
                for camera, blind in masked.items()
                if camera in self._cameras
                for columns in blind
            ),
        )

    def _regulate(self, now_s: float) -> None:
        with self._lock:
            changed = self._settings.automatic_brightness and self._control.step(now_s)
            if self._dimmed_at_s is None and self._idle.is_idle(now_s):
                self._dimmed_at_s = now_s
                changed = True
        if changed:
            self._configure()

    def _levels(self) -> Levels:
        levels = self._control.levels
        if self._dimmed_at_s is None:
            return levels
        top, right, bottom, left = (round(self._settings.dim_level * level) for level in levels)
        return top, right, bottom, left

    def _light(self) -> Light:
        settings = self._settings
        return Light(
            SetLevels(self._levels()),
            SetTiming(self._period_us, settings.strobe_us, settings.lead_us),
            SetPattern(settings.masks),
        )

    def _configure(self) -> None:
        if self._link is not None:
            self._link.configure(self._light())


class CameraLight:
    """How the LED frame shone in the pictures of one camera.  Owned by its capture thread.

    Raises `StripNotFoundError` where the calibration shows no strip.
    """

    def __init__(
        self,
        light: LedLight,
        camera: CameraCalibration,
        surface_mm: tuple[float, float],
        settings: Settings,
    ) -> None:
        self._light = light
        self._camera = camera.id
        self._shape = (camera.format.rows_px, camera.format.width_px)
        self._sides = SideLight(camera, surface_mm, settings.vision)
        self._matcher = MaskMatcher(light.reports, [1 << side for side in self._sides.sides])
        self._constant = settings.led_frame.pattern == "constant"
        self._lit_before = False
        self._open_sides = 0
        self._noted_at_s: dict[int, float] = {}

    @property
    def counts(self) -> MatchCounts:
        """How its pictures were matched.  Any thread may ask."""
        return self._matcher.counts

    def label(self, frame: Frame) -> Frame | None:
        """Return the picture with its lit mask; None if it must be left out.

        A picture of unknown light is one with all sides lit only where no other can be: in the
        constant pattern, or when the controller has been away for a while; and it must show the
        strip.
        """
        if frame.pixels.shape != self._shape:  # refused where it is observed
            return frame
        seen = self._sides.measure(frame.pixels)
        mask = self._matcher.mask(frame.captured_at_s, [one.grey for one in seen])
        if mask is not None:
            if mask not in (0, ALL_SIDES) or (mask == 0 and not self._lit_before):
                return None  # the vision compares dark pictures with lit ones
            self._lit_before = True
            self._note(mask, seen, frame.captured_at_s)
            return replace(frame, lit_mask=mask)
        cannot_be_dark = self._constant or self._light.is_dark_for_certain(frame.captured_at_s)
        if cannot_be_dark and self._sides.shows_strip(seen):
            return replace(frame, lit_mask=None)
        return None

    def note_shadows(self, count: int, at_s: float) -> None:
        """Take how many shadows a picture shows."""
        self._light.note_shadows(self._camera, count, at_s)

    def suspected(self) -> BoolArray | None:
        """Return the columns (width_px,) of sides that have dead LEDs since the last call."""
        open_before, self._open_sides = self._open_sides, self._light.open_sides
        new = self._open_sides & ~open_before
        return self._sides.columns_of(new) if new else None

    def masked(self, columns: MaskedColumns) -> str:
        """Say which columns of which side are blind."""
        side = self._sides.side_at((columns.first_px + columns.last_px) // 2)
        if columns.remedy == MEND_THE_LED and side in sides_of(self._light.open_sides):
            where = f"columns {columns.first_px}..{columns.last_px}"
            return f"{side} side: open LED, {where} masked; {OPEN_LED_REMEDY}"
        return f"{side} side: {columns}" if side else str(columns)

    def _note(self, mask: int, seen: Sequence[SideBrightness], at_s: float) -> None:
        if not 0.0 <= at_s - self._noted_at_s.get(mask, at_s - LOOK_EVERY_S) < LOOK_EVERY_S:
            self._noted_at_s[mask] = at_s
            self._light.note_sides(self._camera, mask, seen)


def make_light(settings: Settings, calibration: Calibration) -> LedLight | None:
    """Return the LED frame that the settings ask for, None if they want none."""
    return LedLight(settings, calibration) if settings.led_frame.enabled else None


def _what_counts(settings: Settings, calibration: Calibration) -> object:
    cameras = settings.cameras
    return (
        settings.led_frame,
        settings.vision,
        cameras.rate_hz,
        cameras.enabled_ids,
        calibration.created_at,
        tuple(camera.id for camera in calibration.cameras),
    )


def _serial_link(port: str, listener: LedFrameListener, faults: FaultReport) -> LedFrame:
    return SerialLedFrame(port, listener, faults)
