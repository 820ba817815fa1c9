"""The guest's disk as a tree of files, in which programs run at the speed of this machine.

A program that the guest runs is the same here: same processor, and the files and the paths of the
guest, by chroot.  Only root may do so.
"""

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

IMAGE_BYTES = 3 << 30
"""Three times what it holds; the file is sparse."""


class KioskError(Exception):
    """The guest cannot be made here; the message says what is missing."""


@contextmanager
def made_at(place: Path) -> Iterator[Path]:
    """Give another place to work at; what is there in the end comes to `place` at once."""
    unfinished = place.with_name(f"{place.name}.{os.getpid()}")
    try:
        yield unfinished
        unfinished.rename(place)
    finally:
        if unfinished.is_dir():
            run_program("rm", "-rf", unfinished)
        unfinished.unlink(missing_ok=True)


@contextmanager
def work_folder(beside: Path) -> Iterator[Path]:
    """Give a folder on the disk of `beside`, which is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="kiosk-root-", dir=beside.parent) as work:
        yield Path(work)


@contextmanager
def unpacked(image: Path) -> Iterator[Path]:
    """Give the files of an image as a tree, a copy.  Raises `KioskError`."""
    with work_folder(image) as work:
        root = work / "root"
        root.mkdir()
        run_program("debugfs", "-R", f"rdump / {root}", image)
        yield root


def pack(root: Path, image: Path) -> None:
    """Make an image of a tree.  Raises `KioskError`."""
    with made_at(image) as unfinished:
        with unfinished.open("wb") as file:
            file.truncate(IMAGE_BYTES)
        run_program(
            *("mke2fs", "-q", "-t", "ext4", "-O", "^has_journal", "-E", "lazy_itable_init=0"),
            *("-d", root, unfinished),
        )


def run_in(root: Path, *command: str, environ: dict[str, str] | None = None) -> str:
    """Run a program on a tree as the guest would; return what it said.  Raises `KioskError`."""
    path = "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
    values = [f"{name}={value}" for name, value in (environ or {}).items()]
    return run_program("chroot", root, "env", "-i", path, "LANG=C.UTF-8", *values, *command)


def run_program(*command: str | Path) -> str:
    """Run a program; return what it said.  Raises `KioskError` with the end of it."""
    try:
        done = subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
    except FileNotFoundError:
        raise KioskError(f"{command[0]} is missing; install it") from None
    if done.returncode:
        said = "\n".join(done.stdout.splitlines()[-20:])
        raise KioskError(f"{command[0]} failed with status {done.returncode}:\n{said}")
    return done.stdout
