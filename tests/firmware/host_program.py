"""A host of its own process: arms the LED frame at the port given, says so, and goes on."""

import sys
import threading

from cornertouchd.devices.serial_link import SerialLedFrame
from cornertouchd.ports import Report
from cornertouchd.wire.ledframe import SetLevels, SetPattern, SetTiming, State
from cornertouchd.wire.ledframe_reports import ControllerStatus
from cornertouchd.wire.ledframe_session import Light

LIGHT = Light(SetLevels((100,) * 4), SetTiming(8333, 400, 20), SetPattern((15,)))


class Faults:
    def fault(self, kind: str, detail: object = "") -> None:
        print(f"{kind}: {detail}", file=sys.stderr, flush=True)

    def good(self) -> None:
        pass


def main() -> None:
    armed = threading.Event()

    def listen(report: Report, received_at_s: float) -> None:
        if isinstance(report, ControllerStatus) and report.state is State.ARMED:
            armed.set()

    frame = SerialLedFrame(sys.argv[1], listen, Faults())
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    armed.wait()
    print("armed", flush=True)
    sys.stdin.read()
    frame.close()


if __name__ == "__main__":
    main()
