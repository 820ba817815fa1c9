"""The pictures of a simulated rig, painted in a process of their own.

Painting takes as long as the daemon's own work on a picture; in the same process both would wait
for each other, and the daemon would look slower than it is.
"""

import atexit
import multiprocessing
import signal
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait

import numpy as np

from cornertouchd.model import Picture, PictureFormat
from cornertouchd.ports import CameraError
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import Script

Paint = Callable[[int, float], Picture]
"""Paints picture `index`, which shows the script at a time in seconds."""

READY = b"ready"

PATIENCE_S = 20.0
"""A rig is made in a second; a machine that needs twenty cannot show it."""


def painter(rig: SimulatedRig, script: Script, camera_id: str) -> Paint:
    """Return what paints the pictures of one camera in this process."""

    def paint(index: int, script_s: float) -> Picture:
        return rig.render(camera_id, index, [each.finger for each in script(script_s)])

    return paint


class PaintingProcess:
    """Paints on demand; every camera may ask from a thread of its own.

    `make` returns the rig and the script; it is called in the process, so it must be picklable.
    The first picture waits for the rig to be made.  The process ends with the one that started it,
    however that ends.
    """

    def __init__(
        self,
        make: Callable[[], tuple[SimulatedRig, Script]],
        formats: dict[str, PictureFormat],
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._formats = formats
        pipes = {camera: context.Pipe() for camera in formats}
        self._asking = {camera: ours for camera, (ours, _) in pipes.items()}
        theirs = [(camera, end) for camera, (_, end) in pipes.items()]
        self._ready: set[str] = set()
        self._process = context.Process(target=_serve, args=(make, theirs), daemon=True)
        self._process.start()
        atexit.register(self.end)  # else multiprocessing would wait for it at the end
        for _, end in theirs:
            end.close()

    def end(self) -> None:
        """End the process; the cameras are lost then."""
        atexit.unregister(self.end)
        self._process.kill()  # it heeds no other signal
        self._process.join()

    def painter(self, camera_id: str) -> Paint:
        """Return what has the pictures of one camera painted there."""
        asking, form = self._asking[camera_id], self._formats[camera_id]

        def paint(index: int, script_s: float) -> Picture:
            try:
                self._wait_until_ready(camera_id)
                asking.send((index, script_s))
                if not asking.poll(PATIENCE_S):
                    raise CameraError(camera_id, "the simulation does not answer")
                painted = np.frombuffer(asking.recv_bytes(), np.uint8)
            except (EOFError, OSError):
                raise CameraError(camera_id, "the simulation has ended; start anew") from None
            return painted.reshape(form.rows_px, form.width_px)

        return paint

    def _wait_until_ready(self, camera_id: str) -> None:
        if camera_id in self._ready:
            return
        asking = self._asking[camera_id]
        if not asking.poll(PATIENCE_S) or asking.recv_bytes() != READY:
            raise CameraError(camera_id, "the simulation does not start")
        self._ready.add(camera_id)


def _serve(
    make: Callable[[], tuple[SimulatedRig, Script]], cameras: Sequence[tuple[str, Connection]]
) -> None:
    """Paint what is asked for until nobody can ask any more."""
    for number in (signal.SIGINT, signal.SIGTERM):  # they are for the daemon, whose end is ours
        signal.signal(number, signal.SIG_IGN)
    rig, script = make()
    paints = {connection: painter(rig, script, camera) for camera, connection in cameras}
    for connection, paint in paints.items():
        paint(0, 0.0)  # the first one makes what all others need
        connection.send_bytes(READY)
    while paints:
        ready = wait(list(paints))
        for asked in [connection for connection in paints if connection in ready]:
            try:
                index, script_s = asked.recv()
                asked.send_bytes(paints[asked](index, script_s).tobytes())
            except (EOFError, OSError):
                del paints[asked]
