"""What the system tests need of this machine: a guest, and the package that is installed in it."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest
from system.kiosk.disk import KioskError
from system.kiosk.machine import Machine, find_machine
from system.kiosk.package import built_package, with_package

T = TypeVar("T")


def _needed(make: Callable[[], T]) -> T:
    """Return what is made; where it cannot be, skip, or fail if the machine must have it."""
    try:
        return make()
    except KioskError as error:
        if os.environ.get("CORNERTOUCHD_REQUIRE_KIOSK"):
            pytest.fail(str(error))
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def machine() -> Machine:
    """Kernel and image; making them anew takes minutes."""
    return _needed(find_machine)


@pytest.fixture(scope="session")
def package() -> Path:
    """The Debian package; building it takes a minute."""
    return _needed(built_package)


@pytest.fixture(scope="session")
def installed(machine: Machine, package: Path) -> Machine:
    """The guest with the package on its disk."""
    return _needed(lambda: with_package(machine, package))
