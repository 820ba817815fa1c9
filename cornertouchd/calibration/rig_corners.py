"""Which camera belongs into which corner of the surface."""

from cornertouchd.calibration.calibration import CalibrationError

CORNERS = ("C1", "C2", "C3", "C4")
"""Clockwise from the top-left; the sides top, right, bottom and left begin there, in this order."""


def corner_mm(camera: str, surface_mm: tuple[float, float]) -> tuple[float, float]:
    """Return the corner of a camera.  Raises `CalibrationError` if it has none."""
    width, height = surface_mm
    places = ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height))
    return places[corner_number(camera)]


def corner_number(camera: str) -> int:
    """Return the place in `CORNERS` of a camera.  Raises `CalibrationError` if it has none."""
    if camera not in CORNERS:
        raise CalibrationError(
            f"camera {camera}: no corner belongs to it; the cameras of a frame are C1 to C4"
        )
    return CORNERS.index(camera)
