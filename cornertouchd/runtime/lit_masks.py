"""Which sides of the LED frame shone in which picture: reports of frames matched to pictures.

Pure: times arrive with reports and pictures.  Two ways must agree: a picture belongs to the frame
that its time says, and is bright where that frame's sides are.  Else its mask is not known.

The time from a report to its picture is constant, but differs with the driver (stamps at the begin
of the exposure or at the end of the picture): its fraction of a period is followed, its whole
periods are those with which the pictures are bright as told.
"""

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from cornertouchd.wire.ledframe_reports import FrameLit

REPORTS_KEPT = 64
"""Pictures arrive a few periods after their report; a thread that is late by more has lost them."""

CLOCK_DRIFT = 0.006
"""The ceramic resonator of the cheapest boards keeps time to half a percent."""

LATE_BEFORE_ANEW = 50
"""Reports in a row that are late: the controller has another period than it had, and the begin of
frames is taken from the next report."""

LATE_PERIODS = 0.5
"""A report that is later than the clocks allow makes the time of its frame doubtful.  One that is
so much earlier says that all before it came late: they are forgotten."""

LATELY, MOST_DOUBTFUL = 8, 1
"""From so many periods before a picture on, one doubtful report is a machine that was busy.  With
more of them the controller may have stopped for a while, and its times are not what they were."""

LATEST_REPORT_PERIODS = 8.0
"""A picture that is later than the last report by more cannot be assigned."""

SHIFTS = range(5)
"""Whole periods from a report to its picture: the exposure is at the end of the period, drivers
stamp up to one period later, and the line is at most a period late."""

FARTHEST_OFF = 0.3
"""A picture that is off by more periods could be of another frame."""

PHASE_SHARE = 0.05
"""Share by which the fraction follows each picture."""

OFF_BEFORE_ANEW = 20
"""Pictures in a row that fit no frame until the fraction is sought anew."""

PICTURES_KEPT = 48
LOOK_EVERY = 12
FEWEST_OF_A_KIND = 3
"""Lit and dark pictures each, before brightness is believed: six periods of the longest pattern."""

CLEAR_DIFFERENCE_GREY = 12.0
"""Lit and dark pictures differ by more, or brightness tells nothing."""

AS_GOOD_AS_BEST = 0.6
"""A wrong shift takes a dark picture for lit: with one in eight dark, the worst case, it keeps less
than this share of the difference."""

BRIGHT_FOR_DARK, DIM_FOR_LIT = 0.5, 0.2
"""Shares of the usual difference: a dark picture with more, a lit one with less are not believed.
Dimmed LEDs give .4."""

AGREEMENTS_AFTER_CONTRADICTION = 8
"""Pictures in a row that agree until masks are believed again: the longest pattern once."""

TWO_LONGEST_PATTERNS = 16
"""As many frames alike are of a constant pattern."""

CONTRADICTIONS_BEFORE_ANEW = 12
"""Among the pictures kept."""


@dataclass(frozen=True, slots=True)
class ReportedFrame:
    """A frame of the controller: when it began, as told by when reports arrived.

    Of a report that came much later than the others, when it began is doubtful.
    """

    number: int
    lit_mask: int
    began_at_s: float
    doubtful: bool = False


class FrameReports:
    """The frames that the controller reported lately, on the clock of the pictures.

    Written by the thread of the link; any thread may read `recent`.  Reports are late, never early:
    the begin of a frame is the earliest that one of them allows, and rises with the drift of the
    clocks at most.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._frames: deque[ReportedFrame] = deque(maxlen=REPORTS_KEPT)
        self._lock = threading.Lock()
        self._late_in_a_row = 0
        self.starts = 0

    def add(self, report: FrameLit, received_at_s: float) -> None:
        """Take a report."""
        with self._lock:
            last = self._frames[-1] if self._frames else None
            began_at_s, late, early = received_at_s, False, False
            if last is None:
                self._late_in_a_row = 0
            elif report.frame > last.number:
                passed = (report.frame - last.number) * self.period_s
                began_at_s = min(received_at_s, last.began_at_s + passed * (1.0 + CLOCK_DRIFT))
                late = received_at_s - began_at_s > LATE_PERIODS * self.period_s
                expected_s = last.began_at_s + passed * (1.0 - CLOCK_DRIFT)
                early = expected_s - received_at_s > LATE_PERIODS * self.period_s
                self._late_in_a_row = self._late_in_a_row + 1 if late else 0
            if last is not None and (
                early or report.frame <= last.number or self._late_in_a_row >= LATE_BEFORE_ANEW
            ):
                self._begin_anew()
                began_at_s, late = received_at_s, False
            frame = ReportedFrame(report.frame, report.lit_mask, began_at_s, late)
            self._frames.append(frame)

    def begin_anew(self) -> None:
        """Forget all frames: the controller has restarted."""
        with self._lock:
            self._begin_anew()

    @property
    def recent(self) -> tuple[ReportedFrame, ...]:
        """The last frames, in order."""
        with self._lock:
            return tuple(self._frames)

    def _begin_anew(self) -> None:
        self._frames.clear()
        self._late_in_a_row = 0
        self.starts += 1


@dataclass(frozen=True, slots=True)
class MatchCounts:
    """How pictures of one camera were matched; `contradicting` are among the `unknown`."""

    known: int = 0
    unknown: int = 0
    contradicting: int = 0


@dataclass(frozen=True, slots=True)
class _Kept:
    """What is kept of a picture: the mask by every shift, and the brightness of two sides."""

    masks: tuple[int | None, ...]
    brightness: tuple[float, ...]


class MaskMatcher:
    """Tells the lit masks of one camera's pictures.  Owned by its capture thread.

    `sides` are those that the camera looks at, as bits of a mask.
    """

    def __init__(self, reports: FrameReports, sides: Sequence[int]) -> None:
        self._reports = reports
        self._sides = tuple(sides)
        self._starts = reports.starts
        self._counts = MatchCounts()
        self._pictures_since_look = 0
        self._begin_anew()

    @property
    def counts(self) -> MatchCounts:
        """What became of the pictures so far.  Any thread may ask."""
        return self._counts

    def mask(self, captured_at_s: float, brightness: Sequence[float]) -> int | None:
        """Return the lit mask of a picture, None where it is not known for certain.

        `brightness` are the grey levels of the strip on each of `sides`.
        """
        if self._starts != self._reports.starts:
            self._starts = self._reports.starts
            self._begin_anew()
        masks = self._masks_by_shift(captured_at_s)
        if masks is None:
            self._count(known=False)
            return None
        seen = _Kept(masks, tuple(brightness))
        self._pictures.append(seen)
        self._pictures_since_look += 1
        if self._pictures_since_look >= LOOK_EVERY:
            self._pictures_since_look = 0
            self._weigh_shifts()
        told = {masks[shift] for shift in self._plausible}
        mask = told.pop() if len(told) == 1 else None
        contradicts = mask is not None and self._contradicts(mask, seen.brightness)
        self._note(contradicts)
        believed = self._agreeing_in_a_row >= AGREEMENTS_AFTER_CONTRADICTION
        self._count(known=mask is not None and believed, contradicts=contradicts)
        return mask if believed else None

    def _begin_anew(self) -> None:
        self._phase: float | None = None
        self._plausible = list(range(len(SHIFTS)))
        self._pictures: deque[_Kept] = deque(maxlen=PICTURES_KEPT)
        self._pictures_since_look = 0
        self._off_in_a_row = self._contradictions = 0
        self._agreeing_in_a_row = AGREEMENTS_AFTER_CONTRADICTION
        self._usual: list[tuple[float, float] | None] = [None] * len(self._sides)

    def _masks_by_shift(self, captured_at_s: float) -> tuple[int | None, ...] | None:
        """Return what every shift says, None where the time fits no frame."""
        frames, period_s = self._reports.recent, self._reports.period_s
        if not frames:
            return None
        last = frames[-1]
        periods = (captured_at_s - last.began_at_s) / period_s
        if periods > LATEST_REPORT_PERIODS or last.doubtful:
            return None
        since_s = captured_at_s - LATELY * period_s
        if sum(one.doubtful for one in frames if one.began_at_s >= since_s) > MOST_DOUBTFUL:
            return None
        if periods < 0.0:  # the frame that it is in tells better: clocks drift
            last = next((one for one in reversed(frames) if one.began_at_s <= captured_at_s), last)
            periods = (captured_at_s - last.began_at_s) / period_s
        if self._phase is None:
            self._phase = periods - round(periods)
        whole = round(periods - self._phase)
        off = periods - self._phase - whole
        if abs(off) > FARTHEST_OFF:
            self._off_in_a_row += 1
            if self._off_in_a_row >= OFF_BEFORE_ANEW:
                self._begin_anew()
            return None
        self._off_in_a_row = 0
        self._phase += PHASE_SHARE * off
        number = last.number + whole
        masks = {one.number: one.lit_mask for one in frames}
        # in a constant pattern a frame whose report is still on its way is like all others
        constant = len(masks) >= TWO_LONGEST_PATTERNS and len(set(masks.values())) == 1
        otherwise = last.lit_mask if constant else None
        return tuple(masks.get(number - shift, otherwise) for shift in SHIFTS)

    def _weigh_shifts(self) -> None:
        """Keep the shifts with which lit pictures are bright and dark ones are not."""
        differences = [self._difference(shift) for shift in range(len(SHIFTS))]
        best = max((one for one in differences if one is not None), default=None)
        if best is None or best < CLEAR_DIFFERENCE_GREY:
            return
        self._plausible = [
            shift
            for shift, one in enumerate(differences)
            if one is not None and one >= AS_GOOD_AS_BEST * best
        ]
        self._usual = [
            self._means(self._plausible[0], number) for number in range(len(self._sides))
        ]

    def _difference(self, shift: int) -> float | None:
        """Return by how much lit sides are brighter than dark ones, the least of all sides."""
        means = [self._means(shift, number) for number in range(len(self._sides))]
        told = [lit - dark for lit, dark in filter(None, means)]
        return min(told) if told else None

    def _means(self, shift: int, number: int) -> tuple[float, float] | None:
        """Return mean brightness of one side, lit and dark, None without enough of both."""
        side = self._sides[number]
        lit: list[float] = []
        dark: list[float] = []
        for picture in self._pictures:
            mask = picture.masks[shift]
            if mask is not None:
                (lit if mask & side else dark).append(picture.brightness[number])
        if len(lit) < FEWEST_OF_A_KIND or len(dark) < FEWEST_OF_A_KIND:
            return None
        return sum(lit) / len(lit), sum(dark) / len(dark)

    def _contradicts(self, mask: int, brightness: Sequence[float]) -> bool:
        for side, usual, seen in zip(self._sides, self._usual, brightness, strict=True):
            if usual is None:
                continue
            lit, dark = usual
            share = (seen - dark) / max(lit - dark, 1.0)
            if (share < DIM_FOR_LIT) if mask & side else (share > BRIGHT_FOR_DARK):
                return True
        return False

    def _note(self, contradicts: bool) -> None:
        """Seek the shift anew after too many contradictions; agreement makes up for them."""
        self._agreeing_in_a_row = 0 if contradicts else self._agreeing_in_a_row + 1
        self._contradictions = max(0, self._contradictions + (2 if contradicts else -1))
        if self._contradictions >= 2 * CONTRADICTIONS_BEFORE_ANEW:
            self._begin_anew()

    def _count(self, *, known: bool, contradicts: bool = False) -> None:
        before = self._counts
        self._counts = MatchCounts(
            before.known + known,
            before.unknown + (not known),
            before.contradicting + contradicts,
        )
