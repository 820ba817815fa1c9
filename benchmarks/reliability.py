"""What a fault of a camera does to touches: the table of docs/reliability.md.

    python benchmarks/reliability.py [--update]

Boots the guest of tests/system and runs its suite of faults: USB cameras of the kernel's own
drivers fail mid-touch.  What is measured is what the suite asserts.
"""

import argparse
import json
import re
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from doc_tables import put_into, table

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from system.kiosk.disk import KioskError  # noqa: E402
from system.kiosk.guest import KioskGuest  # noqa: E402
from system.kiosk.kernels import compiled_kernels, take_kernels  # noqa: E402
from system.kiosk.machine import find_machine  # noqa: E402
from system.kiosk.painting import paint_show  # noqa: E402

PAGE = ROOT / "docs" / "reliability.md"
SUITE = "python3 -m pytest -n 0 -p no:cacheprovider tests/guest/test_faults.py"
SUITE_S = 900.0
TITLES = ("fault", "cameras", "what the daemon said", "what the client saw", "seconds to recover")
SAYS = re.compile(r"(?:ERROR|WARNING|INFO) (.*)")
DEVICE = re.compile(r"/dev/v4l/by-id/\S+-index0")
LONGEST_MESSAGE = 120
A_MOMENT = 0.02
"""Less of the time without a touch is what landing takes, fault or not."""


def main() -> None:
    """Run the faults and print the table, or put it into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help=f"write it into {PAGE.name}")
    arguments = parser.parse_args()
    try:
        episodes, status = run_faults()
    except KioskError as error:
        raise SystemExit(f"the guest cannot be made: {error}") from None
    lines = table(TITLES, [_row(episode) for episode in episodes])
    print("\n".join(lines))
    if status:
        raise SystemExit(f"the suite of faults failed with status {status}")
    if arguments.update:
        put_into(PAGE, "faults", lines)


def run_faults() -> tuple[list[dict[str, Any]], int]:
    """Return what each fault did, and the exit status of the suite.  Raises `KioskError`."""
    machine = find_machine()
    compiled = compiled_kernels(machine)
    with TemporaryDirectory() as folder, KioskGuest(machine) as guest:
        paint_show(Path(folder))
        take_kernels(compiled, guest)
        shutil.copytree(folder, guest.share / "show")
        status = guest.run(SUITE, SUITE_S).status
        results = guest.share / "faults.jsonl"
        told = results.read_text().splitlines() if results.exists() else []
    return [json.loads(line) for line in told], status


def _row(episode: dict[str, Any]) -> list[str]:
    cameras = episode["cameras"]
    return [
        episode["fault"],
        "all" if len(cameras) == 4 else ", ".join(cameras),
        _messages(episode["said"]),
        _client(episode),
        f"{episode['recovered_s']:.1f}" if episode["recovered_s"] else "not told",
    ]


def _messages(said: list[str]) -> str:
    """Return what was said, each kind of message once."""
    kinds: dict[str, str] = {}
    for line in said:
        found = SAYS.search(line)
        if found:
            message = DEVICE.sub("its device", found[1])
            kinds.setdefault(re.sub(r"\bC\d\b|\d+", "#", message), _shortened(message))
    return "; ".join(kinds.values()) or "nothing"


def _shortened(message: str) -> str:
    return message if len(message) <= LONGEST_MESSAGE else message[: LONGEST_MESSAGE - 1] + "…"


def _client(episode: dict[str, Any]) -> str:
    share = episode["missing_s"] / episode["down_s"] if episode["down_s"] else 0.0
    saw = "touches all the time" if share < A_MOMENT else f"no touch for {share:.0%} of the time"
    wrong = len(episode["wrong"])
    return saw + (f"; {wrong} touches that were not there" if wrong else "; none that is not there")


if __name__ == "__main__":
    main()
