"""The Debian package, installed in the guest under systemd: tests/guest/installed."""

import shutil
from pathlib import Path

import pytest
from system.kiosk.guest import KioskGuest
from system.kiosk.machine import Machine
from system.kiosk.package import as_version

SUITE = "tests/guest/installed"
BUILD_S, SUITE_S = 3000.0, 600.0
LATER = "99.0"


@pytest.mark.timeout(BUILD_S)
def test_the_package_is_built(machine: Machine, package: Path) -> None:
    assert package.stat().st_size > 0


@pytest.mark.timeout(SUITE_S + 60)
def test_the_installed_package_under_systemd(machine: Machine, package: Path) -> None:
    with KioskGuest(machine, "systemd") as guest:
        packages = guest.share / "packages"
        packages.mkdir()
        shutil.copy(package, packages / "cornertouchd.deb")
        as_version(package, LATER, packages).rename(packages / "later.deb")
        ran = guest.run(f"python3 -m pytest -n 0 -s -p no:cacheprovider {SUITE}", SUITE_S)
    assert ran.status == 0, ran.output
