"""How the daemon does: one value with everything that status, metrics and the page tell."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal, Protocol, runtime_checkable

from cornertouchd import __version__
from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.devices.uinput_screen import ScreenStatus
from cornertouchd.ports import Clock, TouchSink
from cornertouchd.runtime.capture import CaptureCounts
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.fusing import FusionCounts
from cornertouchd.runtime.led_light import LightState
from cornertouchd.runtime.own_process import ProcessUse, process_use
from cornertouchd.runtime.strip_readings import StripReading, read_strip

State = Literal["healthy", "degraded"]

LOOK_EVERY_S = 1.0
"""Rates over less than this jump about."""

SLOW_SHARE = 0.8
"""Of the rate that is set; what comes less often is told."""

STARTING_S = 5.0
"""Cameras begin one after the other."""

ROUNDING_S = 1e-6
"""Of the difference of two times."""


@dataclass(frozen=True, slots=True)
class CameraHealth:
    """One camera; the numbers count from the start of the daemon, but for the rate.

    `masked_columns` are blind now: dead LEDs, glare.  `strip` is read when somebody asks, None if
    there is no lit picture.
    """

    id: str
    live: bool
    pictures_per_s: float
    pictures: int
    faults: int
    reopened: int
    resets: int
    lost: int
    damaged: int
    left_out: int
    masked_columns: int
    blind: tuple[str, ...]
    strip_shift: str
    strip: StripReading | None = None


@dataclass(frozen=True, slots=True)
class LastFrameSet:
    """What the last frame set was; `least_support` is None if nothing touched.

    `skew_s` lies between its first and its last picture.
    """

    contacts: int
    refused: int
    skew_s: float
    least_support: float | None


@dataclass(frozen=True, slots=True)
class Health:
    """The daemon at one moment; `problems` say what is wrong, `hints` what may become so.

    The rates are those of the last second or so.  `light` is None if no controller strobes it.
    """

    state: State
    problems: tuple[str, ...]
    hints: tuple[str, ...]
    up_s: float
    frame_sets_per_s: float
    fusion: FusionCounts
    cameras: tuple[CameraHealth, ...]
    destinations: tuple[DestinationStatus, ...]
    light: LightState | None
    last: LastFrameSet
    process: ProcessUse
    cpu_share: float
    version: str
    calibrated_at: str
    residual_mm: float
    screens: tuple[ScreenStatus, ...] = ()


@runtime_checkable
class TellsDestinations(Protocol):
    """A sink that knows how its destinations fare."""

    @property
    def destinations(self) -> tuple[DestinationStatus, ...]:
        """How each destination fares."""
        ...


@runtime_checkable
class TellsScreens(Protocol):
    """A sink that knows how its touchscreens fare."""

    @property
    def screens(self) -> tuple[ScreenStatus, ...]:
        """How each touchscreen fares."""
        ...


def as_json(health: Health) -> bytes:
    """Return everything as one JSON object, keys as the fields are named."""
    return json.dumps(asdict(health)).encode()


class HealthWatch:
    """Looks at a daemon now and then.  `look` is for one thread, `now` for any."""

    def __init__(self, daemon: Daemon, clock: Clock) -> None:
        self._daemon = daemon
        self._clock = clock
        self._started_at_s = self._looked_at_s = clock.now_s()
        self._frame_sets = 0
        self._pictures: Mapping[str, int] = {}
        self._used = process_use()
        self._now = self._health(0.0, LOOK_EVERY_S)

    @property
    def now(self) -> Health:
        """What was seen at the last look."""
        return self._now

    def tell(self) -> Health:
        """Return what was seen at the last look, and how bright the strips are now."""
        now, stages = self._now, self._daemon.stages
        cameras = tuple(
            replace(one, strip=read_strip(stages, one.id)) if one.id in stages.captures else one
            for one in now.cameras
        )
        return replace(now, cameras=cameras)

    def look(self, every_s: float = LOOK_EVERY_S) -> None:
        """Look anew, unless that was just done; what has happened since then gives the rates."""
        now_s = self._clock.now_s()
        span_s = now_s - self._looked_at_s
        if span_s < every_s - ROUNDING_S:
            return
        self._now = self._health(now_s - self._started_at_s, span_s)
        self._looked_at_s = now_s

    def _health(self, up_s: float, span_s: float) -> Health:
        daemon, stages = self._daemon, self._daemon.stages
        fusion, counts = daemon.fusion_counts(), daemon.camera_counts()
        cameras = tuple(self._camera(name, each, span_s) for name, each in counts.items())
        destinations = _destinations(stages.fusion.sinks)
        screens = _screens(stages.fusion.sinks)
        frame_sets_per_s = max(fusion.frame_sets - self._frame_sets, 0) / span_s
        self._frame_sets = fusion.frame_sets
        self._pictures = {name: each.frames for name, each in counts.items()}
        light, before, self._used = daemon.light_state(), self._used, process_use()
        problems = tuple(_problems(cameras, frame_sets_per_s, light))
        return Health(
            "degraded" if problems else "healthy",
            problems,
            (
                *self._hints(cameras, destinations, screens),
                *self._slow(cameras, frame_sets_per_s, up_s),
            ),
            up_s,
            frame_sets_per_s,
            fusion,
            cameras,
            destinations,
            light,
            self._last(),
            self._used,
            (self._used.cpu_s - before.cpu_s) / span_s,
            __version__,
            stages.calibration.created_at,
            stages.calibration.residual_mm,
            screens,
        )

    def _last(self) -> LastFrameSet:
        moment, supports = self._daemon.moment, self._daemon.stages.fusion.pipeline.supports
        if moment is None:
            return LastFrameSet(0, 0, 0.0, None)
        times_s = [seen.captured_at_s for seen in moment.frame_set.observations]
        return LastFrameSet(
            len(moment.contacts),
            len(moment.refused),
            max(times_s) - min(times_s) if times_s else 0.0,
            float(min(supports)) if len(supports) else None,
        )

    def _camera(self, name: str, counts: CaptureCounts, span_s: float) -> CameraHealth:
        pipeline = self._daemon.stages.captures[name].pipeline
        return CameraHealth(
            name,
            counts.live,
            max(counts.frames - self._pictures.get(name, 0), 0) / span_s,
            counts.frames,
            counts.faults,
            counts.reopened,
            counts.resets,
            counts.lost,
            counts.damaged,
            counts.left_out,
            sum(masked.last_px - masked.first_px + 1 for masked in pipeline.masked_columns),
            self._blind(name),
            str(self._daemon.strip_shifts().get(name, "")),
        )

    def _blind(self, name: str) -> tuple[str, ...]:
        stages = self._daemon.stages.captures[name]
        say = str if stages.light is None else stages.light.masked
        return tuple(map(say, stages.pipeline.blind_columns))

    def _hints(
        self,
        cameras: Sequence[CameraHealth],
        destinations: Sequence[DestinationStatus],
        screens: Sequence[ScreenStatus],
    ) -> list[str]:
        drift = self._daemon.drift
        return [
            *(f"camera {each.id}: {each.strip_shift}" for each in cameras if each.strip_shift),
            *([str(drift)] if drift else []),
            *(f"camera {each.id}: {columns}" for each in cameras for columns in each.blind),
            *(str(dirt) for dirt in self._daemon.dirt),
            *(f"TUIO to {to.host}:{to.port}: {to.fault}" for to in destinations if to.fault),
            *(f"touchscreen {each.name}: {each.fault}" for each in screens if each.fault),
        ]

    def _slow(
        self, cameras: Sequence[CameraHealth], frame_sets_per_s: float, up_s: float
    ) -> Iterator[str]:
        """Say what comes less often than it should."""
        if up_s < STARTING_S:
            return
        settings = self._daemon.stages.settings
        live = [each for each in cameras if each.live]
        slowest_per_s = min((each.pictures_per_s for each in live), default=0.0)
        if frame_sets_per_s < SLOW_SHARE * slowest_per_s:
            yield (
                f"{frame_sets_per_s:.0f} frame sets a second of {slowest_per_s:.0f} pictures: is "
                "this machine too slow (`cornertouchd bench`), or are cameras not triggered "
                "together?"
            )
        elif not settings.led_frame.enabled:  # of its pictures only those with all sides lit count
            rate_hz = settings.cameras.rate_hz
            for each in live:
                if each.pictures_per_s < SLOW_SHARE * rate_hz:
                    yield (
                        f"camera {each.id}: {each.pictures_per_s:.0f} pictures a second of "
                        f"{rate_hz:g}: make its exposure shorter, or lower cameras.rate_hz to what "
                        "it gives"
                    )


def _problems(
    cameras: Sequence[CameraHealth], frame_sets_per_s: float, light: LightState | None
) -> list[str]:
    found = [f"camera {each.id} lost" for each in cameras if not each.live]
    if light is not None and not light.is_well:
        found.append(str(light))
    if found or frame_sets_per_s:
        return found
    return ["the cameras never see the same instant"]


def _destinations(sinks: Sequence[TouchSink]) -> tuple[DestinationStatus, ...]:
    return tuple(
        destination
        for sink in sinks
        if isinstance(sink, TellsDestinations)
        for destination in sink.destinations
    )


def _screens(sinks: Sequence[TouchSink]) -> tuple[ScreenStatus, ...]:
    return tuple(
        screen for sink in sinks if isinstance(sink, TellsScreens) for screen in sink.screens
    )
