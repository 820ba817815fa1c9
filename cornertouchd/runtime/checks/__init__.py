"""Everything that can be wrong with an installation, each by a function of its own, in a table."""

from collections.abc import Callable, Iterator

from cornertouchd.guiding.finding import Finding, wrong
from cornertouchd.runtime.checks.bandwidth import bandwidth_of
from cornertouchd.runtime.checks.cameras import cameras_of
from cornertouchd.runtime.checks.files import calibration_of, disk_of, kernels_of
from cornertouchd.runtime.checks.installation import Installation
from cornertouchd.runtime.checks.led_frame import led_frame_of
from cornertouchd.runtime.checks.machine import clock_of, groups_of, real_time_of, service_of
from cornertouchd.runtime.checks.screens import screens_of
from cornertouchd.runtime.checks.targets import targets_of

CHECKS: dict[str, Callable[[Installation], Iterator[Finding]]] = {
    "service": service_of,
    "permissions": groups_of,
    "cameras": cameras_of,
    "bandwidth": bandwidth_of,
    "LED frame": led_frame_of,
    "calibration": calibration_of,
    "TUIO": targets_of,
    "touchscreens": screens_of,
    "real time": real_time_of,
    "clock": clock_of,
    "kernels": kernels_of,
    "disk": disk_of,
}
"""In the order in which a person would mend things."""


def check_installation(installation: Installation) -> Iterator[Finding]:
    """Yield what is found; a check that fails itself is a finding too."""
    for subject, check in CHECKS.items():
        try:
            yield from check(installation)
        except Exception as error:  # noqa: BLE001  the other checks are of use without it
            yield wrong(subject, f"could not be checked: {error!r}", "report this as a bug")
