"""What a driver's errors mean to the person who has to mend them."""

import errno
import os
from pathlib import Path

import pytest

from cornertouchd.devices.v4l2_faults import explain


def told(number: int, device: str = "/dev/cam", proc: Path = Path("/nowhere")) -> str:
    return explain(OSError(number, os.strerror(number)), device, "GREY 64x48 at 60 Hz", proc)


@pytest.fixture
def proc(tmp_path: Path) -> Path:
    """A small /proc: one process has the camera open, another may not be looked into."""
    (tmp_path / "video0").touch()
    for number, name in ((41, "cheese"), (42, "sshd")):
        files = tmp_path / "proc" / str(number) / "fd"
        files.mkdir(parents=True)
        (files.parent / "comm").write_text(f"{name}\n")
    (tmp_path / "proc" / "41" / "fd" / "7").symlink_to(tmp_path / "video0")
    (tmp_path / "proc" / "43").mkdir()
    (tmp_path / "proc" / "meminfo").touch()
    return tmp_path / "proc"


def test_who_holds_a_busy_camera_is_named(proc: Path) -> None:
    link = proc.parent / "c1"
    link.symlink_to(proc.parent / "video0")
    assert told(errno.EBUSY, str(link), proc) == (
        f"{link} is held by another program (cheese, process 41); stop that"
    )
    assert "(of another user, or in a container)" in told(errno.EBUSY, "/dev/other", proc)


def test_a_full_bus_says_what_to_change() -> None:
    assert told(errno.ENOSPC).startswith(
        "/dev/cam: no bandwidth is left on its USB bus for GREY 64x48 at 60 Hz; lower "
        'cameras.rate_hz, choose a smaller size or cameras.pixel_format = "MJPG", or plug'
    )


def test_an_error_that_nobody_foresaw_has_its_name() -> None:
    assert told(errno.ERANGE) == (
        "/dev/cam refuses GREY 64x48 at 60 Hz: ERANGE (Numerical result out of range)"
    )
    assert "refuses GREY 64x48 at 60 Hz: 0 (no number)" in explain(
        OSError("no number"), "/dev/cam", "GREY 64x48 at 60 Hz"
    )
