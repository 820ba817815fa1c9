"""The suites of tests/guest, each in a guest of its own: real drivers, real daemon, real TUIO.

A suite that bears the mark `systemd` runs on a system that systemd has booted, the others without.
"""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from system.kiosk.guest import Boot, KioskGuest
from system.kiosk.kernels import compiled_kernels, take_kernels
from system.kiosk.machine import ROOT, Machine
from system.kiosk.painting import paint_show

SUITES = sorted((ROOT / "tests" / "guest").glob("test_*.py"))
BUILD_S, SUITE_S = 3000.0, 900.0


@pytest.fixture(scope="module")
def compiled(machine: Machine) -> Path:
    """What numba compiles, compiled in the guest."""
    return compiled_kernels(machine)


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """What the simulated cameras see, and the calibration for it."""
    folder = tmp_path_factory.mktemp("show")
    paint_show(folder)
    yield folder
    for loop in folder.glob("*.np[yz]"):  # large, and of no use to whoever looks at a failure
        loop.unlink()


@pytest.mark.timeout(BUILD_S)
def test_the_guest_can_be_made(machine: Machine, compiled: Path, show: Path) -> None:
    with KioskGuest(machine) as guest:
        assert guest.run("uname -r && modprobe vivid && modprobe uvcvideo", SUITE_S).status == 0


@pytest.mark.timeout(SUITE_S)
@pytest.mark.parametrize("suite", SUITES, ids=lambda suite: suite.stem)
def test_in_the_guest(suite: Path, machine: Machine, compiled: Path, show: Path) -> None:
    boot: Boot = "systemd" if "pytest.mark.systemd" in suite.read_text() else "bare"
    with KioskGuest(machine, boot) as guest:
        take_kernels(compiled, guest)
        shutil.copytree(show, guest.share / "show")
        command = f"python3 -m pytest -n 0 -p no:cacheprovider {suite.relative_to(ROOT)}"
        ran = guest.run(command, SUITE_S)
    assert ran.status == 0, ran.output
