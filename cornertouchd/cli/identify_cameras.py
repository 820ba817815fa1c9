"""`cornertouchd cameras --identify`: which camera stands in which corner, by covering lenses."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, suppress

import click

from cornertouchd.guiding.identifying import Identifier
from cornertouchd.ports import Camera, CameraError, CameraPort

READ_TIMEOUT_S = 0.05
"""All cameras are read in turn: one that stalls holds the others up for so long."""


class PicturesInTurn:
    """Pictures of several opened cameras, one of each in turn.  Use as a context manager.

    `names` are what cameras are called here, by the names of their ports.  A camera that cannot be
    opened or is lost is told and left out.
    """

    def __init__(
        self, ports: Sequence[CameraPort], names: Mapping[str, str], tell: Callable[[str], None]
    ) -> None:
        self._tell = tell
        self._opened = ExitStack()
        self._cameras: dict[str, Camera] = {}
        for port in ports:
            try:
                self._cameras[names[port.id]] = self._opened.enter_context(closing(port.open()))
            except CameraError as error:
                tell(f"{error.reason}; it is left out")

    def __enter__(self) -> "PicturesInTurn":
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that give pictures."""
        return tuple(self._cameras)

    def feed(self, identifier: Identifier) -> str | None:
        """Read every camera once; return the one that is meant, None while that is not clear."""
        meant = None
        for name, camera in list(self._cameras.items()):
            try:
                frame = camera.read(READ_TIMEOUT_S)
            except CameraError as error:
                self._tell(f"{error.reason}; it is left out")
                del self._cameras[name]
                continue
            if frame is not None:
                meant = identifier.feed(name, frame.pixels) or meant
        return meant


def identify(
    corners: Sequence[str],
    pictures: PicturesInTurn,
    ask: Callable[[str], None],
    stopped: Callable[[], bool],
) -> Iterator[tuple[str, str]]:
    """Ask for one corner after the other; yield it with the camera that was meant.

    Ends before that if all cameras are lost or the user stops it.  A camera that was found before
    is not taken again.
    """
    if not pictures.cameras:
        return
    identifier = Identifier()
    found: set[str] = set()
    ask("hands off all cameras, please: their usual light is being learned")
    while pictures.cameras and not identifier.ready and not stopped():
        pictures.feed(identifier)
    for dark in identifier.dark_cameras:
        ask(f"{dark} sees hardly any light; switch the LED frame on, or take its lens cap off")
    for corner in corners:
        ask(f"cover the lens of camera {corner}, or touch right before it")
        meant = None
        while meant is None and pictures.cameras and not stopped():
            meant = pictures.feed(identifier)
            if meant in found:
                ask(f"that is {meant}, which was taken; cover the lens of camera {corner}")
                _wait_until_free(identifier, pictures, stopped)
                meant = None
        if meant is None:
            return
        found.add(meant)
        yield corner, meant
        _wait_until_free(identifier, pictures, stopped)


def _wait_until_free(
    identifier: Identifier, pictures: PicturesInTurn, stopped: Callable[[], bool]
) -> None:
    while pictures.cameras and not identifier.all_free and not stopped():
        pictures.feed(identifier)


def confirmed(question: str) -> bool:
    """Ask a person at a terminal; without one the answer is no."""
    with suppress(click.Abort):
        return click.confirm(question, default=False, err=True)
    return False
