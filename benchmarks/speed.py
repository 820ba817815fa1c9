"""Microseconds from four pictures in memory to datagram bytes, by stage and in all, one thread.

    python benchmarks/speed.py [--contacts 0 1 2 5 10 20] [--seconds 10] [--check]
                               [--json FILE] [--markdown PAGE]
    python benchmarks/speed.py --recording DIR --calibration FILE

Pictures of the simulated rig (350x400 mm, four cameras, 640x64 pixels), fingers that move.  Beside
our path: the paper's edges and crossing in the same daemon, and the usual way to find shadows, with
OpenCV: subtract the background, threshold, open, label connected components.  All take turns in the
same run, and find their pictures in the processor's caches, where reading a camera leaves them.  A
cell is median / p99.  --check ends with status 1 if a goal is missed.

OpenCV is given the same four pictures as our path, all 64 rows of them: the band of the image that
holds the strip, and all that the daemon ever sees.  Our path looks at the dozen rows where the
calibration found the horizon; who knows OpenCV but not where the strip lies cannot.  It ends with
boxes in four pictures, where touches are still to be found; ours ends with datagrams.

The goal is about `connectedComponentsWithStats` as it comes.  Nine tenths of OpenCV's time go
there, most of it for the statistics of the default algorithm (OpenCV 5.0).  It can be done in a
fifth of the time: with contours, which are shown too.  The algorithm CCL_BBDT takes less than half,
and so do the 32 rows of the strip and its mirror image alone.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import doc_tables
import numpy as np

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.file import load_calibration
from cornertouchd.config import CrossingSettings, Settings, VisionSettings
from cornertouchd.devices.recording import open_recording
from cornertouchd.model import Frame, Picture
from cornertouchd.runtime.bench_show import bench_rig
from cornertouchd.runtime.benching import (
    STAGES,
    FrameSets,
    StagedPath,
    Timed,
    Times,
    WholePath,
    time_in_turns,
    to_and_fro,
)

CONTACTS = (0, 1, 2, 5, 10, 20)
SETS_IN_MEMORY = 100
TOO_SLOW_S = 1.0
"""A method that takes longer for a frame set is left out."""

# Light lost until a pixel counts as dark: a sixth of the strip's, as the least that the usual way
# can do with without taking noise for shadows.  Flat between a tenth and a third.
DARKER_BY_GREY = 30
SPECK_PX = 3
"""Opening takes away what is narrower: single noisy pixels."""

GROWTH_FROM, GROWTH_TO = 5, 20
GOALS = (
    "ours, 10 contacts: median at most 300 µs",
    "ours, 10 contacts: p99 at most 1000 µs",
    "ours, 20 contacts: median at most 1000 µs",
    "10 contacts: the OpenCV way takes at least 3 times as long",
)


class OpenCvWay:
    """Finds shadows in the pictures of all cameras as OpenCV's tutorials do."""

    def __init__(self, calibration: Calibration, count_shadows: Callable[[Picture], int]) -> None:
        self._empty = {
            camera.id: np.round(camera.empty).astype(np.uint8) for camera in calibration.cameras
        }
        self._brush = cv2.getStructuringElement(cv2.MORPH_RECT, (SPECK_PX, SPECK_PX))
        self._count_shadows = count_shadows

    def run(self, frames: Sequence[Frame]) -> tuple[int, tuple[int, ...]]:
        """Return the number of shadows in all pictures."""
        found = 0
        for frame in frames:
            darker = cv2.subtract(self._empty[frame.camera], frame.pixels)
            _, dark = cv2.threshold(darker, DARKER_BY_GREY, 255, cv2.THRESH_BINARY)
            found += self._count_shadows(cv2.morphologyEx(dark, cv2.MORPH_OPEN, self._brush))
        return found, ()


def labelled(dark: Picture) -> int:
    """Count the connected components of a picture; their boxes come with them."""
    return cv2.connectedComponentsWithStats(dark)[0] - 1


def outlined(dark: Picture) -> int:
    """Count the outlines in a picture, with their boxes."""
    outlines, _ = cv2.findContours(dark, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return len([cv2.boundingRect(outline) for outline in outlines])


@dataclass(frozen=True, slots=True)
class Result:
    """The times of all ways for one number of contacts, by way; a way too slow is not in it."""

    contacts: float
    times: Mapping[str, Times]

    def cells_of_stages(self) -> list[str]:
        """Return the row of our path, stage by stage."""
        staged = self.times["stages"]
        cells = [_cell(staged, part) for part in range(len(STAGES))]
        return [f"{self.contacts:g}", *cells, _cell(self.times["ours"])]

    def cells_of_ways(self) -> list[str]:
        """Return the row that compares our path with the others."""
        ours_us, opencv_us = self.times["ours"].median_us(), self.times["opencv"].median_us()
        paper = self.times.get("paper")
        return [
            f"{self.contacts:g}",
            _cell(self.times["ours"]),
            _cell(paper) if paper else f"over {TOO_SLOW_S:g} s",
            _cell(self.times["opencv"]),
            _cell(self.times["contours"]),
            f"{paper.median_us() / ours_us:.1f}" if paper else "-",
            f"{opencv_us / ours_us:.1f}",
            f"{opencv_us / self.times['stages'].median_us(0):.1f}",
            " / ".join(
                f"{self.times[way].found:.1f}" if way in self.times else "-"
                for way in ("ours", "paper", "opencv")
            ),
        ]

    def as_json(self) -> dict[str, object]:
        """Return what is written with --json."""
        stages = self.times["stages"]
        return {
            "contacts": self.contacts,
            "stages_us": {
                name: {"median": stages.median_us(part), "p99": stages.p99_us(part)}
                for part, name in enumerate(STAGES)
            },
            **{
                way: {
                    "median_us": times.median_us(),
                    "p99_us": times.p99_us(),
                    "frame_sets": len(times.laps_us),
                    "found": times.found,
                }
                for way, times in self.times.items()
            },
        }


STAGES_HEAD = ["contacts", *STAGES, "whole frame set"]
WAYS_HEAD = [
    "contacts",
    "ours",
    "paper",
    "OpenCV",
    "OpenCV, contours",
    "paper / ours",
    "OpenCV / ours",
    "OpenCV / our vision",
    "found (ours / paper / OpenCV's shadows)",
]


def _cell(times: Times, part: int | None = None) -> str:
    return f"{times.median_us(part):.0f} / {times.p99_us(part):.0f}"


def measure(
    calibration: Calibration,
    frame_sets: FrameSets,
    rate_hz: float,
    seconds: float,
) -> dict[str, Times]:
    """Return the times of all ways that are not too slow."""
    paper = Settings(
        vision=VisionSettings(edges="paper"), crossing=CrossingSettings(method="paper")
    )
    ways: dict[str, Timed] = {
        "ours": WholePath(calibration, Settings()),
        "stages": StagedPath(calibration, Settings()),
        "opencv": OpenCvWay(calibration, labelled),
        "contours": OpenCvWay(calibration, outlined),
    }
    by_the_paper = WholePath(calibration, paper)
    if _seconds_of(by_the_paper, frame_sets, rate_hz) < TOO_SLOW_S:
        ways["paper"] = by_the_paper
    return time_in_turns(ways, frame_sets, rate_hz, seconds)


def _seconds_of(way: Timed, frame_sets: FrameSets, rate_hz: float) -> float:
    """Return how long a way takes for its second frame set."""
    feed = to_and_fro(frame_sets, rate_hz)
    way.run(next(feed))
    frames = next(feed)
    began_s = time.perf_counter()
    way.run(frames)
    return time.perf_counter() - began_s


def growth(results: Sequence[Result], way: str) -> float:
    """Return the exponent of the median time over the number of contacts between 5 and 20."""
    within = [
        (result.contacts, result.times[way].median_us())
        for result in results
        if way in result.times and GROWTH_FROM <= result.contacts <= GROWTH_TO
    ]
    if len(within) < 2:
        return float("nan")
    contacts, medians_us = np.log(np.array(within)).T
    return float(np.polyfit(contacts, medians_us, 1)[0])


def missed_goals(results: Sequence[Result]) -> list[str]:
    """Return the goals that are missed; those for contacts that were not measured count as such."""
    by_contacts = {result.contacts: result.times for result in results}
    ten, twenty = by_contacts.get(10), by_contacts.get(20)
    met = (
        ten is not None and ten["ours"].median_us() <= 300.0,
        ten is not None and ten["ours"].p99_us() <= 1000.0,
        twenty is not None and twenty["ours"].median_us() <= 1000.0,
        ten is not None and ten["opencv"].median_us() >= 3.0 * ten["ours"].median_us(),
    )
    return [goal for goal, is_met in zip(GOALS, met, strict=True) if not is_met]


def simulated(options: argparse.Namespace) -> list[Result]:
    """Measure on the simulated rig, number of contacts after number."""
    show = bench_rig(Settings(), os.environ)
    results = []
    for contacts in options.contacts:
        frame_sets = show.frame_sets(contacts, SETS_IN_MEMORY)
        times = measure(show.calibration, frame_sets, show.rate_hz, options.seconds)
        results.append(Result(contacts, times))
        print(f"{contacts:2d} contacts: ours {_cell(times['ours'])} µs", file=sys.stderr)
    return results


def recorded(options: argparse.Namespace) -> list[Result]:
    """Measure on a recording; the number of contacts is what is found, on average."""
    recording = open_recording(options.recording)
    frame_sets = list(recording)
    calibration = load_calibration(options.calibration)
    times = measure(calibration, frame_sets, recording.rate_hz, options.seconds)
    return [Result(round(times["ours"].found, 1), times)]


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--contacts", type=int, nargs="+", default=list(CONTACTS))
    parser.add_argument("--seconds", type=float, default=10.0, help="for each number of contacts")
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--calibration", type=Path)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args(arguments)
    if (options.recording is None) != (options.calibration is None):
        parser.error("--recording and --calibration belong together: give both or none")
    if options.check and options.recording:
        parser.error("--check is about the simulated rig: leave --recording out")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    options = parsed(arguments)
    cv2.setNumThreads(1)
    results = recorded(options) if options.recording else simulated(options)
    lines = [
        *doc_tables.table(STAGES_HEAD, [result.cells_of_stages() for result in results]),
        "",
        *doc_tables.table(WAYS_HEAD, [result.cells_of_ways() for result in results]),
    ]
    if len(results) > 1:
        exponents = ", ".join(
            f"{way} {growth(results, way):.2f}" for way in ("ours", "paper", "opencv")
        )
        lines += ["", f"Growth between {GROWTH_FROM} and {GROWTH_TO} contacts, n to: {exponents}."]
    print("\n".join(lines))
    if options.json:
        options.json.write_text(json.dumps([result.as_json() for result in results], indent=1))
    if options.markdown:
        doc_tables.put_into(options.markdown, "speed", lines)
    missed = missed_goals(results) if options.check else []
    for goal in missed:
        print(f"missed: {goal}", file=sys.stderr)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
