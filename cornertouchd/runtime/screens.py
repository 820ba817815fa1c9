"""The touchscreens of this machine that a configuration asks for."""

from collections.abc import Sequence
from pathlib import Path

from cornertouchd.config import Settings
from cornertouchd.config.reading import SYSTEM_FILE
from cornertouchd.devices.uinput_screen import UinputScreen
from cornertouchd.runtime.displays import NO_DISPLAYS, Displays, display_mapping

PROGRAM = "cornertouchd"


def make_screens(
    settings: Settings,
    surface_mm: tuple[float, float],
    config_file: str,
    displays: Displays = NO_DISPLAYS,
) -> tuple[UinputScreen, ...]:
    """Return the touchscreens on a surface of this size; `displays` is where displays lie."""
    names = screen_names(settings, config_file)
    return tuple(
        UinputScreen(name, display_mapping(surface_mm, screen, displays), screen.touches_max)
        for name, screen in zip(names, settings.screens, strict=True)
        if screen.enabled
    )


def screen_names(settings: Settings, config_file: str) -> Sequence[str]:
    """Return the names of all touchscreens, made where none is set.

    Those of two daemons on one machine differ as their configurations do.
    """
    surface = Path(config_file).stem if config_file else PROGRAM
    names: list[str] = []
    for number, screen in enumerate(settings.screens, start=1):
        parts = [PROGRAM]
        if surface != SYSTEM_FILE.stem:
            parts.append(surface)
        if screen.display:
            parts.append(screen.display)
        made = " ".join(parts)
        names.append(screen.name or (made if made not in names else f"{made} {number}"))
    return names
