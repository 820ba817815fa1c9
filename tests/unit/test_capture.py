"""A capture thread outlives whatever its camera does.

The fake camera does what its script says, one step a read; it is held to the port's contract by
`test_the_fake_keeps_the_contract`, as the simulated camera is by its own tests.
"""

import logging
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.config import CamerasSettings
from cornertouchd.devices.v4l2_camera import PictureCounts
from cornertouchd.devices.v4l2_stream import StreamCounts
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import Frame, Observation, PictureFormat, Shadows
from cornertouchd.ports import CameraError
from cornertouchd.runtime.capture import CaptureStages, CaptureThread
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.keeping import Keeping
from cornertouchd.runtime.latest import Latest
from cornertouchd.runtime.recovery import Recovery
from cornertouchd.vision.background import MaskedColumns

Step = str
FAST = CamerasSettings(
    read_timeout_s=0.05, failures_before_reopen=3, reopen_delay_s=0.1, reopen_delay_max_s=0.1
)
CALIBRATED = CameraCalibration(
    "C1",
    "usb 1:2 serial A",
    PictureFormat(4, 3, 0, 3),
    np.zeros((3, 4)),
    AnglePolynomial((0.0, 0.0), (0.8, 0.8), 4),
    0.1,
)


class FakePort:
    """A camera that does what the script says: good, sunny, none, garbage, gone, absent, bug."""

    id = "C1"
    format = PictureFormat(4, 3, 0, 3)

    def __init__(self, script: list[Step]) -> None:
        self._script = iter(script)
        self.exchanged_at: set[int] = set()
        self.opened = self.closed = 0
        self.identity = "usb 1:2 serial A"
        self.done = threading.Event()
        self.released = threading.Event()

    def next_step(self) -> Step:
        """Return the next step; when there are none left, wait to be released."""
        step = next(self._script, None)
        if step is None:
            self.done.set()
            self.released.wait(30)
            return "none"
        return step

    def open(self) -> "FakeCamera":
        self.opened += 1
        if self.opened in self.exchanged_at:
            self.identity = "usb 1:2 serial B"
        else:
            self.identity = "usb 1:2 serial A"
        return FakeCamera(self)


class FakeCamera:
    def __init__(self, port: FakePort) -> None:
        self._port = port
        self._sequence = 0

    def counts(self) -> PictureCounts:
        """Of each opening two pictures were lost and three damaged."""
        return PictureCounts(StreamCounts(lost=2), 1, 2)

    def read(self, timeout_s: float) -> Frame | None:
        step = self._port.next_step()
        self._sequence += 1
        if step == "gone":
            raise CameraError("C1", "gone")
        if step == "bug":
            raise RuntimeError("a driver's bug")
        if step == "none":
            return None
        rows = 3 if step in {"good", "sunny"} else 1
        pixels = np.full((rows, 4), 255 if step == "sunny" else 0, np.uint8)
        return Frame("C1", self._sequence, float(self._sequence), None, pixels)

    def close(self) -> None:
        self._port.closed += 1


DEAD_LED = MaskedColumns(40, 44, "dead LED", "replace it")
GLARE = MaskedColumns(100, 180, "at full scale", "shade the sun")
BLIND_AT_START = (DEAD_LED,)
DAZZLED = (DEAD_LED, GLARE)


class StubPipeline:
    """Accepts pictures of the right size only, like the real one."""

    def observe(self, frame: Frame) -> Observation:
        if frame.pixels.shape != (3, 4):
            raise ValueError("a picture of another size")
        return Observation(frame.camera, frame.sequence, frame.captured_at_s, Shadows.of(()))

    def find_strip_shift(self, frame: Frame) -> None:
        """The strip is where it was."""

    blind_columns = BLIND_AT_START

    def find_blind_columns(self, frame: Frame) -> tuple[MaskedColumns, ...]:
        """The sun makes pictures white."""
        return DAZZLED if frame.pixels.any() else BLIND_AT_START


@pytest.fixture
def run() -> Iterator[object]:
    started: list[tuple[CaptureThread, FakePort]] = []

    def start(
        script: list[Step], exchanged_at: tuple[int, ...] = (), kept: Keeping | None = None
    ) -> tuple[CaptureThread, FakePort, Latest[Observation]]:
        port, box = FakePort(script), Latest[Observation]()
        port.exchanged_at.update(exchanged_at)
        thread = CaptureThread(
            port,
            CaptureStages(CALIBRATED, StubPipeline(), box, kept=kept),
            FAST,
            Recovery("C1", None, FAST, MonotonicClock()),
        )
        thread.start()
        started.append((thread, port))
        assert port.done.wait(30)
        return thread, port, box

    yield start
    for thread, port in started:
        thread.stop()
        port.released.set()
        thread.join(5.0)


def test_pictures_are_kept_those_that_cannot_be_used_included(run) -> None:
    kept = Keeping({"C1": CALIBRATED.format}, 100.0, 10, 16)
    thread, _, _ = run(["good", "sunny", "garbage", "good"], kept=kept)
    assert [frame.sequence for frame in kept.last(99.0)] == [1, 2, 4]
    assert thread.counts().faults == 1


def test_what_the_driver_lost_is_added_up_over_all_openings(run) -> None:
    thread, port, _ = run(["good", "gone", "good", "gone", "good"])
    assert port.opened == 3
    assert (thread.counts().lost, thread.counts().damaged) == (6, 9)


def test_the_fake_keeps_the_contract() -> None:
    camera = FakePort(["good", "none", "gone"]).open()
    frame = camera.read(0.1)
    assert frame is not None
    assert frame.camera == "C1"
    assert camera.read(0.1) is None
    with pytest.raises(CameraError):
        camera.read(0.1)
    camera.close()
    camera.close()


def test_pictures_become_observations(run) -> None:
    thread, _, box = run(["good"] * 4)
    assert thread.counts().frames == 4
    assert len(box.take(0)) == 1
    assert box.dropped() == {"C1": 3}


def test_columns_that_go_blind_are_told_once_and_when_they_see_again(
    run, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        run(["good"] * 10 + ["sunny"] * 20 + ["good"] * 10)
    assert [record.message for record in caplog.records] == [
        "camera C1: columns 100..180 see little or nothing: at full scale; shade the sun",
        "camera C1: columns 100..180 see again",
    ]


def test_a_camera_that_vanishes_is_opened_again(run, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        thread, port, _ = run(["good", "gone"] + ["good"] * 60)
    assert thread.counts().frames == 61
    assert port.opened == 2
    assert port.closed == 1
    assert "camera C1: lost: gone" in caplog.text
    assert "works again after 1 fault" in caplog.text


def test_a_camera_that_was_exchanged_is_refused_until_the_calibrated_one_is_back(
    run, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        thread, port, _ = run(["good", "gone", "good"], exchanged_at=(2, 3))
    assert thread.counts().frames == 2  # none of the other camera
    assert (port.opened, port.closed) == (4, 3)
    assert "is another camera (usb 1:2 serial B) than was calibrated (usb 1:2 serial A)" in (
        caplog.text
    )
    assert caplog.text.count("refused") == 1


def test_a_few_bad_pictures_do_not_close_the_camera(run) -> None:
    thread, port, _ = run(["good", "garbage", "garbage", "good"])
    assert thread.counts().frames == 2
    assert thread.counts().faults == 2
    assert port.opened == 1


def test_a_run_of_failures_takes_the_camera_out_and_retries(run) -> None:
    thread, port, _ = run(["good", "garbage", "garbage", "garbage", "good"])
    assert thread.counts().frames == 2
    assert port.opened == 2


def test_a_stall_counts_as_failure(run) -> None:
    _, port, _ = run(["good", "none", "none", "none", "good"])
    assert port.opened == 2


def test_a_bug_in_a_driver_does_not_end_the_thread(run, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR):
        thread, _, _ = run(["good", "bug", "good"])
    assert thread.counts().frames == 2
    assert "a driver's bug" in caplog.text
    assert "Traceback" in caplog.text


def test_the_same_fault_is_logged_once(run, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR):
        run(["gone"] * 4)
    assert caplog.text.count("camera C1: lost: gone") == 1


def test_it_stops_when_told(run) -> None:
    thread, port, _ = run(["good"])
    thread.stop()
    port.released.set()
    thread.join(5.0)
    assert (port.opened, port.closed) == (1, 1)


def test_a_fault_that_comes_and_goes_is_logged_once(run, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        thread, _, _ = run(["good", "garbage"] * 30)
    assert thread.counts().faults == 30
    assert len(caplog.records) == 1
