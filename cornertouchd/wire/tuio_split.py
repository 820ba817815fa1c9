"""A frame of TUIO 1.1 in as many bundles as it takes, whichever profile."""

from collections.abc import Iterator, Sequence
from typing import Protocol, TypeVar


class Told(Protocol):
    """What a set message tells of a contact."""

    @property
    def id(self) -> int:
        """The session id."""
        ...


AnyTold = TypeVar("AnyTold", bound=Told)
EncodedTold_contra = TypeVar("EncodedTold_contra", bound=Told, contravariant=True)


class Encoder(Protocol[EncodedTold_contra]):
    """Writes the bundles of one profile."""

    def encode(
        self, alive: Sequence[int], told: Sequence[EncodedTold_contra], fseq: int, /
    ) -> bytes:
        """Return one bundle."""
        ...

    def size_bytes(self, alive_count: int, told_count: int, /) -> int:
        """Return the length of the bundle that `encode` makes."""
        ...


def split_frame(
    encoder: Encoder[AnyTold],
    continuing: Sequence[AnyTold],
    new: Sequence[AnyTold],
    fseq: int,
    max_bytes: int,
) -> Iterator[bytes]:
    """Encode a frame in as many bundles as it takes, new contacts first.

    Each names the contacts known before and those new ones that it or an earlier one sets:
    some clients (Qt) show a contact at its first mention, at 0, 0 if it is not set.
    """
    alive = [each.id for each in continuing]
    waiting = [*new, *continuing]
    still_new = len(new)
    while True:
        count = len(waiting)
        while encoder.size_bytes(len(alive) + min(count, still_new), count) > max_bytes:
            count -= 1
        batch, waiting = waiting[:count], waiting[count:]
        alive += [each.id for each in batch[:still_new]]
        still_new = max(still_new - count, 0)
        yield encoder.encode(alive, batch, fseq)
        if not waiting:
            return
