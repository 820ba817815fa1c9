"""What the faults of the LED frame mean, and what to do about them."""

from cornertouchd.wire.ledframe import SIDE_NAMES, Fault

# With one of these the frame is dark until the fault is cleared.
DARK = (
    Fault.OVERCURRENT
    | Fault.OVERTEMPERATURE
    | Fault.HOST_LOST
    | Fault.SHORT_TOP
    | Fault.SHORT_RIGHT
    | Fault.SHORT_BOTTOM
    | Fault.SHORT_LEFT
)
# These are over once they are known: the daemon clears them itself.
PASSED = Fault.HOST_LOST | Fault.BROWNOUT | Fault.WATCHDOG_RESET

OPEN_LED_REMEDY = "look for an open LED, a loose plug or a missing supply"

_MEANINGS = {
    Fault.OVERCURRENT: "over-current: all sides are off; look for a short in the LED wiring, then "
    "clear the fault",
    Fault.OVERTEMPERATURE: "over-temperature: the drivers reached 80 °C, all sides are off until "
    "they are below 70 °C; lower the levels or give them air",
    Fault.HOST_LOST: "the controller had heard nothing for too long and went dark; if it comes "
    "again, look at the USB cable and the load of the machine",
    Fault.BROWNOUT: "the controller's supply had dropped; look at its USB cable and power supply",
    Fault.WATCHDOG_RESET: "the controller had hung or was asked to restart; if it comes again, "
    "write the firmware anew",
}


def open_sides(faults: Fault) -> int:
    """Return the sides that draw no current, bits 0 to 3 top to left."""
    return sum(1 << side for side in range(len(SIDE_NAMES)) if Fault.OPEN_TOP << side & faults)


def sides_of(mask: int) -> tuple[str, ...]:
    """Return the names of the sides whose bits are set."""
    return tuple(name for side, name in enumerate(SIDE_NAMES) if mask >> side & 1)


def explain(faults: Fault) -> list[str]:
    """Return a sentence for each fault: what it means and the remedy."""
    explained = [meaning for fault, meaning in _MEANINGS.items() if fault in faults]
    for side, name in enumerate(SIDE_NAMES):
        if Fault(Fault.OPEN_TOP << side) in faults:
            explained.append(f"{name} side: no current; {OPEN_LED_REMEDY}")
        if Fault(Fault.SHORT_TOP << side) in faults:
            explained.append(
                f"{name} side: too much current, all sides are off; look for a shorted LED or "
                "driver, then clear the fault"
            )
    return explained
