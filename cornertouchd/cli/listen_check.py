"""`cornertouchd listen --check`: what in a stream breaks the rules of TUIO 1.1."""

import math
import time

import click

from cornertouchd.devices.tuio_listening import StreamEndedError, TuioInput
from cornertouchd.wire.tuio_rules import Transport, TuioCheck

# A tracker that is wrong in every packet fills no disk with what it does; all are counted.
MOST_LINES = 1000
LOOK_EVERY_S = 0.5


def check_stream(packets: TuioInput, transport: Transport, seconds: float | None) -> None:
    """Print every violation until the stream or the time is over, then how many there were.

    Raises `click.exceptions.Exit` with status 1 if there were any, or if nothing came.
    """
    check = TuioCheck(transport)
    violations = 0
    end_s = math.inf if seconds is None else time.monotonic() + seconds
    ending = ""
    try:
        while (left_s := end_s - time.monotonic()) > 0.0:
            came = packets.receive(min(left_s, LOOK_EVERY_S))
            for violation in check.feed(*came) if came else ():
                violations += 1
                if violations <= MOST_LINES:
                    click.echo(
                        f"packet {violation.packet}, byte {violation.offset}: "
                        f"{violation.rule}: {violation.what}"
                    )
    except KeyboardInterrupt:
        pass
    except StreamEndedError as ended:
        ending = f"{ended}; "
    click.echo(
        f"{ending}{check.packets} packets, {violations} violations, "
        f"{check.lost_frames} frames lost on the way",
        err=True,
    )
    if violations or not check.packets:
        raise click.exceptions.Exit(1)
