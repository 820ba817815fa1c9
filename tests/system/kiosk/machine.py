"""Kernel and root image of the guest: taken from a cache, else built.

The kernel comes from the folder named by $CORNERTOUCHD_KIOSK_CACHE, else from where prototypes lie
beside the checkout (kernel-*-uml.tar.zst), else `build_kernel.sh` builds it.  The image is Debian
with our dependencies, as pyproject.toml names them; it is built anew when anything of that changes.
"""

import fcntl
import hashlib
import os
import shutil
import sys
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from system.kiosk.disk import KioskError, made_at, pack, run_in, run_program, work_folder

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
OVERLAY = HERE / "overlay"
KERNELS_BESIDE = ROOT.parent / "shared" / "prototypes" / "kiosk-vm"
KERNEL_ARCHIVES = "kernel-*-uml.tar.zst"

SUITE, PYTHON = "bookworm", "3.11"
PACKAGES = (
    *("systemd", "systemd-sysv", "udev", "dbus", "kmod", "procps", "iproute2", "adduser"),
    *("python3", "python3-venv", "python3-pip", "init-system-helpers", "busybox", "strace", "sudo"),
    *("v4l-utils", "usbutils", "libusb-1.0-0", "libinput-tools", "evtest", "python3-evdev"),
    *("xserver-xorg-core", "xserver-xorg-video-dummy", "xserver-xorg-input-libinput", "chromium"),
)
TEST_PACKAGES = ("pytest", "pytest-timeout", "pytest-xdist", "hypothesis")
PYTHON_FOLDER = f"usr/local/lib/python{PYTHON}/dist-packages"


@dataclass(frozen=True, slots=True)
class Machine:
    """What a guest boots: the kernel, and the disk, which every boot only reads."""

    kernel: Path
    image: Path


def find_machine() -> Machine:
    """Return kernel and image, built if need be, which takes minutes.  Raises `KioskError`."""
    folder = cache_folder()
    with _locked(folder):
        kernel = _find_kernel(folder)
        image = folder / f"root-{_image_key(kernel)}.ext4"
        if not image.exists():
            _build_image(kernel / "modules", image)
    return Machine(kernel / "linux", image)


def cache_folder() -> Path:
    """Return where kernels, images and what is compiled in guests are kept."""
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(caches) / "cornertouchd-kiosk"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Let one process at a time build."""
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _find_kernel(folder: Path) -> Path:
    """Return the folder with `linux` and `modules`."""
    given = os.environ.get("CORNERTOUCHD_KIOSK_CACHE")
    place = Path(given) if given else KERNELS_BESIDE
    archives = sorted(place.glob(KERNEL_ARCHIVES))
    if given and not archives:
        raise KioskError(f"$CORNERTOUCHD_KIOSK_CACHE: {place} has no {KERNEL_ARCHIVES}")
    inputs = [archives[-1]] if archives else [HERE / "kernel.config", HERE / "build_kernel.sh"]
    kernel = folder / f"kernel-{_key(path.read_bytes() for path in inputs)}"
    if not kernel.exists():
        with made_at(kernel) as unfinished:
            unfinished.mkdir()
            if archives:
                run_program("tar", "--zstd", "-xf", archives[-1], "-C", unfinished)
            else:
                run_program(HERE / "build_kernel.sh", unfinished)
    return kernel


def _image_key(kernel: Path) -> str:
    """Name everything that the image depends on."""
    files = sorted(path for path in OVERLAY.rglob("*") if path.is_file())
    parts = [path.read_bytes() for path in (HERE / "disk.py", Path(__file__))]
    parts += ["\n".join(_requirements()).encode(), kernel.name.encode()]
    for path in files:
        parts += [str(path.relative_to(OVERLAY)).encode(), path.read_bytes()]
    return _key(parts)


def _requirements() -> tuple[str, ...]:
    """Return what pip is to install: our dependencies, and what runs the tests."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return (*project["dependencies"], *TEST_PACKAGES)


def _build_image(modules: Path, image: Path) -> None:
    if os.geteuid() != 0:
        raise KioskError(
            "building the root image needs root, once; run `sudo env "
            f"XDG_CACHE_HOME={cache_folder().parent} PYTHONPATH=tests {sys.executable} "
            "-m system.kiosk build`"
        )
    with work_folder(image) as work:
        root = work / "root"
        run_program(
            # What it mounts is gone with it, even if it is killed.
            *("unshare", "--mount"),
            *("mmdebstrap", "--variant=minbase", "--components=main", "--mode=root"),
            *("--aptopt=Acquire::Languages none", f"--include={','.join(PACKAGES)}"),
            *(f"--dpkgopt=path-exclude=/usr/share/{what}/*" for what in ("man", "doc", "locale")),
            *(SUITE, root),
        )
        run_program(
            *(sys.executable, "-m", "pip", "install", "--quiet", "--no-compile"),
            *("--python-version", PYTHON, "--only-binary=:all:"),
            *("--target", root / PYTHON_FOLDER, *_requirements()),
        )
        # Imports of numba and scipy take half the time when they are compiled beforehand.
        run_in(root, "sh", "-c", f"python3 -m compileall -q /{PYTHON_FOLDER} || true")
        shutil.copytree(OVERLAY, root, dirs_exist_ok=True)
        shutil.copytree(modules, root / "lib" / "modules", dirs_exist_ok=True)
        (root / "host").mkdir()
        pack(root, image)


def _key(parts: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()[:12]
