"""What tracking reports of one finger: lag, jitter at rest, steps of a slow drag, overshoot.

    python benchmarks/smoothing.py [--noise 0.03] [--beta 4] [--derivative-cutoff 2] ...

Contacts come 100 times a second with `--noise` mm of noise in each direction.  Every setting of
[tracking] that begins with one of the names above can be given, as in the file.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import Contact, FloatArray

PERIOD_S = 0.01
SURFACE_MM = (2400.0, 1350.0)
START_MM = (300.0, 300.0)
# Quick fingers speed up so: 1.5 m/s after 75 ms.
ACCELERATION_MM_S2 = 20_000.0
SETTINGS = ("min_cutoff_hz", "beta", "derivative_cutoff_hz", "dead_band_mm", "acceleration_mm_s2")


def reports(
    path_mm: FloatArray, noise_mm: float, settings: TrackingSettings, seed: int = 1
) -> FloatArray:
    """Return what is reported (N, 4), x, y and velocity, of a finger on a path (N, 2)."""
    rng = np.random.default_rng(seed)
    tracker = Tracker(settings, SURFACE_MM)
    told = []
    for number, (x, y) in enumerate((path_mm + rng.normal(0.0, noise_mm, path_mm.shape)).tolist()):
        contact = Contact(x, y, 12.0, ("C1", "C2", "C3", "C4"), 1.0, 0.08)
        (touch,) = tracker.update(
            100.0 + number * PERIOD_S, Crossed.unsupported((contact,), np.array([12.0]))
        )
        told.append((touch.x_mm, touch.y_mm, touch.vx_mm_s, touch.vy_mm_s))
    return np.array(told)


def stroke(speeds_mm_s: FloatArray, direction_deg: float = 30.0) -> FloatArray:
    """Return the path (N + 1, 2) of a finger with these speeds (N,)."""
    way = np.concatenate([[0.0], np.cumsum(speeds_mm_s * PERIOD_S)])
    direction = np.deg2rad(direction_deg)
    return START_MM + way[:, None] * (np.cos(direction), np.sin(direction))


def moving(speed_mm_s: float, seconds: float) -> FloatArray:
    """Return speeds of a steady move."""
    return np.full(round(seconds / PERIOD_S), speed_mm_s)


def started(speed_mm_s: float, seconds: float) -> FloatArray:
    """Return speeds of a finger that rests for half a second and then starts to move."""
    faster = ACCELERATION_MM_S2 * PERIOD_S * np.arange(1, round(seconds / PERIOD_S) + 1)
    return np.concatenate([moving(0.0, 0.5), np.minimum(faster, speed_mm_s)])


def stopped(speed_mm_s: float) -> FloatArray:
    """Return speeds of a finger that moves for half a second, stops and rests as long."""
    return started(speed_mm_s, 0.5)[::-1]


def _lag_ms(speed_mm_s: float, noise_mm: float, settings: TrackingSettings) -> tuple[float, float]:
    """Return how much later than the finger the report is, and its noise across, in mm RMS."""
    path = stroke(moving(speed_mm_s, 1.0))
    off = (reports(path, noise_mm, settings)[:, :2] - path)[20:]
    along = (path[-1] - path[0]) / np.hypot(*(path[-1] - path[0]))
    across = off @ np.array([-along[1], along[0]])
    return float(-1000.0 * np.mean(off @ along) / speed_mm_s), float(np.std(across))


def _strokes(noise_mm: float, settings: TrackingSettings) -> None:
    print("| mm/s | lag ms | lag mm | noise across mm | starting: largest lag mm |")
    print("|---|---|---|---|---|")
    for speed in (2.0, 10.0, 50.0, 150.0, 500.0, 1500.0):
        lag_ms, noise = _lag_ms(speed, noise_mm, settings)
        path = stroke(started(speed, 0.1))
        behind = np.hypot(*(reports(path, noise_mm, settings)[:, :2] - path)[51:].T).max()
        print(
            f"| {speed:g} | {lag_ms:.2f} | {lag_ms * speed / 1000.0:.3f} | {noise:.3f}"
            f" | {behind:.2f} |"
        )


def _rest(settings: TrackingSettings) -> None:
    print("\n| noise mm | jitter at rest mm RMS | largest move mm | reports that move |")
    print("|---|---|---|---|")
    for noise in (0.01, 0.03, 0.06, 0.1):
        told = reports(stroke(moving(0.0, 60.0)), noise, settings)[100:, :2]
        jitter = np.sqrt(np.mean(np.sum((told - told.mean(axis=0)) ** 2, axis=1)))
        steps = np.hypot(*np.diff(told, axis=0).T)
        print(f"| {noise:g} | {jitter:.4f} | {steps.max():.3f} | {np.mean(steps > 0):.3f} |")


def _slow(noise_mm: float, settings: TrackingSettings) -> None:
    print("\n| slow drag mm/s | largest step mm | reports at rest |\n|---|---|---|")
    for speed in (0.5, 1.0, 2.0, 5.0):
        told = reports(stroke(moving(speed, 10.0)), noise_mm, settings)[:, :2]
        steps = np.hypot(*np.diff(told, axis=0).T)
        print(f"| {speed:g} | {steps.max():.3f} | {np.mean(steps == 0.0):.3f} |")


def _turns(noise_mm: float, settings: TrackingSettings) -> None:
    print("\n| predict_ms | stop at 500 mm/s: over mm | after 50 ms | corner mm | rest mm RMS |")
    print("|---|---|---|---|---|")
    for ahead_ms in (0.0, 20.0, 50.0, 100.0):
        ours = settings.model_copy(update={"predict_ms": ahead_ms})
        path = stroke(stopped(500.0), 0.0)
        over = (reports(path, noise_mm, ours)[:, 0] - path[-1, 0])[50:]
        down = stroke(started(500.0, 0.5)[50:], 90.0) - START_MM
        corner = np.vstack([path[:51], path[50] + down])
        past = np.max((reports(corner, noise_mm, ours)[:, 0] - corner[-1, 0])[50:])
        rest = reports(stroke(moving(0.0, 10.0)), noise_mm, ours)[100:, :2]
        jitter = np.sqrt(np.mean(np.sum((rest - rest.mean(axis=0)) ** 2, axis=1)))
        print(
            f"| {ahead_ms:g} | {over.max():.2f} | {over[6:].max():.2f} | {past:.2f}"
            f" | {jitter:.4f} |"
        )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--noise", type=float, default=0.03)
    for name in SETTINGS:
        parser.add_argument(f"--{name.replace('_', '-')}", type=float)
    options = parser.parse_args(arguments)
    given = {name: getattr(options, name) for name in SETTINGS}
    settings = TrackingSettings(**{name: value for name, value in given.items() if value})
    _strokes(options.noise, settings)
    _rest(settings)
    _slow(options.noise, settings)
    _turns(options.noise, settings)


if __name__ == "__main__":
    main()
