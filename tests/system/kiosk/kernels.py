"""What numba compiles takes a minute: it is compiled once for the guest and kept for the next."""

import os
import shutil
from pathlib import Path

from system.kiosk.disk import KioskError, made_at, run_in, unpacked
from system.kiosk.guest import ENVIRONMENT, KioskGuest, fill_share
from system.kiosk.machine import Machine, cache_folder

COMPILE_S = 900.0
IMPORT_ALL = """
import importlib, pkgutil, cornertouchd
for module in pkgutil.walk_packages(cornertouchd.__path__, "cornertouchd."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""


def compiled_kernels(machine: Machine) -> Path:
    """Return the folder with what is compiled for the guest.  Raises `KioskError`.

    Root compiles on the guest's disk, outside of the guest, in a third of the time.
    """
    from cornertouchd.compiling import numba  # an image can be built before it is there

    state = Path(str(numba.config.CACHE_DIR)).name  # type: ignore[attr-defined]
    folder = cache_folder() / f"{state}-{machine.image.stem}"
    if folder.exists():
        return folder
    with made_at(folder) as unfinished:
        if os.geteuid() == 0:
            _compile_here(machine, unfinished)
        else:
            _compile_in_guest(machine, unfinished)
    return folder


def _compile_here(machine: Machine, into: Path) -> None:
    with unpacked(machine.image) as root:
        share = root / "host"
        fill_share(share)
        (share / "import_all.py").write_text(IMPORT_ALL)
        run_in(root, "python3", "/host/import_all.py", environ=ENVIRONMENT)
        shutil.copytree(share / "compiled", into)


def _compile_in_guest(machine: Machine, into: Path) -> None:
    with KioskGuest(machine) as guest:
        (guest.share / "import_all.py").write_text(IMPORT_ALL)
        ran = guest.run("python3 /host/import_all.py", COMPILE_S)
        if ran.status:
            raise KioskError(f"the kernels cannot be compiled in the guest:\n{ran.output}")
        shutil.copytree(guest.share / "compiled", into)


def take_kernels(folder: Path, guest: KioskGuest) -> None:
    """Give a guest what is compiled; it may compile more for itself."""
    shutil.copytree(
        folder, guest.share / "compiled", dirs_exist_ok=True, copy_function=shutil.copy2
    )
