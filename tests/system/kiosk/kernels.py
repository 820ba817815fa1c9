"""What numba compiles takes a minute in the guest: it is compiled once and kept for the next."""

import os
import shutil
from pathlib import Path

from system.kiosk.guest import KioskGuest
from system.kiosk.machine import KioskError, Machine, cache_folder

from cornertouchd.compiling import numba

COMPILE_S = 900.0
IMPORT_ALL = """
import importlib, pkgutil, cornertouchd
for module in pkgutil.walk_packages(cornertouchd.__path__, "cornertouchd."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""


def compiled_kernels(machine: Machine) -> Path:
    """Return the folder with what is compiled for the guest.  Raises `KioskError`."""
    state = Path(str(numba.config.CACHE_DIR)).name  # type: ignore[attr-defined]
    folder = cache_folder() / f"{state}-{machine.image.stem}"
    if folder.exists():
        return folder
    with KioskGuest(machine) as guest:
        (guest.share / "import_all.py").write_text(IMPORT_ALL)
        ran = guest.run("python3 /host/import_all.py", COMPILE_S)
        if ran.status:
            raise KioskError(f"the kernels cannot be compiled in the guest:\n{ran.output}")
        unfinished = folder.with_name(f"{folder.name}.{os.getpid()}")
        shutil.copytree(guest.share / "compiled", unfinished)
    try:
        unfinished.rename(folder)
    except OSError:  # another process was quicker
        shutil.rmtree(unfinished)
    return folder


def take_kernels(folder: Path, guest: KioskGuest) -> None:
    """Give a guest what is compiled; it may compile more for itself."""
    shutil.copytree(
        folder, guest.share / "compiled", dirs_exist_ok=True, copy_function=shutil.copy2
    )
