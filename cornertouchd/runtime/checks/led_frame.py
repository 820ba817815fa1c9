"""Check of the LED frame's controller: whether it is there, answers and is well."""

from collections.abc import Iterator

from cornertouchd.guiding.finding import Finding, well, wrong
from cornertouchd.runtime.checks.installation import Installation
from cornertouchd.runtime.led_desk import LedDesk, LedFrameError
from cornertouchd.wire.ledframe_faults import explain


def led_frame_of(installation: Installation) -> Iterator[Finding]:
    """Yield how the controller is; the service's is left alone."""
    led_frame = installation.settings.led_frame
    if not led_frame.enabled:
        yield well("LED frame", "always on, without a controller (led_frame.enabled = false)")
        return
    if installation.is_running:
        yield well("LED frame", f"{led_frame.port} is the service's; stop it to look closer")
        return
    try:
        with LedDesk(led_frame.port) as desk:
            identity, controller = desk.status.identity, desk.status.controller
    except LedFrameError as error:
        what, _, remedy = str(error).partition("; ")
        yield wrong("LED frame", what, remedy or "see docs/led-frame.md")
        return
    for fault in explain(controller.faults) if controller else ():
        what, _, remedy = fault.partition("; ")
        yield wrong("LED frame", f"{led_frame.port}: {what}", remedy)
    if identity is not None and controller is not None and not controller.faults:
        firmware = ".".join(map(str, identity.firmware))
        yield well("LED frame", f"{led_frame.port}: firmware {firmware}, no faults")
