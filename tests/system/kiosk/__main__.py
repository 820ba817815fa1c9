"""`python -m system.kiosk build | run [--systemd] SCRIPT`, with `tests` on the path.

`build` makes all that a guest needs; `image`, `package` and `installed` its parts, so that they can
be made beside one another.
"""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

from system.kiosk.disk import KioskError
from system.kiosk.guest import KioskGuest
from system.kiosk.kernels import compiled_kernels, take_kernels
from system.kiosk.machine import find_machine
from system.kiosk.package import built_package, with_package


def main() -> int:
    """Build what is missing; run a script in the guest and return its exit status."""
    parser = argparse.ArgumentParser(prog="python -m system.kiosk", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("image", help="build the guest's kernel and disk if need be")
    commands.add_parser("build", help="build those, and what is compiled for the guest")
    commands.add_parser("package", help="build the Debian package")
    commands.add_parser("installed", help="build a disk that has the package")
    run = commands.add_parser("run", help="run a shell script in the guest")
    run.add_argument("script", type=Path)
    run.add_argument("--systemd", action="store_true", help="boot systemd")
    run.add_argument("--timeout", type=float, default=300.0, help="seconds")
    arguments = parser.parse_args()
    try:
        if arguments.command != "run":
            print(*_made(arguments.command), sep="\n")
            return 0
        machine = find_machine()
        compiled = compiled_kernels(machine)
        with KioskGuest(machine, "systemd" if arguments.systemd else "bare") as guest:
            take_kernels(compiled, guest)
            return guest.run(arguments.script.read_text(), arguments.timeout).status
    except KioskError as error:
        print(f"kiosk: {error}", file=sys.stderr)
        return 125


def _made(what: str) -> Iterable[Path]:
    if what == "package":
        return [built_package()]
    machine = find_machine()
    if what == "image":
        return machine.kernel, machine.image
    if what == "installed":
        return [with_package(machine, built_package()).image]
    return machine.kernel, machine.image, compiled_kernels(machine)


if __name__ == "__main__":
    sys.exit(main())
