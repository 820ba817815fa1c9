"""Whole pictures of all cameras, set by set, for recordings."""

import queue
import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace

from cornertouchd.model import Frame
from cornertouchd.ports import CameraError, CameraPort

QUEUE_FRAMES = 400
"""Pictures that may wait for the disk: a second of four cameras at 100 Hz."""

LONGEST_WAIT_S = 1.0
"""Frames wait so long for fellows; those of a camera that is late by more never come."""

LOOK_S = 0.1
"""How often it is looked whether to stop while no picture comes."""


class FrameGrouping:
    """Puts frames of one instant together; a frame without its fellows is dropped and counted."""

    def __init__(self, cameras: Sequence[str], tolerance_s: float) -> None:
        self._waiting: dict[str, deque[Frame]] = {camera: deque() for camera in cameras}
        self._tolerance_s = tolerance_s
        self.dropped = 0

    def add(self, frame: Frame) -> list[tuple[Frame, ...]]:
        """Take a frame; return the sets that it completes, in the order of the cameras."""
        self._waiting[frame.camera].append(frame)
        self._drop_before(frame.captured_at_s - LONGEST_WAIT_S)
        complete: list[tuple[Frame, ...]] = []
        while all(self._waiting.values()):
            heads = [frames[0] for frames in self._waiting.values()]
            oldest = min(heads, key=lambda head: head.captured_at_s)
            newest = max(heads, key=lambda head: head.captured_at_s)
            if newest.captured_at_s - oldest.captured_at_s <= self._tolerance_s:
                complete.append(tuple(frames.popleft() for frames in self._waiting.values()))
            else:
                self._waiting[oldest.camera].popleft()
                self.dropped += 1
        return complete

    def _drop_before(self, time_s: float) -> None:
        for frames in self._waiting.values():
            while frames and frames[0].captured_at_s < time_s:
                frames.popleft()
                self.dropped += 1


class Recorder:
    """Reads all cameras, each in a thread of its own, and yields frame sets.

    Raises `CameraError` as soon as one camera fails, or when the cameras are not in step: a
    recording with holes is no help.
    """

    def __init__(self, ports: Sequence[CameraPort], tolerance_s: float, timeout_s: float) -> None:
        self._ports = ports
        self._timeout_s = timeout_s
        self._grouping = FrameGrouping([port.id for port in ports], tolerance_s)
        self._arrived: queue.Queue[Frame | CameraError] = queue.Queue(QUEUE_FRAMES)
        self._stop = threading.Event()

    @property
    def dropped(self) -> int:
        """Frames without fellows of the same instant."""
        return self._grouping.dropped

    def frame_sets(self, stop: Callable[[], bool]) -> Generator[tuple[Frame, ...]]:
        """Yield frame sets until `stop()`, asked often; the cameras are closed then."""
        threads = [
            threading.Thread(target=self._read, args=(port,), name=f"record-{port.id}", daemon=True)
            for port in self._ports
        ]
        for thread in threads:
            thread.start()
        try:
            lonely = 0
            while not stop():
                try:
                    frame = self._arrived.get(timeout=LOOK_S)
                except queue.Empty:
                    continue
                if isinstance(frame, CameraError):
                    raise frame
                complete = self._grouping.add(frame)
                lonely = 0 if complete else lonely + 1
                if lonely > QUEUE_FRAMES:
                    raise CameraError(
                        frame.camera,
                        "never sees the same instant as all the others: trigger the cameras "
                        "together, or raise pairing.tolerance_ms",
                    )
                yield from complete
        finally:
            self._stop.set()
            for thread in threads:
                thread.join(self._timeout_s)

    def _read(self, port: CameraPort) -> None:
        try:
            camera = port.open()
            try:
                while not self._stop.is_set():
                    frame = camera.read(self._timeout_s)
                    if frame is None:
                        raise CameraError(port.id, f"no picture for {self._timeout_s:g} s")
                    self._put(replace(frame, pixels=frame.pixels.copy()))
            finally:
                camera.close()
        except CameraError as error:
            self._put(error)
        except Exception as error:  # noqa: BLE001  whatever a driver raises ends the recording
            self._put(CameraError(port.id, f"reading failed: {error}"))

    def _put(self, arrived: Frame | CameraError) -> None:
        while not self._stop.is_set():
            try:
                self._arrived.put(arrived, timeout=0.1)
            except queue.Full:
                continue
            return
