"""What the kernel makes of a touchscreen's events: a fake that tests/guest checks against it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from cornertouchd.wire.touchscreen import (
    ABS_MT_SLOT,
    ABS_MT_TRACKING_ID,
    BTN_TOUCH,
    EV_ABS,
    EV_KEY,
    EV_SYN,
    EVENT,
    Axis,
)


@dataclass(slots=True)
class KernelScreen:
    """Keeps slots, axes and key as a program finds them that asks the kernel for its state.

    Values that an axis cannot have fail, which the kernel lets pass.
    """

    axes: Mapping[int, Axis]
    slots: dict[int, dict[int, int]] = field(default_factory=dict)
    state: dict[int, int] = field(default_factory=dict)
    is_touched: bool = False
    reports: int = 0
    times_s: list[float] = field(default_factory=list)
    is_there: bool = True
    refusal: OSError | None = None
    _slot: int = 0

    def write(self, events: bytes) -> None:
        if self.refusal is not None:
            raise self.refusal
        assert self.is_there
        told = list(EVENT.iter_unpack(events))
        assert [kind == EV_SYN for _, _, kind, _, _ in told].index(True) == len(told) - 1
        self.reports += 1
        self.times_s.append(told[0][0] + told[0][1] / 1e6)
        for _, _, kind, code, value in told[:-1]:
            self._take(kind, code, value)

    def close(self) -> None:
        self.is_there = False

    @property
    def touches(self) -> dict[int, dict[int, int]]:
        """The slots that are touched, each with what it tells."""
        return {
            slot: values
            for slot, values in self.slots.items()
            if values.get(ABS_MT_TRACKING_ID, -1) >= 0
        }

    def _take(self, kind: int, code: int, value: int) -> None:
        if kind == EV_KEY:
            assert code == BTN_TOUCH
            assert self.is_touched != bool(value)
            self.is_touched = bool(value)
            return
        assert kind == EV_ABS
        assert value <= self.axes[code].largest
        assert value >= (-1 if code == ABS_MT_TRACKING_ID else 0)
        if code == ABS_MT_SLOT:
            self._slot = value
        elif code > ABS_MT_SLOT:
            self.slots.setdefault(self._slot, {})[code] = value
        else:
            self.state[code] = value
