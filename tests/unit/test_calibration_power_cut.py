"""A power cut at any moment of saving or rolling back leaves the old calibration or the new one.

A child process does the work and is killed before its k-th change of the disk, k = 1, 2, ...  What
it did until then is told through a pipe, and every state in which the disk may be found afterwards
is tried: data that was not synced is lost or not, a name that was not synced is changed or not.
"""

import itertools
import json
import os
import shutil
import signal
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cornertouchd.calibration.calibration import Calibration, CalibrationError, CameraCalibration
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.calibration.file import (
    load_calibration,
    rollback_calibration,
    save_calibration,
)
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import PictureFormat

NAME = "calibration.json"
MORE_THAN_ENOUGH = 200


def calibration(software: str) -> Calibration:
    model = AnglePolynomial((0.0, 0.0), (0.7, 0.9), 16)
    size = PictureFormat(16, 12, 2, 4)
    cameras = (CameraCalibration(c, "", size, np.ones((4, 16)), model, 0.1) for c in ("C1", "C2"))
    expected = ErrorMap(np.array([1.0]), np.array([1.0]), np.array([[0.2]]))
    place = (350.0, 400.0)
    return Calibration("auto", "now", software, place, 4, 0, 0, 0.1, expected, tuple(cameras))


@dataclass
class Disk:
    """Names and contents as a disk keeps them; a content is (what was written, was it synced)."""

    names: dict[str, int] = field(default_factory=dict)
    contents: dict[int, tuple[bytes, bool]] = field(default_factory=dict)
    handles: dict[int, int] = field(default_factory=dict)
    unsynced: list[Callable[[dict[str, int]], None]] = field(default_factory=list)

    @classmethod
    def of(cls, directory: Path) -> "Disk":
        disk = cls()
        for number, path in enumerate(sorted(directory.iterdir())):
            disk.names[path.name] = -1 - number
            disk.contents[-1 - number] = (path.read_bytes(), True)
        return disk

    def do(self, step: dict[str, Any]) -> None:
        match step:
            case {"do": "create", "name": name, "handle": handle, "serial": serial}:
                self.contents[serial] = (b"", False)
                self.handles[handle] = serial
                self.unsynced.append(lambda names: names.update({name: serial}))
            case {"do": "write", "handle": handle, "bytes": text}:
                serial = self.handles[handle]
                before, _ = self.contents[serial]
                self.contents[serial] = (before + bytes.fromhex(text), False)
            case {"do": "sync", "handle": handle}:
                serial = self.handles[handle]
                self.contents[serial] = (self.contents[serial][0], True)
            case {"do": "sync directory"}:
                for change in self.unsynced:
                    change(self.names)
                self.unsynced = []
            case {"do": "replace", "from": source, "to": target}:
                serial = self._now()[source]

                def rename(names: dict[str, int]) -> None:
                    names.pop(source, None)
                    names[target] = serial

                self.unsynced.append(rename)
            case {"do": "unlink", "name": name}:
                self.unsynced.append(lambda names: void(names.pop(name, None)))

    def _now(self) -> dict[str, int]:
        names = dict(self.names)
        for change in self.unsynced:
            change(names)
        return names

    def without_power_cut(self) -> dict[str, bytes]:
        return {name: self.contents[serial][0] for name, serial in self._now().items()}

    def after_power_cut(self) -> Iterator[dict[str, bytes]]:
        """Yield every state in which the disk may be found."""
        for happened in itertools.product((False, True), repeat=len(self.unsynced)):
            names = dict(self.names)
            for change in itertools.compress(self.unsynced, happened):
                change(names)
            for lost in (False, True):
                yield {
                    name: b"" if lost and not self.contents[serial][1] else self.contents[serial][0]
                    for name, serial in names.items()
                }


def void(_: object) -> None:
    """Take a value for nothing."""


class KilledAt:
    """Tells every change of the disk through a pipe, and kills the process before the k-th."""

    def __init__(self, k: int, pipe: int) -> None:
        self._left = k
        self._pipe = pipe
        self._serials = itertools.count(1)
        self._write, self._fsync, self._open = os.write, os.fsync, os.open
        self._directories: set[int] = set()

    def install(self) -> None:
        replace, rename, unlink = os.replace, os.rename, os.unlink

        def opened(path: Any, flags: int, *args: Any, **kwargs: Any) -> int:
            if flags & os.O_CREAT:
                self._die_when_it_is_time()
            handle = self._open(path, flags, *args, **kwargs)
            self._directories.discard(handle)
            if flags & os.O_CREAT:
                name = Path(path).name
                self._tell(do="create", name=name, handle=handle, serial=next(self._serials))
            elif flags & os.O_DIRECTORY:
                self._directories.add(handle)
            return handle

        def written(handle: int, data: Any) -> int:
            self._die_when_it_is_time()
            # as much as a full disk or a signal would let through, so that a file has halves
            count = self._write(handle, bytes(data[: max(1, len(data) // 2)]))
            self._tell(do="write", handle=handle, bytes=bytes(data[:count]).hex())
            return count

        def synced(handle: int) -> None:
            self._die_when_it_is_time()
            self._fsync(handle)
            directory = handle in self._directories
            self._tell(do="sync directory" if directory else "sync", handle=handle)

        def renamed(really: Any) -> Any:
            def wrapped(source: Any, target: Any) -> None:
                self._die_when_it_is_time()
                really(source, target)
                self._tell(**{"do": "replace", "from": Path(source).name, "to": Path(target).name})

            return wrapped

        def unlinked(path: Any) -> None:
            self._die_when_it_is_time()
            unlink(path)
            self._tell(do="unlink", name=Path(path).name)

        os.open, os.write, os.fsync = opened, written, synced
        os.replace, os.rename = renamed(replace), renamed(rename)
        os.unlink = os.remove = unlinked

    def _die_when_it_is_time(self) -> None:
        self._left -= 1
        if self._left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def _tell(self, **step: Any) -> None:
        self._write(self._pipe, json.dumps(step).encode() + b"\n")


@dataclass(frozen=True)
class Cut:
    """What was left behind: the real directory, and the states a power cut makes of it."""

    finished: bool
    disk: Disk


def killed_at(k: int, directory: Path, work: Callable[[Path], object]) -> Cut:
    """Do `work` on a directory in a child that dies before its k-th change."""
    disk = Disk.of(directory)
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the child touches no other thread
        child = os.fork()
    if child == 0:
        try:
            os.close(reading)
            KilledAt(k, writing).install()
            work(directory / NAME)
            os._exit(0)
        finally:
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading, "rb") as told:
        for line in told:
            disk.do(json.loads(line))
    _, status = os.waitpid(child, 0)
    killed = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL
    assert killed or os.waitstatus_to_exitcode(status) == 0
    found = {path.name: path.read_bytes() for path in directory.iterdir()}
    assert disk.without_power_cut() == found, "a change of the disk was not noticed"
    return Cut(not killed, disk)


@dataclass(frozen=True)
class Cuts:
    """In which states cuts at every step leave a directory: each of them once."""

    states: tuple[dict[str, bytes], ...]
    uncut: dict[str, bytes]

    def everywhere(self, tmp_path: Path) -> Iterator[Path]:
        """Yield the calibration file in every state, at last in that without any cut."""
        for number, state in enumerate((*self.states, self.uncut)):
            found = tmp_path / f"state {number}"
            found.mkdir()
            for name, content in state.items():
                (found / name).write_bytes(content)
            yield found / NAME


def cuts_of(
    directory: Path, before: Callable[[Path], object], work: Callable[[Path], object]
) -> Cuts:
    """Cut `work` off at every step, each time after what was there before it."""
    prepared = directory / "prepared"
    prepared.mkdir(parents=True)
    before(prepared / NAME)
    states: list[dict[str, bytes]] = []
    for k in range(1, MORE_THAN_ENOUGH):
        copied = directory / f"cut {k}"
        shutil.copytree(prepared, copied)
        cut = killed_at(k, copied, work)
        states += [cut.disk.without_power_cut(), *cut.disk.after_power_cut()]
        if cut.finished:
            assert k > 4
            distinct = {tuple(sorted(state.items())): state for state in states}
            return Cuts(tuple(distinct.values()), cut.disk.without_power_cut())
    raise AssertionError("it never comes to an end")


def in_force(path: Path) -> str:
    return load_calibration(path).software


def save(software: str) -> Callable[[Path], None]:
    return lambda path: save_calibration(calibration(software), path)


def save_twice(path: Path) -> None:
    save("1")(path)
    save("2")(path)


@pytest.fixture(scope="module")
def rollback_cuts(tmp_path_factory: pytest.TempPathFactory) -> Cuts:
    return cuts_of(tmp_path_factory.mktemp("rollback"), save_twice, rollback_calibration)


def test_the_first_save_leaves_nothing_or_all_of_it(tmp_path: Path) -> None:
    found = []
    for path in cuts_of(tmp_path / "cuts", void, save("1")).everywhere(tmp_path):
        found.append(in_force(path) if path.exists() else "none")
        save("2")(path)
        assert in_force(path) == "2"
    assert set(found) == {"none", "1"}
    assert found[-1] == "1"


def test_saving_over_another_leaves_the_old_or_the_new_one(tmp_path: Path) -> None:
    found = []
    for path in cuts_of(tmp_path / "cuts", save_twice, save("3")).everywhere(tmp_path):
        found.append(in_force(path))
        if found[-1] == "3":
            assert rollback_calibration(path).software == "2"
    assert set(found) == {"2", "3"}
    assert found[-1] == "3"


def test_a_rollback_loses_neither_of_the_two(rollback_cuts: Cuts, tmp_path: Path) -> None:
    found = []
    for path in rollback_cuts.everywhere(tmp_path):
        found.append(in_force(path))
        other = rollback_calibration(path).software
        assert {found[-1], other} == {"1", "2"}
        assert rollback_calibration(path).software == found[-1]
    assert set(found) == {"1", "2"}
    assert found[-1] == "1"


def test_a_save_after_a_rollback_that_was_cut_off_keeps_what_was_in_force(
    rollback_cuts: Cuts, tmp_path: Path
) -> None:
    for path in rollback_cuts.everywhere(tmp_path):
        before = in_force(path)
        save("3")(path)
        assert rollback_calibration(path).software == before


def test_what_a_crash_left_is_gone_after_the_next_save(rollback_cuts: Cuts, tmp_path: Path) -> None:
    for path in rollback_cuts.everywhere(tmp_path):
        save("3")(path)
        assert sorted(p.name for p in path.parent.iterdir()) == [NAME, f"{NAME}.previous"]


def test_a_damaged_former_one_does_not_replace_the_one_in_force(tmp_path: Path) -> None:
    path = tmp_path / NAME
    save_twice(path)
    previous = path.with_name(f"{NAME}.previous")
    previous.write_bytes(previous.read_bytes()[:-100])
    with pytest.raises(CalibrationError, match=r"previous: is not a whole JSON file"):
        rollback_calibration(path)
    assert in_force(path) == "2"
