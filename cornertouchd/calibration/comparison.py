"""A new calibration against the one in force: whether cameras moved, what the change is worth."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import Calibration, CameraCalibration, Method, Model
from cornertouchd.calibration.error_map import places_mm
from cornertouchd.calibration.fitted import rms
from cornertouchd.calibration.same_camera import same_camera
from cornertouchd.geometry import nearest_points_to_lines, normals, wrap_angle
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.columns import columns_of_places
from cornertouchd.model import FloatArray

SAME_MM = 0.3
EXPECTED_TIMES, RESIDUAL_TIMES = 1.5, 3.0
"""Lines of a camera that stands still are apart by up to .9 of what both calibrations are expected
to be off (path-traced rig: taps, scribble and perimeter against each other), and by more where a
method does not fit its lens, which its residuals tell."""

ANOTHER_RIG = 0.04
"""Share of the diagonal.  A knocked camera moves by millimetres and still sees its strip; lines
that are this far off belong to another camera or corner."""

SURFACE_MM = 2.0
"""Surfaces measured twice with a ruler differ by less."""


@dataclass(frozen=True, slots=True)
class CameraShift:
    """What has changed about one camera.

    `moved_mm` is the change of the fitted position, `turned_deg` of the directing lines (median
    over the columns, from +x towards +y); place and turn make up for each other in part.
    `lines_mm` is what counts for touches: RMS distance of the new lines from places on the old;
    up to `allowed_mm` the camera may well stand still.
    """

    camera: str
    moved_mm: tuple[float, float]
    turned_deg: float
    lines_mm: float
    allowed_mm: float
    exchanged: bool

    @property
    def moved(self) -> bool:
        """Whether the camera stands elsewhere, or looks elsewhere, than before."""
        return self.lines_mm > self.allowed_mm


@dataclass(frozen=True, slots=True)
class Comparison:
    """How two calibrations locate the same columns; NaN where nothing can be compared.

    `apart_rms_mm` and `apart_worst_mm` (at `worst_at_mm`) are between the two places of a touch,
    over the surface.  `expected_mm` are the expected errors (RMS) of the former and of the new
    calibration, `methods` theirs.  `another_rig` says why they are not of one rig, empty if they
    may be.
    """

    cameras: tuple[CameraShift, ...]
    apart_rms_mm: float
    apart_worst_mm: float
    worst_at_mm: tuple[float, float]
    expected_mm: tuple[float, float]
    methods: tuple[Method, Method]
    another_rig: str

    @property
    def verdict(self) -> str:
        """One sentence for people."""
        if self.another_rig:
            return f"another rig: {self.another_rig}"
        exchanged = [shift.camera for shift in self.cameras if shift.exchanged]
        if exchanged:
            return f"other cameras than before: {', '.join(exchanged)}"
        moved = [
            f"{shift.camera} has moved by about {shift.lines_mm:.1f} mm"
            for shift in self.cameras
            if shift.moved
        ]
        if not moved:
            return (
                "the cameras stand where they stood "
                f"(touches are located {self.apart_rms_mm:.2f} mm apart)"
            )
        if self.methods[0] != self.methods[1]:
            moved.append(f"or the methods disagree ({self.methods[0]}, {self.methods[1]})")
        return ", ".join(moved)


def compare(former: Calibration, new: Calibration) -> Comparison:
    """Compare two calibrations, of whatever methods."""
    _, _, places = places_mm(new.surface_mm)
    ids = {camera.id for camera in former.cameras}
    pairs = [(former.camera(camera.id), camera) for camera in new.cameras if camera.id in ids]
    columns = [
        columns_of_places(before.model, before.format.width_px, places) for before, _ in pairs
    ]
    expected = former.expected.rms_mm, new.expected.rms_mm
    expected_mm = float(np.nan_to_num(np.hypot(*expected)))
    shifts = tuple(
        _shift(before, after, places, seen, expected_mm)
        for (before, after), seen in zip(pairs, columns, strict=True)
    )
    located = _locate([after.model for _, after in pairs], columns, len(places))
    apart = np.linalg.norm(located - places, axis=1)
    worst = int(np.nanargmax(apart)) if np.isfinite(apart).any() else None
    return Comparison(
        shifts,
        rms(apart),
        float("nan") if worst is None else float(apart[worst]),
        (float("nan"),) * 2
        if worst is None
        else (float(places[worst, 0]), float(places[worst, 1])),
        expected,
        (former.method, new.method),
        _another_rig(former, new, shifts),
    )


def _shift(
    before: CameraCalibration,
    after: CameraCalibration,
    places: FloatArray,
    columns: FloatArray,
    expected_mm: float,
) -> CameraShift:
    seen = np.isfinite(columns)
    angles = after.model.angles_rad(columns[seen])
    turned = wrap_angle(angles - before.model.angles_rad(columns[seen]))
    away = places[seen] - after.model.position_mm
    off = np.sum(normals(angles) * away, axis=1)
    (x, y), (x_before, y_before) = after.model.position_mm, before.model.position_mm
    residual_mm = float(np.hypot(_misfit_mm(before), _misfit_mm(after)))
    return CameraShift(
        after.id,
        (x - x_before, y - y_before),
        float(np.degrees(np.nanmedian(turned))) if np.isfinite(turned).any() else float("nan"),
        rms(off),
        max(SAME_MM, EXPECTED_TIMES * expected_mm, RESIDUAL_TIMES * residual_mm),
        exchanged=not same_camera(before.identity, after.identity),
    )


def _misfit_mm(camera: CameraCalibration) -> float:
    """Return how badly the method fits the lens; a polynomial leaves nothing but errors of taps."""
    polynomial = isinstance(camera.model, AnglePolynomial)
    return 0.0 if polynomial else float(np.nan_to_num(camera.residual_mm))


def _locate(models: list[Model], columns: list[FloatArray], touches: int) -> FloatArray:
    """Return where the models locate touches seen in columns, (touches, 2), NaN if nowhere."""
    if not models:
        return np.full((touches, 2), np.nan)
    origins = np.array([model.position_mm for model in models])
    pairs = zip(models, columns, strict=True)
    angles = np.array([model.angles_rad(seen) for model, seen in pairs])
    return nearest_points_to_lines(origins, angles)


def _another_rig(former: Calibration, new: Calibration, shifts: tuple[CameraShift, ...]) -> str:
    """Return why the two cannot be of one rig, empty if they can."""
    if np.abs(np.subtract(former.surface_mm, new.surface_mm)).max() > SURFACE_MM:
        sizes = [
            f"{width:g} x {height:g} mm" for width, height in (former.surface_mm, new.surface_mm)
        ]
        return f"the surface was {sizes[0]}, now it is {sizes[1]}"
    names = [", ".join(camera.id for camera in each.cameras) for each in (former, new)]
    if names[0] != names[1]:
        return f"the cameras were {names[0]}, now they are {names[1]}"
    for camera in new.cameras:
        size = former.camera(camera.id).format
        if size != camera.format:
            return f"{camera.id} gave pictures of {size}, now of {camera.format}"
    limit_mm = ANOTHER_RIG * float(np.hypot(*new.surface_mm))
    far = [shift for shift in shifts if not shift.lines_mm < limit_mm]
    if 2 * len(far) > len(shifts):
        return f"the lines of {', '.join(shift.camera for shift in far)} run elsewhere"
    return ""
