"""Which part of the surface each display lies on: as set, else as calibrated."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.display import DisplayPlace, load_display
from cornertouchd.config import DisplaySettings, Settings
from cornertouchd.wire.mapping import DisplayMapping

Displays = Mapping[str, DisplayPlace]
"""Where displays were found to lie, by name; the only one of a surface has none."""

NO_DISPLAYS: Displays = MappingProxyType({})

PLACE_KEYS = (
    "display_left_mm",
    "display_top_mm",
    "display_width_mm",
    "display_height_mm",
    "rotation_deg",
    "mirror",
)
"""Settings that say where a display lies."""


def display_file(calibration: Path, name: str = "") -> Path:
    """Return where it is kept in which part of the surface a display lies.

    Beside the calibration that this was found with: rigs of their own have displays of their own.
    """
    return calibration.with_name(f"display-{name}.json" if name else "display.json")


def find_displays(settings: Settings, calibration: Path) -> Displays:
    """Return where the displays lie that receivers have, as far as anybody found that out.

    Raises `CalibrationError` if a file cannot be used, or if a display that has a name lies nobody
    knows where.  A simulated rig has no display.
    """
    if settings.cameras.source == "simulated":
        return NO_DISPLAYS
    surface_mm = settings.surface.width_mm, settings.surface.height_mm
    found = {}
    for name in sorted({each.display for each in _receivers(settings) if _says_nothing(each)}):
        path = display_file(calibration, name)
        try:
            place = load_display(path)
        except FileNotFoundError:
            if not name:
                continue
            raise CalibrationError(
                f"{path}: there is none, so nobody knows where the display {name} lies; run "
                f"`cornertouchd calibrate display --name {name}`, or set its four display values"
            ) from None
        try:
            place.require_on(surface_mm)
        except CalibrationError as error:
            raise CalibrationError(f"{path}: {error}") from None
        found[name] = place
    return found


def display_mapping(
    surface_mm: tuple[float, float], given: DisplaySettings, displays: Displays = NO_DISPLAYS
) -> DisplayMapping:
    """Return where a receiver's display lies on a surface of this width and height.

    As its settings say; if they say nothing, where the display of that name was found to lie.
    """
    place = displays.get(given.display) if _says_nothing(given) else None
    if place is not None:
        return DisplayMapping(
            place.left_mm,
            place.top_mm,
            place.width_mm,
            place.height_mm,
            place.rotation_deg,
            place.mirror,
            place.corners_mm,
        )
    left, top = given.display_left_mm, given.display_top_mm
    return DisplayMapping(
        left,
        top,
        given.display_width_mm or surface_mm[0] - left,
        given.display_height_mm or surface_mm[1] - top,
        given.rotation_deg,
        given.mirror,
    )


def _says_nothing(given: DisplaySettings) -> bool:
    """Tell whether the settings leave it to the calibration where the display lies."""
    untouched = DisplaySettings()
    return all(getattr(given, key) == getattr(untouched, key) for key in PLACE_KEYS)


def _receivers(settings: Settings) -> Iterator[DisplaySettings]:
    tuio = settings.tuio
    yield from tuio.destinations
    yield from (server for server in (tuio.websocket, tuio.tcp) if server.enabled)
    yield from (screen for screen in settings.screens if screen.enabled)
