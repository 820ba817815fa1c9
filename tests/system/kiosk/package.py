"""The Debian package, built once for a state of the files that it is made of."""

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from system.kiosk.disk import KioskError, pack, run_in, unpacked
from system.kiosk.machine import ROOT, Machine, cache_folder

BUILDERS = ("dpkg-buildpackage", "dh_virtualenv", "ar", "avr-gcc", "help2man")
PACKAGED = ("cornertouchd", "config", "docs", "firmware", "systemd", "packaging",
            "pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE")  # fmt: skip
BUILD_S = 900.0
SAID = "opt/kiosk/installation"
"""What the installation said, on the disk."""
QUIET = {"DEBIAN_FRONTEND": "noninteractive"}


def built_package() -> Path:
    """Return the package of the files that git knows, built if need be.  Raises `KioskError`."""
    names = _output("git", "ls-files", "-z", "--", *PACKAGED).split("\0")
    files = [name for name in sorted(filter(None, names)) if (ROOT / name).is_file()]
    digest = hashlib.sha256()
    for name in files:
        digest.update(name.encode() + b"\0" + hashlib.sha256((ROOT / name).read_bytes()).digest())
    package = cache_folder() / f"package-{digest.hexdigest()[:12]}.deb"
    if not package.exists():
        _build(files, package)
    return package


def with_package(machine: Machine, package: Path) -> Machine:
    """Return a machine on whose disk the package is installed, made if need be.

    It is installed as into any image of a kiosk, by chroot: its units are enabled, not started, and
    its hot loops are compiled at the speed of this machine.  Raises `KioskError`.
    """
    image = cache_folder() / f"{machine.image.stem}-{package.stem}.ext4"
    if not image.exists():
        if os.geteuid() != 0:
            raise KioskError(
                "installing the package into an image needs root, once; run `sudo env "
                f"XDG_CACHE_HOME={cache_folder().parent} PYTHONPATH=.:tests {sys.executable} "
                "-m system.kiosk installed`"
            )
        with unpacked(machine.image) as root:
            shutil.copy(package, root / "package.deb")
            said = run_in(root, "dpkg", "--install", "/package.deb", environ=QUIET)
            (root / "package.deb").unlink()
            (root / SAID).write_text(said)
            pack(root, image)
    return Machine(machine.kernel, image)


def as_version(package: Path, version: str, folder: Path) -> Path:
    """Return a copy of a package that says that it is of another version."""
    made = folder / f"cornertouchd-{version}.deb"
    shutil.copy(package, made)
    with tempfile.TemporaryDirectory() as work:
        _output("dpkg-deb", "--control", package, work)
        control = Path(work, "control")
        lines = control.read_text().splitlines()
        control.write_text(
            "\n".join(f"Version: {version}" if line.startswith("Version:") else line
                      for line in lines) + "\n"
        )  # fmt: skip
        archive = Path(work).with_suffix(".files") / "control.tar.xz"
        archive.parent.mkdir()
        _output("tar", "--owner=0", "--group=0", "-cJf", archive, "-C", work, ".")
        _output("ar", "r", made, archive)
        shutil.rmtree(archive.parent)
    return made


def _build(files: list[str], package: Path) -> None:
    """Build in a copy of the files, so that a checkout is left as it is."""
    missing = [builder for builder in BUILDERS if shutil.which(builder) is None]
    if missing:
        raise KioskError(
            f"the package cannot be built without {', '.join(missing)}: apt-get install "
            "avr-libc build-essential debhelper dh-virtualenv gcc-avr help2man python3-dev "
            "python3-venv"
        )
    with tempfile.TemporaryDirectory(prefix="kiosk-package-") as work:
        for name in files:
            (Path(work) / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, Path(work) / name)
        _output("git", "init", "-q", work)
        _output("git", "-C", work, "add", ".")
        _output("make", "-C", Path(work) / "packaging", "deb")
        (built,) = (Path(work) / "packaging" / "build").glob("cornertouchd_*.deb")
        unfinished = package.with_name(f"{package.name}.{os.getpid()}")
        shutil.copy(built, unfinished)
        unfinished.rename(package)


def _output(*command: str | Path) -> str:
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=BUILD_S
    )
    if done.returncode:
        said = "\n".join((done.stdout + done.stderr).splitlines()[-20:])
        raise KioskError(f"{command[0]} failed with status {done.returncode}:\n{said}")
    return done.stdout
