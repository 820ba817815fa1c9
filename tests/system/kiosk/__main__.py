"""`python -m system.kiosk build | run [--systemd] SCRIPT`, with `tests` on the path."""

import argparse
import sys
from pathlib import Path

from system.kiosk.guest import KioskGuest
from system.kiosk.kernels import compiled_kernels, take_kernels
from system.kiosk.machine import KioskError, find_machine


def main() -> int:
    """Build what is missing; run a script in the guest and return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m system.kiosk", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("build", help="build kernel, image and compiled kernels if need be")
    run = commands.add_parser("run", help="run a shell script in the guest")
    run.add_argument("script", type=Path)
    run.add_argument("--systemd", action="store_true", help="boot systemd")
    run.add_argument("--timeout", type=float, default=300.0, help="seconds")
    arguments = parser.parse_args()
    try:
        machine = find_machine()
        compiled = compiled_kernels(machine)
        if arguments.command == "build":
            print(machine.kernel, machine.image, compiled, sep="\n")
            return 0
        with KioskGuest(machine, "systemd" if arguments.systemd else "bare") as guest:
            take_kernels(compiled, guest)
            return guest.run(arguments.script.read_text(), arguments.timeout).status
    except KioskError as error:
        print(f"kiosk: {error}", file=sys.stderr)
        return 125


if __name__ == "__main__":
    sys.exit(main())
