"""A new user's way: docs/kiosk.md step by step, its very commands, with four USB cameras.

The package has been installed and nothing else: the user binds the cameras by covering lenses,
writes the configuration, calibrates as the terminal says, and starts the service.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import dedent

import pytest
from guest.client import TuioClient, compare, wait_until
from uvc.rig import UvcRig
from uvc.show import CAMERAS, LOOP_S, RATE_HZ, Show

pytestmark = [pytest.mark.systemd, pytest.mark.timeout(600)]

PAGE = Path(__file__).resolve().parents[3] / "docs" / "kiosk.md"
SCENES = Path("/host/show")
PACKAGE = Path("/host/packages/cornertouchd.deb")
CONFIG = Path("/etc/cornertouchd/cornertouchd.toml")
SECTIONS = ("Install", "Set up")
TOUCHES_WITHIN_S = 60.0
WATCH_S = 2 * LOOP_S


def steps() -> list[tuple[str, str]]:
    """Return the page's commands, each for itself, and its settings, in their order."""
    found = []
    for section in SECTIONS:
        text = re.split(
            r"^## ", PAGE.read_text().split(f"\n## {section}\n")[1], flags=re.MULTILINE
        )[0]
        for kind, block in re.findall(
            r"^ *```(sh|toml)\n(.*?)^ *```$", text, re.MULTILINE | re.DOTALL
        ):
            plain = dedent(block).strip()
            found += [(kind, line) for line in (plain.splitlines() if kind == "sh" else [plain])]
    return found


@dataclass
class User:
    """Does what the page says; `said` is what each command said, in their order."""

    rig: UvcRig
    home: Path
    scenes: dict[str, tuple[int, int]] = field(
        default_factory=lambda: json.loads((SCENES / "scenes.json").read_text())
    )
    said: list[tuple[str, str]] = field(default_factory=list)

    def show(self, scene: str) -> None:
        """Let the cameras see a scene."""
        first, count = self.scenes[scene]
        self.rig.show_only(range(first, first + count))

    def do(self, command: str) -> None:
        """Type a command, and do at the rig what it asks for; it must end well."""
        print(f"\n$ {command}", flush=True)
        process = subprocess.Popen(
            ["bash", "-c", command],
            cwd=self.home,
            env={"PATH": os.environ["PATH"], "LANG": "C.UTF-8", "HOME": str(self.home)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert process.stdout is not None
        said = ""
        for line in process.stdout:
            sys.stdout.write(f"  {line}")
            sys.stdout.flush()
            said += line
            self._obey(line)
        self.said.append((command, said))
        process.stdout.close()
        assert process.wait() == 0, f"{command}: {said}"

    def _obey(self, line: str) -> None:
        covering = re.match(r"cover the lens of camera (C\d)", line)
        freeing = re.match(r"(C\d) \S+ is /dev/video", line)
        tapping = re.search(r"(\S+) mm from the left, (\S+) mm from the top", line)
        if covering:
            self.rig.dark(covering[1])
        elif freeing:
            self.rig.go(freeing[1])
        elif tapping:
            lifting = "lift the finger" in line
            self.show("empty" if lifting else f"{tapping[1]} {tapping[2]}")
        elif line.startswith("Scribble"):
            self.show("scribble")
        elif line.startswith(("Empty", "Cameras")):
            self.show("empty")

    def write(self, settings: str) -> None:
        """Change the settings of the configuration that the page shows, each in its place."""
        text, section = CONFIG.read_text(), ""
        for line in settings.splitlines():
            if line.startswith("["):
                section = re.escape(line)
            elif line:
                key = re.escape(line.split(" =")[0])
                pattern = rf"(^{section}\n(?:(?!^\[).*\n)*?)#?{key} = .*$"
                text, changed = re.subn(pattern, rf"\g<1>{line}", text, count=1, flags=re.MULTILINE)
                assert changed, f"{line}: not in {section} of {CONFIG}"
        CONFIG.write_text(text)


@pytest.fixture(scope="module")
def show() -> Show:
    return Show.load(SCENES)


@pytest.fixture(scope="module")
def user(show: Show, tmp_path_factory: pytest.TempPathFactory) -> Iterator[User]:
    """One who has done all that the page says."""
    home = tmp_path_factory.mktemp("user")
    (package,) = re.findall(r"\./(\S+\.deb)", PAGE.read_text())
    shutil.copy(PACKAGE, home / package)
    home.chmod(0o755)
    with UvcRig(show.pictures, RATE_HZ) as rig:
        user = User(rig, home)
        user.show("empty")
        for kind, step in steps():
            if kind == "sh":
                user.do(step)
            else:
                user.write(step)
        user.show("empty")
        yield user
        subprocess.run(["systemctl", "stop", "cornertouchd"], check=True)


@pytest.fixture(scope="module")
def client(user: User) -> Iterator[TuioClient]:
    client = TuioClient()
    yield client
    client.close()


def journal() -> str:
    command = ["journalctl", "--unit", "cornertouchd", "--no-pager"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def said_by(user: User, pattern: str) -> str:
    (said,) = [said for command, said in user.said if re.search(pattern, command)]
    return said


def test_the_table_shows_four_cameras(user: User) -> None:
    assert len(re.findall(r"/dev/video\d+", said_by(user, "cameras$"))) >= len(CAMERAS)


def test_covered_lenses_have_bound_the_cameras(user: User) -> None:
    assert all(Path(f"/dev/cornertouch/{camera.lower()}").exists() for camera in CAMERAS)


def test_the_check_finds_nothing_wrong(user: User) -> None:
    assert "error" not in said_by(user, "check$")


def test_fresh_taps_are_located_well(user: User) -> None:
    offs_mm = re.findall(r"([\d.]+) mm, good", said_by(user, "calibrate$"))
    assert len(offs_mm) == 5
    assert all(float(off_mm) < 1.0 for off_mm in offs_mm)


def test_touches_arrive_where_fingers_are(user: User, show: Show, client: TuioClient) -> None:
    """Once the live page is there: its start keeps the only processor busy for seconds."""
    wait_until(lambda: "live page: " in journal(), TOUCHES_WITHIN_S, "the live page")
    wait_until(lambda: not client.shown_at(float("inf")), TOUCHES_WITHIN_S, "an empty surface")
    user.show("show")
    wait_until(lambda: bool(client.shown_at(float("inf"))), TOUCHES_WITHIN_S, "the first touch")
    began_s = time.monotonic()
    time.sleep(WATCH_S)
    seen = compare(client, show, user.rig, (began_s, began_s + WATCH_S), near_mm=2.0)
    print(
        f"\n  {len(seen.errors_mm)} places, error median {seen.error_mm(0.5):.2f} mm, "
        f"95 % {seen.error_mm(0.95):.2f} mm, not shown {seen.missing_s:.1f} of {seen.down_s:.1f} s"
    )
    assert not seen.wrong
    assert seen.error_mm(0.5) < 0.5
    assert seen.missing_s < seen.down_s / 10


def test_the_status_is_well(user: User) -> None:
    assert "4 cameras" in said_by(user, "systemctl status")
    subprocess.run(["cornertouchd", "status"], check=True)
