"""Frame sets of a rig that someone works at: cameras may be missing for a while."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing

from cornertouchd.config import Settings
from cornertouchd.model import Frame
from cornertouchd.ports import CameraError, CameraPort
from cornertouchd.runtime.recorder import Recorder
from cornertouchd.runtime.stop_signal import StopSignal

LOOK_AGAIN_S = 1.0


def watch_rig(
    ports: Sequence[CameraPort],
    settings: Settings,
    stop: StopSignal,
    tell: Callable[[Sequence[CameraError]], None],
) -> Generator[Sequence[Frame]]:
    """Yield frame sets of all cameras until the signal comes.

    While cameras are missing, `tell` hears of all of them, about once a second.
    """
    while not stop.wait(0.0):
        recorder = Recorder(
            ports, settings.pairing.tolerance_ms / 1000, settings.cameras.read_timeout_s
        )
        try:
            with closing(recorder.frame_sets(lambda: stop.wait(0.0))) as frame_sets:
                yield from frame_sets
        except CameraError as error:
            tell(_missing(ports) or [error])
            stop.wait(LOOK_AGAIN_S)


def _missing(ports: Sequence[CameraPort]) -> list[CameraError]:
    """Return what is wrong with each camera that cannot be opened."""
    errors = []
    for port in ports:
        try:
            port.open().close()
        except CameraError as error:
            errors.append(error)
        except Exception as error:  # noqa: BLE001  a driver may raise anything
            errors.append(CameraError(port.id, f"opening failed: {error}"))
    return errors
