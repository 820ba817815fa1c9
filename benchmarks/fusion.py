"""Accuracy of crossing: scenes whose truth is known, the paper's method and ours side by side.

    python benchmarks/fusion.py [--scenes 200] [--seed 1] [--contacts 1 2 5 10] [--scene random]
                                [--methods written tuned ours] [--json FILE] [--markdown PAGE]

random: discs of radius 4..8 mm, at least 20 mm apart; hands: five fingers each, 16 mm apart and
more; close: two discs that (nearly) touch, others anywhere; rectangle: four discs whose diagonals
run through the cameras; lines: Fig. 2 of the paper, two lines of one camera crossed by two of the
next one, discs at two, three or four of the crossings.  A contact counts as found within 6 mm
(350x400) or 10 mm (2400x1350).

A cell is precision/recall/frames exactly right/RMSE in mm.  "as written" is the paper's method with
Th1 12 mm and Th2 0.1 mm, "tuned" the same with the thresholds that do best on other scenes of the
same kind.  Where there are figures to meet, the last column says whether ours does: "nearly" if
chance may be to blame (two standard errors).
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from pathlib import Path

import doc_tables
import numpy as np
from scenes import (
    LARGE,
    LARGE_1280,
    SCENES,
    SMALL,
    Rig,
    Scene,
    long_rig,
    matched,
    observed_in_view,
    random_discs,
)

from cornertouchd.config import CrossingSettings, PaperCrossingSettings
from cornertouchd.fusion.crossing import Crossing, make_crossing
from cornertouchd.model import FloatArray

COUNTS = (1, 2, 5, 10, 15, 20)

# The thresholds of the paper that are tried, in millimetres, on scenes that are not measured.
TRIED_TH1_MM = (1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
TRIED_TH2_MM = (8.0, 12.0)
TUNING_SCENES, TUNING_SEED = 15, 77
# As written, twenty contacts give thousands of points: nothing to learn from, and slow.
MOST_AS_WRITTEN = 10


@dataclass(frozen=True, slots=True)
class Score:
    """How well contacts were found over many scenes; distances of the found ones in millimetres."""

    precision: float
    recall: float
    exact: float
    rmse_mm: float
    p95_mm: float
    median_ms: float

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        return 2.0 * self.precision * self.recall / max(self.precision + self.recall, 1e-9)

    def __str__(self) -> str:
        shares = "/".join(map(_share, (self.precision, self.recall, self.exact)))
        return f"{shares}/{_plain(f'{self.rmse_mm:.2f}')}"


@dataclass(frozen=True, slots=True)
class Goal:
    """The figures to meet."""

    precision: float
    recall: float
    exact: float
    rmse_mm: float

    def __str__(self) -> str:
        figures = (self.precision, self.recall, self.exact, self.rmse_mm)
        return "/".join(_plain(f"{figure:g}") for figure in figures)

    def judge(self, score: Score, contacts: int, scenes: int) -> str:
        """Tell whether a score over so many scenes of so many contacts meets the figures."""
        total = contacts * scenes
        lacks = [
            (self.precision - score.precision, 0.0005, _error(self.precision, total)),
            (self.recall - score.recall, 0.0005, _error(self.recall, total)),
            (self.exact - score.exact, 0.005, _error(self.exact, scenes)),
            (score.rmse_mm - self.rmse_mm, 0.005, self.rmse_mm / np.sqrt(2.0 * total)),
        ]
        if all(lack <= rounding for lack, rounding, _ in lacks):
            return "yes"
        near = all(lack <= rounding + 2.0 * error for lack, rounding, error in lacks)
        return "nearly" if near else "no"


# By scene, frame and number of contacts: what the method reached on scenes like these when it was
# chosen.
GOALS: dict[tuple[str, str, int], Goal] = {
    ("random", "350x400", 1): Goal(1.0, 1.0, 1.0, 0.06),
    ("random", "350x400", 2): Goal(1.0, 1.0, 1.0, 0.07),
    ("random", "350x400", 5): Goal(1.0, 1.0, 1.0, 0.20),
    ("random", "350x400", 10): Goal(0.993, 0.993, 0.93, 0.57),
    ("random", "350x400", 15): Goal(0.951, 0.946, 0.50, 1.0),
    ("random", "350x400", 20): Goal(0.853, 0.831, 0.08, 1.2),
    ("random", "2400x1350", 1): Goal(1.0, 1.0, 1.0, 0.31),
    ("random", "2400x1350", 5): Goal(1.0, 1.0, 1.0, 0.35),
    ("random", "2400x1350", 10): Goal(1.0, 1.0, 0.995, 0.46),
    ("random", "2400x1350", 20): Goal(0.999, 0.998, 0.96, 0.64),
    ("random", "2400x1350 at 1280 px", 5): Goal(1.0, 1.0, 1.0, 0.21),
    ("random", "2400x1350 at 1280 px", 10): Goal(1.0, 1.0, 1.0, 0.22),
    ("random", "2400x1350 at 1280 px", 20): Goal(1.0, 1.0, 0.99, 0.40),
    ("hands", "350x400", 5): Goal(0.985, 0.983, 0.94, 0.65),
    ("hands", "350x400", 10): Goal(0.949, 0.935, 0.60, 1.2),
    ("hands", "350x400", 20): Goal(0.73, 0.65, 0.01, 1.8),
    ("random", "350x400, three cameras", 5): Goal(0.99, 0.99, 0.96, 0.49),
    ("random", "350x400, three cameras", 10): Goal(0.92, 0.91, 0.48, 0.94),
    ("random", "350x400, three cameras", 20): Goal(0.53, 0.48, 0.0, 1.7),
}


@dataclass(frozen=True, slots=True)
class Case:
    """A kind of scene on a rig; `counts` are those for which it makes sense."""

    scene: str
    frame: str
    rig: Rig
    counts: tuple[int, ...]


THREE, TWO = ", three cameras", ", two cameras"
SIX, EIGHT = ", six cameras", ", eight cameras"
CASES = (
    *(Case("random", rig.name, rig, tuple(range(1, 21))) for rig in (SMALL, LARGE, LARGE_1280)),
    *(Case("hands", rig.name, rig, (5, 10, 15, 20)) for rig in (SMALL, LARGE)),
    *(Case("close", rig.name, rig, tuple(range(2, 21))) for rig in (SMALL, LARGE)),
    *(Case("rectangle", rig.name, rig, (4,)) for rig in (SMALL, LARGE)),
    *(Case("lines", rig.name, rig, (2, 3, 4)) for rig in (SMALL, LARGE)),
    *(
        Case("random", rig.name + THREE, rig.with_cameras(3), tuple(range(1, 21)))
        for rig in (SMALL, LARGE)
    ),
    # two cameras see four crossings where two fingers are; with more there is nothing to hold on to
    *(Case("random", rig.name + TWO, rig.with_cameras(2), (1, 2, 5)) for rig in (SMALL, LARGE)),
    # cameras amid the sides do not see what lies beside them
    Case("random", LARGE.name + SIX, long_rig(LARGE, 2), (1, 3, 5, 10)),
    Case("random", LARGE.name + EIGHT, long_rig(LARGE, 4), (1, 3, 5, 10)),
)


def measure(
    rig: Rig,
    crossing: Crossing,
    count: int,
    scenes: int,
    seed: int,
    scene: Scene = random_discs,
) -> Score:
    """Cross so many scenes of so many contacts and compare with the truth."""
    rng = np.random.default_rng(seed)
    errors_mm: list[FloatArray] = []
    seconds: list[float] = []
    reported = exact = 0
    for _ in range(scenes):
        discs = scene(rig, count, rng)
        directing_lines = observed_in_view(rig, discs, rng)
        started = time.perf_counter()
        contacts = crossing.cross(directing_lines).contacts
        seconds.append(time.perf_counter() - started)
        points = np.array([(contact.x_mm, contact.y_mm) for contact in contacts]).reshape(-1, 2)
        found, truly = matched(points, discs[:, :2], rig.found_within_mm)
        errors_mm.append(np.hypot(*(points[found] - discs[truly, :2]).T))
        reported += len(contacts)
        exact += len(found) == len(contacts) == count
    errors = np.concatenate(errors_mm)
    return Score(
        precision=len(errors) / max(reported, 1),
        recall=len(errors) / (count * scenes),
        exact=exact / scenes,
        rmse_mm=float(np.sqrt(np.mean(errors**2))) if len(errors) else float("nan"),
        p95_mm=float(np.percentile(errors, 95.0)) if len(errors) else float("nan"),
        median_ms=1000.0 * float(np.median(seconds)),
    )


def paper_crossing(rig: Rig, th1_mm: float, th2_mm: float) -> Crossing:
    """Return the paper's method with these thresholds."""
    paper = PaperCrossingSettings(th1_mm=th1_mm, th2_mm=th2_mm)
    return make_crossing(CrossingSettings(method="paper", paper=paper), rig.surface_mm)


@cache
def tuned_thresholds(rig: Rig, scene: str, count: int) -> tuple[float, float]:
    """Return the Th1 and Th2 with which the paper's method does best on such scenes."""

    def f1(thresholds_mm: tuple[float, float]) -> float:
        crossing = paper_crossing(rig, *thresholds_mm)
        return measure(rig, crossing, count, TUNING_SCENES, TUNING_SEED, SCENES[scene]).f1

    return max(product(TRIED_TH1_MM, TRIED_TH2_MM), key=f1)


def crossing_of(method: str, case: Case, count: int) -> Crossing | None:
    """Return what crosses by a method, None where the method is not worth trying."""
    if method == "ours":
        return make_crossing(CrossingSettings(), case.rig.surface_mm)
    if method == "tuned":
        return paper_crossing(case.rig, *tuned_thresholds(case.rig, case.scene, count))
    settings = CrossingSettings(method="paper")
    return make_crossing(settings, case.rig.surface_mm) if count <= MOST_AS_WRITTEN else None


@dataclass(frozen=True, slots=True)
class Result:
    """The scores of all methods on one kind of scene, by method; None where it was not tried."""

    case: Case
    contacts: int
    scenes: int
    scores: dict[str, Score | None]

    @property
    def goal(self) -> Goal | None:
        """What our method has to meet."""
        return GOALS.get((self.case.scene, self.case.frame, self.contacts))

    def row(self) -> list[str]:
        """Return the cells of its row."""
        ours, goal = self.scores.get("ours"), self.goal
        met = goal.judge(ours, self.contacts, self.scenes) if goal and ours else ""
        return [
            self.case.scene,
            self.case.frame,
            str(self.contacts),
            *(str(score) if score else "-" for score in self.scores.values()),
            f"{ours.p95_mm:.2f}" if ours else "-",
            f"{1000.0 * ours.median_ms:.0f}" if ours else "-",
            str(goal) if goal else "",
            met,
        ]

    def as_json(self) -> dict[str, object]:
        """Return what is written with --json."""
        return {
            "scene": self.case.scene,
            "frame": self.case.frame,
            "contacts": self.contacts,
            "scenes": self.scenes,
            "scores": {name: asdict(score) for name, score in self.scores.items() if score},
            "goal": asdict(self.goal) if self.goal else None,
        }


NAMES = {"written": "paper, as written", "tuned": "paper, tuned", "ours": "ours"}


def titles(methods: Sequence[str]) -> list[str]:
    methods_titles = [NAMES[method] for method in methods]
    return ["scene", "frame", "n", *methods_titles, "p95 mm", "µs", "to meet", "met"]


def run(case: Case, count: int, options: argparse.Namespace) -> Result:
    """Measure all methods on the same scenes."""
    crossings = {method: crossing_of(method, case, count) for method in options.methods}
    scene = SCENES[case.scene]
    scores = {
        method: measure(case.rig, crossing, count, options.scenes, options.seed, scene)
        if crossing
        else None
        for method, crossing in crossings.items()
    }
    return Result(case, count, options.scenes, scores)


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--contacts", type=int, nargs="+")
    parser.add_argument("--scene", choices=list(SCENES), nargs="+", default=list(SCENES))
    parser.add_argument("--methods", choices=list(NAMES), nargs="+", default=list(NAMES))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    options = parsed(arguments)
    head = titles(options.methods)
    print("\n".join(doc_tables.table(head, [])))
    results = []
    for case in CASES:
        if case.scene not in options.scene:
            continue
        # scenes that know but a few counts are measured with all of them
        usual = case.counts if len(case.counts) <= 4 else COUNTS
        for count in [n for n in case.counts if n in (options.contacts or usual)]:
            results.append(run(case, count, options))
            print(doc_tables.table(head, [results[-1].row()])[-1], flush=True)
    if options.json:
        options.json.write_text(json.dumps([result.as_json() for result in results], indent=1))
    if options.markdown:
        rows = [result.row() for result in results]
        doc_tables.put_into(options.markdown, "fusion", doc_tables.table(head, rows))


def _share(value: float) -> str:
    return _plain(f"{value:.3f}".rstrip("0").rstrip("."))


def _plain(number: str) -> str:
    """Return a number without its zero before the point."""
    return number.removeprefix("0") or "0"


def _error(share: float, count: int) -> float:
    """Return the standard error of a share of so many; of a share of 1, of one miss."""
    return max(float(np.sqrt(share * (1.0 - share) / count)), 0.5 / count)


if __name__ == "__main__":
    sys.exit(main())
