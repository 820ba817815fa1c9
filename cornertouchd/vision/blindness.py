"""Which columns of one camera have been blind for a while, said once when it begins and ends.

Columns come and go from picture to picture: light flickers, hands pass before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from cornertouchd.vision.background import MaskedColumns

LOOK_EVERY_S = 0.5
LOOKS_TO_BEGIN = 4
LOOKS_TO_END = 10
"""Blind at so many looks in a row is worth telling, light that only flashes is not; a hand that
rests before the glare for some seconds does not end it."""

NEAR_PX = 16
"""Runs as near as this are one: the ripple of the LEDs brings only its crests to full scale."""


@dataclass(slots=True)
class _Run:
    """Columns, and at how many looks in a row they were seen to be otherwise than is told."""

    columns: MaskedColumns
    looks: int = 0


class BlindnessWatch:
    """Watches the masked columns of one camera.  Owned by one thread; any may read `blind`.

    `blind` are those known at present, the same objects until something begins or ends.
    """

    def __init__(self, masked: Sequence[MaskedColumns]) -> None:
        """Begin with the columns that are masked in the empty pictures of the calibration."""
        self._told = [_Run(columns) for columns in _joined(masked)]
        self._new: list[_Run] = []
        self._looked_at_s: float | None = None
        self.blind = tuple(run.columns for run in self._told)

    def is_due(self, captured_at_s: float) -> bool:
        """Tell whether it is time for another look."""
        return (
            self._looked_at_s is None or not 0.0 <= captured_at_s - self._looked_at_s < LOOK_EVERY_S
        )

    def look(self, masked: Sequence[MaskedColumns], captured_at_s: float) -> None:
        """Take the columns that are masked in a picture."""
        self._looked_at_s = captured_at_s
        found = _joined(masked)
        for run in self._told:
            run.looks = 0 if _near(run.columns, found) else run.looks + 1
        before = {run.columns: run.looks for run in self._new}
        told = [run.columns for run in self._told]
        self._new = [
            _Run(columns, 1 + max((before[one] for one in _near(columns, before)), default=0))
            for columns in found
            if not _near(columns, told)
        ]
        begun = [_Run(run.columns) for run in self._new if run.looks >= LOOKS_TO_BEGIN]
        lasting = [run for run in self._told if run.looks < LOOKS_TO_END]
        if begun or len(lasting) < len(self._told):
            self._told = lasting + begun
            self._new = [run for run in self._new if run.looks < LOOKS_TO_BEGIN]
            self.blind = tuple(run.columns for run in self._told)


def _near(
    columns: MaskedColumns, others: Sequence[MaskedColumns] | dict[MaskedColumns, int]
) -> list[MaskedColumns]:
    """Return those of the others that are blind for the same reason in the same place."""
    return [
        other
        for other in others
        if other.remedy == columns.remedy
        and other.first_px <= columns.last_px + NEAR_PX
        and columns.first_px <= other.last_px + NEAR_PX
    ]


def _joined(masked: Sequence[MaskedColumns]) -> list[MaskedColumns]:
    """Return runs of columns, from left to right, joined where they are near."""
    joined: list[MaskedColumns] = []
    for columns in masked:
        near = _near(columns, joined)
        if not near:
            joined.append(columns)
            continue
        last_px = max(near[-1].last_px, columns.last_px)
        joined[joined.index(near[-1])] = replace(near[-1], last_px=last_px)
    return joined
