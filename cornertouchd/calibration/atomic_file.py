"""Files that a power cut leaves whole: the old one or the new one, and the one before it.

Beside the file NAME lies NAME.previous.  While they are changed there are others, whose names
begin with a dot; those that a crash left are dealt with at the next change.
"""

import contextlib
import errno
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path

MODE = 0o644
"""Whoever runs the daemon may read what somebody else calibrated."""


def previous_of(path: Path) -> Path:
    """Return where the file before the one at `path` is kept."""
    real = _followed(path)
    return real.with_name(f"{real.name}.previous")


def replace_file(path: Path, content: bytes, *, keep_previous: bool = True) -> None:
    """Put `content` at `path`; what stood there becomes the previous one, if that is to be kept.

    Where `path` is a symbolic link, the file that it points to is replaced.  Raises `OSError` if
    the disk refuses; the file that stood there is then untouched.
    """
    path = _followed(path)
    _require_file(path)
    _make_directory(path.parent)
    with _locked(path.parent) as directory:
        _clean_up(directory, path)
        if keep_previous and path.exists():
            _put(directory, previous_of(path), path.read_bytes())
        _put(directory, path, content)


def roll_back_file(path: Path, check: Callable[[bytes], object]) -> None:
    """Exchange the file at `path` and the previous one; doing it again undoes it.

    `check` is given the content of the previous one and raises what it likes to refuse it.  Raises
    `OSError` if there is none, or the disk refuses.
    """
    path = _followed(path)
    previous, replaced = previous_of(path), _replaced(path)
    _require_file(path)
    with _locked(path.parent) as directory:
        _clean_up(directory, path)
        former = previous.read_bytes()
        check(former)
        if path.exists():
            _put(directory, replaced, path.read_bytes())
        _put(directory, path, former)
        if replaced.exists():
            _rename(directory, replaced, previous)


def _clean_up(directory: int, path: Path) -> None:
    """Remove what a crash left behind, and finish a rollback that it interrupted."""
    previous, replaced = previous_of(path), _replaced(path)
    for left_over in (_new(path), _new(previous), _new(replaced)):
        left_over.unlink(missing_ok=True)
    if replaced.exists():
        if path.exists() and previous.exists() and path.read_bytes() == previous.read_bytes():
            _rename(directory, replaced, previous)
        else:
            replaced.unlink()


def _put(directory: int, path: Path, content: bytes) -> None:
    """Write a new file, whole and on the disk before it gets its name."""
    new = _new(path)
    try:
        handle = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, MODE)
        try:
            os.fchmod(handle, MODE)
            rest = memoryview(content)
            while rest:
                rest = rest[os.write(handle, rest) :]
            os.fsync(handle)
        finally:
            os.close(handle)
        _rename(directory, new, path)
    except OSError:
        with contextlib.suppress(OSError):
            new.unlink()
        raise


def _rename(directory: int, source: Path, target: Path) -> None:
    """Rename, and return when that is on the disk: the next change must not overtake it."""
    source.replace(target)
    os.fsync(directory)


@contextlib.contextmanager
def _locked(directory: Path) -> Iterator[int]:
    """Open a directory that no other process changes so meanwhile."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield handle
    finally:
        os.close(handle)


def _require_file(path: Path) -> None:
    """Raise `OSError` for what must not be replaced: a device, a pipe, a directory."""
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is not a regular file; name another")


def _make_directory(directory: Path) -> None:
    """Make a directory and those above it, so that it is there after a power cut."""
    if directory.is_dir():
        return
    _make_directory(directory.parent)
    directory.mkdir(exist_ok=True)
    with _locked(directory.parent) as above:
        os.fsync(above)


def _followed(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _new(path: Path) -> Path:
    return path.with_name(f".{path.name}.new")


def _replaced(path: Path) -> Path:
    return path.with_name(f".{path.name}.replaced")
