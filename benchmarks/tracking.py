"""Tracking of moving fingers: how many frame sets are right, and do fingers keep their ids.

    python benchmarks/tracking.py [--sequences 5] [--seconds 2.5] [--seed 100] [--speed 150]
                                  [--contacts 5 10 15 20] [--frame 350x400]
                                  [--moves wander]

Fingers wander smoothly with 150 mm/s (350x400) or 500 mm/s (2400x1350) in each direction, seen 100
times a second; they avoid each other, lift after some seconds and land elsewhere.  What cameras
measure of them is that of the other benchmarks (scenes.py).  The first 50 ms do not count.  An id
switch is a finger that goes on under another id than when it was matched last; latency is from
landing to the first report.  A touch that is not seen rests for two more frame sets, which count as
ghosts when the finger has lifted; "tracked, no coasting" is without that.

With `--moves row` three fingers move as one, in a row at 1.03 to 1.2 diameters; with `--moves
pinch` two come to touch each other and part, again and again.  The others rest.
"""

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scenes import LARGE, MARGIN_MM, RADII_MM, SMALL, Rig, matched, observed, random_discs, row

from cornertouchd.config import CrossingSettings, TrackingSettings
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.denial import Darkness
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import BoolArray, DirectingLines, FloatArray

PERIOD_S = 0.01
FRAMES_LEFT_OUT = 5
# A finger changes its velocity within this time, and its acceleration within the other.
VELOCITY_MEMORY_S = 0.4
ACCELERATION_MEMORY_S = 0.05
RESTLESSNESS = 0.35
BRAKES_MM_S2 = 20_000.0
# Fingers nearer than this push each other away, and none lands so near to another.
PERSONAL_SPACE_MM = 30.0
PUSH_PER_S2 = 800.0
LANDING_SPACE_MM = 24.0
LIVES_S = 3.0
SHORTEST_LIFE_S = 0.3
LIFTED_S = (0.05, 0.4)
NEAREST_NEIGHBOUR_MM = 25.0
# A pinch opens so far; its fingers are drawn as far inside.
PINCHED_FROM_MM = 60.0
SPEEDS_MM_S = {SMALL.name: 150.0, LARGE.name: 500.0}

Report = tuple[int, float, float]
"""The id of a touch, its x and its y."""


class Fingers:
    """Fingers that wander, lift and land again; a finger that lands is another one."""

    def __init__(self, rig: Rig, count: int, speed_mm_s: float, rng: np.random.Generator) -> None:
        discs = random_discs(rig, count, rng)
        self._far = np.asarray(rig.surface_mm) - MARGIN_MM
        self._speed_mm_s, self._rng = speed_mm_s, rng
        self._places, self._radii = discs[:, :2], discs[:, 2]
        self._velocities = rng.normal(0.0, speed_mm_s, (count, 2))
        self._accelerations = np.zeros((count, 2))
        self._names = np.arange(count)
        self._lives_s = SHORTEST_LIFE_S + rng.exponential(LIVES_S, count)
        self._lifted_s = np.zeros(count)

    def move(self) -> tuple[list[int], FloatArray]:
        """Go on by a period; return the names and discs (x, y, r) of the fingers that touch."""
        self._wander()
        self._lift_and_land()
        down = self._down()
        return self._names[down].tolist(), np.column_stack([self._places, self._radii])[down]

    def _down(self) -> BoolArray:
        down: BoolArray = self._lifted_s <= 0.0
        return down

    def _wander(self) -> None:
        kicks = self._rng.normal(0.0, 1.0, self._places.shape) * np.sqrt(2.0 / VELOCITY_MEMORY_S)
        kicks *= RESTLESSNESS * self._speed_mm_s / ACCELERATION_MEMORY_S
        self._accelerations *= 1.0 - PERIOD_S / ACCELERATION_MEMORY_S
        self._accelerations += kicks * np.sqrt(PERIOD_S)
        self._velocities *= 1.0 - PERIOD_S / VELOCITY_MEMORY_S
        self._velocities += (self._accelerations + self._pushes()) * PERIOD_S
        # fast towards an edge only as far as a finger can still brake
        to_near, to_far = self._places - MARGIN_MM, self._far - self._places
        self._velocities = np.clip(
            self._velocities,
            -np.sqrt(2.0 * BRAKES_MM_S2 * to_near),
            np.sqrt(2.0 * BRAKES_MM_S2 * to_far),
        )
        self._places = self._places + self._velocities * PERIOD_S
        self._places = np.clip(self._places, MARGIN_MM, self._far)

    def _pushes(self) -> FloatArray:
        apart = self._places[:, None] - self._places[None]
        distances = np.hypot(apart[..., 0], apart[..., 1]) + 1e3 * np.eye(len(apart))
        both_down = self._down()[:, None] & self._down()[None]
        pushes = PUSH_PER_S2 * np.clip(PERSONAL_SPACE_MM - distances, 0.0, 12.0) * both_down
        summed: FloatArray = np.sum((pushes / distances)[..., None] * apart, axis=1)
        return summed

    def _lift_and_land(self) -> None:
        self._lives_s -= PERIOD_S
        for finger in range(len(self._names)):
            if self._lifted_s[finger] > 0.0:
                self._lifted_s[finger] -= PERIOD_S
                if self._lifted_s[finger] <= 0.0:
                    self._land(finger)
            elif self._lives_s[finger] < 0.0:
                self._lifted_s[finger] = self._rng.uniform(*LIFTED_S)

    def _land(self, finger: int) -> None:
        others = np.delete(self._places, finger, axis=0)
        while True:
            place = self._rng.uniform(MARGIN_MM, self._far)
            if np.all(np.hypot(*(others - place).T) > LANDING_SPACE_MM):
                break
        self._places[finger] = place
        self._velocities[finger] = self._rng.normal(0.0, 0.5 * self._speed_mm_s, 2)
        self._accelerations[finger] = 0.0
        self._radii[finger] = self._rng.uniform(*RADII_MM)
        self._lives_s[finger] = SHORTEST_LIFE_S + self._rng.exponential(LIVES_S)
        self._names[finger] = self._names.max() + 1


class Row:
    """Three fingers in a row that touch each other nearly, and move as one hand does."""

    def __init__(self, rig: Rig, count: int, speed_mm_s: float, rng: np.random.Generator) -> None:
        self._discs = row(rig, count, rng)
        self._far = np.asarray(rig.surface_mm) - MARGIN_MM
        self._velocity = rng.normal(0.0, speed_mm_s, 2)

    def move(self) -> tuple[list[int], FloatArray]:
        """Go on by a period; return the names and discs (x, y, r) of the fingers."""
        hand = self._discs[:3, :2] + PERIOD_S * self._velocity
        outside = np.any((hand < MARGIN_MM) | (hand > self._far), axis=0)
        self._velocity = np.where(outside, -self._velocity, self._velocity)
        self._discs[:3, :2] += PERIOD_S * self._velocity
        return list(range(len(self._discs))), self._discs.copy()


class Pinch:
    """Two fingers that come to touch each other and part again, amid others that rest."""

    def __init__(self, rig: Rig, count: int, speed_mm_s: float, rng: np.random.Generator) -> None:
        self._discs = random_discs(rig, count, rng)
        middle = rng.uniform(PINCHED_FROM_MM, np.asarray(rig.surface_mm) - PINCHED_FROM_MM)
        angle_rad = rng.uniform(0.0, np.pi)
        self._along = np.array([np.cos(angle_rad), np.sin(angle_rad)])
        self._middle = middle
        self._discs[:2, 2] = rng.uniform(*RADII_MM)
        self._touching_mm = float(self._discs[:2, 2].sum())
        self._period_s = np.pi * PINCHED_FROM_MM / speed_mm_s
        self._now_s = 0.0

    def move(self) -> tuple[list[int], FloatArray]:
        """Go on by a period; return the names and discs (x, y, r) of the fingers."""
        self._now_s += PERIOD_S
        open_share = 0.5 + 0.5 * np.cos(2.0 * np.pi * self._now_s / self._period_s)
        apart_mm = self._touching_mm + open_share * PINCHED_FROM_MM
        self._discs[0, :2] = self._middle - 0.5 * apart_mm * self._along
        self._discs[1, :2] = self._middle + 0.5 * apart_mm * self._along
        return list(range(len(self._discs))), self._discs.copy()


Moving = Fingers | Row | Pinch
MOVES: dict[str, Callable[[Rig, int, float, np.random.Generator], Moving]] = {
    "wander": Fingers,
    "row": Row,
    "pinch": Pinch,
}


class SingleFrames:
    """Every frame set for itself; ids go to the nearest contact of the next one."""

    def __init__(self, rig: Rig) -> None:
        self._crossing = make_crossing(CrossingSettings(), rig.surface_mm)
        self._places = np.empty((0, 2))
        self._ids = np.empty(0, np.intp)
        self._last_id = 0
        self.tracking_us = 0.0

    def follow(self, lines: Sequence[DirectingLines], _now_s: float) -> list[Report]:
        """Return what touches now."""
        contacts = self._crossing.cross(lines).contacts
        places = np.array([(contact.x_mm, contact.y_mm) for contact in contacts]).reshape(-1, 2)
        ids = np.zeros(len(places), np.intp)
        here, before = matched(places, self._places, NEAREST_NEIGHBOUR_MM)
        ids[here] = self._ids[before]
        new = np.flatnonzero(ids == 0)
        ids[new] = self._last_id + 1 + np.arange(len(new))
        self._last_id += len(new)
        self._places, self._ids = places, ids
        return [(int(one), x, y) for one, (x, y) in zip(ids, places.tolist(), strict=True)]


class Tracked:
    """The product's way: what was there before helps to explain what is there now."""

    def __init__(self, rig: Rig, coast_frames: int = 2) -> None:
        self._crossing = make_crossing(CrossingSettings(), rig.surface_mm)
        self._tracker = Tracker(TrackingSettings(coast_frames=coast_frames), rig.surface_mm)
        self.tracking_us = 0.0

    def follow(self, lines: Sequence[DirectingLines], now_s: float) -> list[Report]:
        """Return what touches now."""
        started = time.perf_counter()
        predictions = self._tracker.predict(now_s)
        predicted = time.perf_counter()
        crossed = self._crossing.cross(lines, predictions)
        found = time.perf_counter()
        hides = Darkness(lines, ()).hides
        touches = self._tracker.update(now_s, crossed, hides=hides)
        self.tracking_us = 1e6 * (time.perf_counter() - found + predicted - started)
        return [(touch.id, touch.x_mm, touch.y_mm) for touch in touches]


METHODS: dict[str, Callable[[Rig], SingleFrames | Tracked]] = {
    "single frames": SingleFrames,
    "tracked": Tracked,
    "tracked, no coasting": partial(Tracked, coast_frames=0),
}


@dataclass(slots=True)
class Score:
    """What counted over all frame sets of all sequences."""

    frames: int = 0
    exact: int = 0
    reported: int = 0
    true: int = 0
    switches: int = 0
    errors_mm: list[FloatArray] = field(default_factory=list)
    latencies: list[int] = field(default_factory=list)
    tracking_us: list[float] = field(default_factory=list)
    whole_us: list[float] = field(default_factory=list)

    def row(self) -> str:
        """Return the columns of the table."""
        errors = np.concatenate(self.errors_mm)
        contact_seconds = self.true * PERIOD_S
        return " | ".join(
            [
                f"{len(errors) / max(self.reported, 1):.4f}",
                f"{len(errors) / self.true:.4f}",
                f"{self.exact / self.frames:.3f}",
                f"{np.sqrt(np.mean(errors**2)):.3f}",
                f"{(self.reported - len(errors)) / self.frames:.4f}",
                f"{self.switches / contact_seconds:.3f}",
                f"{1000.0 * PERIOD_S * np.mean(self.latencies or [0]):.1f}",
                f"{np.median(self.tracking_us):.0f}",
                f"{np.median(self.whole_us):.0f}",
            ]
        )


COLUMNS = [
    "frame",
    "contacts",
    "method",
    "precision",
    "recall",
    "exact",
    "RMSE mm",
    "ghosts a frame set",
    "id switches a contact and second",
    "latency ms",
    "tracking us",
    "crossing and tracking us",
]


def measure(
    rig: Rig,
    moves: str,
    method: str,
    count: int,
    sequences: int,
    frames: int,
    speed_mm_s: float,
    seed: int,
) -> Score:
    """Follow fingers through so many sequences, the same ones for each method."""
    score = Score()
    for number in range(sequences):
        rng = np.random.default_rng(seed + number)
        _follow(
            rig, MOVES[moves](rig, count, speed_mm_s, rng), METHODS[method](rig), frames, rng, score
        )
    return score


def _follow(
    rig: Rig,
    fingers: Moving,
    follower: SingleFrames | Tracked,
    frames: int,
    rng: np.random.Generator,
    score: Score,
) -> None:
    landed: dict[int, int] = {}
    ids: dict[int, int] = {}
    for frame in range(frames):
        names, discs = fingers.move()
        lines = observed(rig, discs, rng)
        started = time.perf_counter()
        touches = follower.follow(lines, frame * PERIOD_S)
        score.whole_us.append(1e6 * (time.perf_counter() - started))
        score.tracking_us.append(follower.tracking_us)
        for name in names:
            landed.setdefault(name, frame)
        if frame < FRAMES_LEFT_OUT:
            continue
        places = np.array([(x, y) for _, x, y in touches]).reshape(-1, 2)
        found, true = matched(places, discs[:, :2], rig.found_within_mm)
        score.frames += 1
        score.reported += len(touches)
        score.true += len(names)
        score.exact += len(found) == len(touches) == len(names)
        score.errors_mm.append(np.hypot(*(places[found] - discs[true, :2]).T))
        for touch, finger in zip(found.tolist(), true.tolist(), strict=True):
            name, identity = names[finger], touches[touch][0]
            if name not in ids and landed[name] > FRAMES_LEFT_OUT:
                score.latencies.append(frame - landed[name])
            score.switches += ids.get(name, identity) != identity
            ids[name] = identity


def _cases(contacts: Sequence[int], frame: str | None) -> Iterator[tuple[Rig, int, str]]:
    for rig in (SMALL, LARGE):
        for count in contacts:
            for method in METHODS:
                if frame in {None, rig.name}:
                    yield rig, count, method


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--sequences", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=2.5)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--contacts", type=int, nargs="+", default=[5, 10, 15, 20])
    parser.add_argument("--moves", choices=list(MOVES), default="wander")
    parser.add_argument("--frame", choices=[SMALL.name, LARGE.name])
    parser.add_argument("--speed", type=float, help="mm/s, instead of those above")
    options = parser.parse_args(arguments)
    frames = round(options.seconds / PERIOD_S)
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for rig, count, method in _cases(options.contacts, options.frame):
        speed = options.speed or SPEEDS_MM_S[rig.name]
        score = measure(
            rig, options.moves, method, count, options.sequences, frames, speed, options.seed
        )
        print(f"| {rig.name} | {count} | {method} | {score.row()} |", flush=True)


if __name__ == "__main__":
    main()
