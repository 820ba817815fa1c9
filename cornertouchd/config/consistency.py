"""Values that are good each by itself but not together."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cornertouchd.config.led_frame import (
    LONGEST_PERIOD_US,
    SHORTEST_PERIOD_US,
    STROBE_SHARE,
    LedFrameSettings,
)
from cornertouchd.config.monitor import MonitorSettings
from cornertouchd.config.output import DisplaySettings, TuioSettings
from cornertouchd.config.rig import CamerasSettings, SurfaceSettings
from cornertouchd.config.screens import ScreenSettings
from cornertouchd.config.stages import CrossingSettings, PairingSettings, VisionSettings
from cornertouchd.config.table import Location, Table

# Two cameras are the fewest whose directing lines cross.
FEWEST_CAMERAS = 2
# A display as wide as the surface may miss it by the rounding of decimal fractions.
ROUNDING_MM = 1e-6
DISPLAY_SIDES = (
    ("display_left_mm", "display_width_mm", "width_mm"),
    ("display_top_mm", "display_height_mm", "height_mm"),
)


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Settings that exclude each other: where they stand, and what is wrong with them."""

    locations: tuple[Location, ...]
    message: str


class ContradictionError(ValueError):
    """Settings exclude each other."""

    def __init__(self, contradictions: tuple[Contradiction, ...]) -> None:
        super().__init__("; ".join(each.message for each in contradictions))
        self.contradictions = contradictions


def find_contradictions(
    *,
    surface: SurfaceSettings,
    cameras: CamerasSettings,
    led_frame: LedFrameSettings,
    vision: VisionSettings,
    pairing: PairingSettings,
    crossing: CrossingSettings,
    tuio: TuioSettings,
    screens: Sequence[ScreenSettings],
    monitor: MonitorSettings,
) -> tuple[Contradiction, ...]:
    """Return everything that does not fit together, in the order of the file."""
    return (
        *_cameras_in_use(cameras),
        *_devices_used_once(cameras),
        *_bands_in_pictures(cameras),
        *_pictures_in_time(cameras),
        *_in_order(("cameras",), cameras, "reopen_delay_s", "reopen_delay_max_s"),
        *_flashes_within_limits(cameras, led_frame),
        *_in_order(("led_frame",), led_frame, "level_min", "level_max"),
        *_in_order(("vision",), vision, "edge_level", "shadow_below"),
        *_in_order(("vision", "paper"), vision.paper, "t2_px", "t3_px"),
        *_in_order(("pairing",), pairing, "tolerance_ms", "deadline_ms"),
        *_in_order(("crossing",), crossing, "smallest_radius_mm", "largest_radius_mm"),
        *_in_order(("crossing",), crossing, "pen_diameter_mm", "palm_diameter_mm"),
        *_destinations_told_once(tuio),
        *_ports_of_their_own(tuio),
        *_displays_on_surface(surface, tuio),
        *_screens_named_once(screens),
        *_screens_on_surface(surface, screens),
        *_page_guarded(monitor),
    )


def _destinations_told_once(tuio: TuioSettings) -> Iterator[Contradiction]:
    first: dict[tuple[str, str, int], int] = {}
    for number, to in enumerate(tuio.destinations):
        before = first.setdefault((to.transport, to.host, to.port), number)
        if before != number:
            yield Contradiction(
                (
                    ("tuio", "destinations", before, "port"),
                    ("tuio", "destinations", number, "port"),
                ),
                f"[[tuio.destinations]] number {number + 1}: {to.host}:{to.port} is number "
                f"{before + 1}, too; remove one of them",
            )


def _cameras_in_use(cameras: CamerasSettings) -> Iterator[Contradiction]:
    enabled = cameras.enabled_ids
    if len(enabled) < FEWEST_CAMERAS:
        yield Contradiction(
            tuple(("cameras", "units", name, "enabled") for name in cameras.units),
            f"[cameras] cameras with enabled = true: {len(enabled)}; must be at least "
            f"{FEWEST_CAMERAS}, for a touch lies where lines of two cross",
        )


def _devices_used_once(cameras: CamerasSettings) -> Iterator[Contradiction]:
    first_user: dict[str, str] = {}
    for name in cameras.enabled_ids:
        device = cameras.units[name].device
        first = first_user.setdefault(device, name)
        if first != name:
            yield Contradiction(
                (("cameras", "units", first, "device"), ("cameras", "units", name, "device")),
                f"[cameras.{name}] device = {json.dumps(device)} is that of {first}, too; "
                "give each camera its own device",
            )


def _bands_in_pictures(cameras: CamerasSettings) -> Iterator[Contradiction]:
    for name, unit in cameras.units.items():
        # A picture holds one row at least, also when rows_px asks for all that are left.
        end_px = unit.row_offset_px + max(unit.rows_px, 1)
        if end_px > cameras.height_px:
            here = ("cameras", "units", name)
            yield Contradiction(
                ((*here, "row_offset_px"), (*here, "rows_px"), ("cameras", "height_px")),
                f"[cameras.{name}] row_offset_px = {unit.row_offset_px} and "
                f"rows_px = {unit.rows_px} end at row {end_px}, below the picture: "
                f"[cameras] height_px = {cameras.height_px}; make the band end there at the latest",
            )


def _pictures_in_time(cameras: CamerasSettings) -> Iterator[Contradiction]:
    if cameras.rate_hz * cameras.read_timeout_s < 1.0:
        yield Contradiction(
            (("cameras", "rate_hz"), ("cameras", "read_timeout_s")),
            f"[cameras] read_timeout_s = {cameras.read_timeout_s:g} ends before the next picture "
            f"comes, at rate_hz = {cameras.rate_hz:g}; raise one of them",
        )


def _flashes_within_limits(
    cameras: CamerasSettings, led_frame: LedFrameSettings
) -> Iterator[Contradiction]:
    if not led_frame.enabled:
        return
    period_us = led_frame.period_us(cameras.rate_hz)
    table, rate_hz = (
        ("led_frame", led_frame.rate_hz) if led_frame.rate_hz else ("cameras", cameras.rate_hz)
    )
    if not SHORTEST_PERIOD_US <= period_us <= LONGEST_PERIOD_US:
        yield Contradiction(
            ((table, "rate_hz"), ("led_frame", "enabled")),
            f"[{table}] rate_hz = {rate_hz}: the LED frame flashes "
            f"{1e6 / LONGEST_PERIOD_US:g} to {1e6 / SHORTEST_PERIOD_US:g} times a second; "
            "set a rate in these bounds",
        )
    elif led_frame.strobe_us > STROBE_SHARE * period_us:
        yield Contradiction(
            (("led_frame", "strobe_us"), (table, "rate_hz")),
            f"[led_frame] strobe_us = {led_frame.strobe_us} is more than a fifth of the period at "
            f"[{table}] rate_hz = {rate_hz}; set at most {STROBE_SHARE * period_us:.0f}",
        )


def _in_order(
    here: Location,
    table: Table,
    lower: str,
    upper: str,
) -> Iterator[Contradiction]:
    low, high = getattr(table, lower), getattr(table, upper)
    if low > high:
        yield Contradiction(
            ((*here, lower), (*here, upper)),
            f"[{'.'.join(map(str, here))}] {lower} = {low} is more than {upper} = {high}; "
            "lower the first or raise the second",
        )


def _ports_of_their_own(tuio: TuioSettings) -> Iterator[Contradiction]:
    tcp, websocket = tuio.tcp, tuio.websocket
    if tcp.enabled and websocket.enabled and tcp.port == websocket.port:
        yield Contradiction(
            (("tuio", "tcp", "port"), ("tuio", "websocket", "port")),
            f"[tuio.tcp] port = {tcp.port} is that of [tuio.websocket], too; give each its own",
        )


def _displays_on_surface(surface: SurfaceSettings, tuio: TuioSettings) -> Iterator[Contradiction]:
    for index, destination in enumerate(tuio.destinations):
        here = ("tuio", "destinations", index)
        yield from _display_on_surface(
            surface, here, f"[[tuio.destinations]] number {index + 1}", destination
        )
    yield from _display_on_surface(
        surface, ("tuio", "websocket"), "[tuio.websocket]", tuio.websocket
    )
    yield from _display_on_surface(surface, ("tuio", "tcp"), "[tuio.tcp]", tuio.tcp)


def _page_guarded(monitor: MonitorSettings) -> Iterator[Contradiction]:
    if monitor.enabled and not (monitor.token or monitor.is_for_this_machine_only):
        yield Contradiction(
            (("monitor", "host"), ("monitor", "token"), ("monitor", "enabled")),
            f"[monitor] host = {json.dumps(monitor.host)} can be reached from other machines and "
            'needs a token; set one (`openssl rand -hex 16`), or host = "127.0.0.1"',
        )


def _display_on_surface(
    surface: SurfaceSettings, here: Location, shown: str, display: DisplaySettings
) -> Iterator[Contradiction]:
    for start, length, side in DISPLAY_SIDES:
        start_mm, length_mm = getattr(display, start), getattr(display, length)
        side_mm = getattr(surface, side)
        if start_mm >= side_mm or start_mm + length_mm > side_mm + ROUNDING_MM:
            yield Contradiction(
                ((*here, start), (*here, length), ("surface", side)),
                f"{shown}: {start} = {start_mm} and {length} = {length_mm} reach beyond the "
                f"surface: [surface] {side} = {side_mm}; make the display lie on the surface",
            )


def _screens_named_once(screens: Sequence[ScreenSettings]) -> Iterator[Contradiction]:
    first: dict[str, int] = {}
    for number, screen in enumerate(screens):
        before = first.setdefault(screen.name, number) if screen.name else number
        if before != number:
            yield Contradiction(
                (("screens", before, "name"), ("screens", number, "name")),
                f"[[screens]] number {number + 1}: name = {json.dumps(screen.name)} is that of "
                f"number {before + 1}, too; give each its own",
            )


def _screens_on_surface(
    surface: SurfaceSettings, screens: Sequence[ScreenSettings]
) -> Iterator[Contradiction]:
    for number, screen in enumerate(screens):
        shown = f"[[screens]] number {number + 1}"
        yield from _display_on_surface(surface, ("screens", number), shown, screen)
