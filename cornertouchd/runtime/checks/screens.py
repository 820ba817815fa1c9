"""Checks of the touchscreens that the daemon is to make."""

from collections.abc import Iterator

from cornertouchd.config import Settings
from cornertouchd.devices.uinput_device import ScreenError, require_uinput
from cornertouchd.guiding.finding import Finding, well, wrong
from cornertouchd.runtime.checks.installation import Installation


def screens_of(installation: Installation) -> Iterator[Finding]:
    """Yield whether touchscreens can be made, if any are wanted."""
    wanted = _wanted(installation.settings)
    if not wanted:
        return
    try:
        require_uinput(installation.dev / "uinput")
    except ScreenError as error:
        what, _, remedy = str(error).partition("; ")
        yield wrong("touchscreens", what, remedy)
    else:
        screens = "1 touchscreen" if wanted == 1 else f"{wanted} touchscreens"
        yield well("touchscreens", f"{screens} can be made by this user")
    yield from _service(installation)


def _service(installation: Installation) -> Iterator[Finding]:
    """Yield what keeps the service from it, which has fewer rights than root."""
    allowed = installation.unit_property("DeviceAllow")
    if not installation.unit_property("LoadState") or "/dev/uinput" in allowed:
        return
    yield wrong(
        "touchscreens",
        f"{installation.unit} may not open /dev/uinput",
        f"install -Dm 644 /usr/share/cornertouchd/screens.conf "
        f"/etc/systemd/system/{installation.unit}.d/screens.conf, systemctl daemon-reload, "
        "restart it",
    )


def _wanted(settings: Settings) -> int:
    return sum(screen.enabled for screen in settings.screens)
