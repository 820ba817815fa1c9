"""The Debian package, installed in the guest under systemd: tests/guest/installed."""

import shutil
from pathlib import Path

import pytest
from system.kiosk.guest import KioskGuest
from system.kiosk.machine import ROOT, Machine
from system.kiosk.package import as_version
from system.kiosk.painting import paint_scenes

SUITES = sorted((ROOT / "tests" / "guest" / "installed").glob("test_*.py"))
BUILD_S, SUITE_S = 3000.0, 900.0
LATER = "99.0"


@pytest.mark.timeout(BUILD_S)
def test_the_package_can_be_installed(installed: Machine) -> None:
    assert installed.image.exists()


@pytest.mark.timeout(SUITE_S + 60)
@pytest.mark.parametrize("suite", SUITES, ids=lambda suite: suite.stem)
def test_the_installed_package_under_systemd(
    suite: Path, installed: Machine, package: Path
) -> None:
    with KioskGuest(installed, "systemd") as guest:
        packages = guest.share / "packages"
        packages.mkdir()
        shutil.copy(package, packages / "cornertouchd.deb")
        as_version(package, LATER, packages).rename(packages / "later.deb")
        if "UvcRig" in suite.read_text():
            (guest.share / "show").mkdir()
            paint_scenes(guest.share / "show")
        command = f"python3 -m pytest -n 0 -s -p no:cacheprovider {suite.relative_to(ROOT)}"
        ran = guest.run(command, SUITE_S)
    assert ran.status == 0, ran.output
