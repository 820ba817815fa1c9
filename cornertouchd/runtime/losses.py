"""Pictures that a camera took and nobody got, added up over its openings."""

from typing import Protocol, runtime_checkable

from cornertouchd.devices.v4l2_camera import PictureCounts


@runtime_checkable
class CountsPictures(Protocol):
    """A camera that counts what became of its pictures."""

    def counts(self) -> PictureCounts:
        """Return it, since it was opened."""
        ...


class Losses:
    """Lost and damaged pictures of all openings.  `add` is for one thread, `of` for any."""

    def __init__(self) -> None:
        self._before = (0, 0)

    def of(self, camera: object) -> tuple[int, int]:
        """Return how many were lost and damaged, those of the camera that is open included."""
        lost, damaged = self._before
        if not isinstance(camera, CountsPictures):
            return lost, damaged
        counts = camera.counts()
        return lost + counts.stream.lost, damaged + counts.damaged + counts.marked_bad

    def add(self, camera: object) -> None:
        """Take over what a camera counted, which is about to be closed."""
        self._before = self.of(camera)
