"""Whatever cameras report, the default crossing answers with sound contacts."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossing import Crossing, make_crossing
from cornertouchd.model import DirectingLines

SURFACE_MM = (350.0, 400.0)
PLACES_MM = {
    "C1": (-10.0, -10.0),
    "C2": (360.0, -10.0),
    "C3": (360.0, 410.0),
    "C4": (-10.0, 410.0),
    "C5": (175.0, -10.0),
    "C6": (175.0, 200.0),
}


def crossing() -> Crossing:
    return make_crossing(CrossingSettings(), SURFACE_MM)


def assert_sound(directing_lines: list[DirectingLines]) -> None:
    for contact in crossing().cross(directing_lines).contacts:
        assert 0.0 <= contact.x_mm <= SURFACE_MM[0]
        assert 0.0 <= contact.y_mm <= SURFACE_MM[1]
        assert 0.0 <= contact.confidence <= 1.0
        assert 0.0 < contact.diameter_mm < 200.0
        assert 0.0 < contact.sigma_mm < 100.0
        assert set(contact.cameras) <= {camera.camera for camera in directing_lines}


@st.composite
def any_bearings(draw: st.DrawFn) -> list[DirectingLines]:
    """Shadows that no discs cast, some of them no intervals at all."""
    angle = st.one_of(st.floats(-4.0, 8.0), st.sampled_from([np.nan, np.inf, 0.0, 1e300]))
    result = []
    for camera in draw(st.lists(st.sampled_from([*PLACES_MM]), max_size=5, unique=True)):
        x_mm, y_mm = PLACES_MM[camera]
        count = draw(st.integers(0, 6))
        edges = np.array([[draw(angle), draw(angle)] for _ in range(count)]).reshape(-1, 2)
        flags = st.lists(st.booleans(), min_size=count, max_size=count).map(
            lambda drawn: np.array(drawn, dtype=np.bool_)
        )
        result.append(
            DirectingLines(
                camera=camera,
                x_mm=x_mm,
                y_mm=y_mm,
                first_rad=edges[:, 0],
                centre_rad=edges[:, 0],
                last_rad=edges[:, 1],
                first_valid=draw(flags),
                last_valid=draw(flags),
                sigma_rad=np.full(count, draw(st.sampled_from([1e-6, 3e-4, 0.1, 0.0, np.nan]))),
            )
        )
    return result


@given(any_bearings())
def test_whatever_the_cameras_report_gives_sound_contacts(
    directing_lines: list[DirectingLines],
) -> None:
    assert_sound(directing_lines)


def test_broken_strips_with_a_hundred_shadows_each_are_survived() -> None:
    rng = np.random.default_rng(1)
    directing_lines = []
    for number, camera in enumerate(["C1", "C2", "C3", "C4"]):
        forward_rad = np.pi / 4.0 + number * np.pi / 2.0
        edges = forward_rad + np.sort(rng.uniform(-0.8, 0.8, 200)).reshape(-1, 2)
        directing_lines.append(
            DirectingLines(
                camera=camera,
                x_mm=PLACES_MM[camera][0],
                y_mm=PLACES_MM[camera][1],
                first_rad=edges[:, 0],
                centre_rad=edges.mean(axis=1),
                last_rad=edges[:, 1],
                first_valid=np.full(100, True),
                last_valid=np.full(100, True),
                sigma_rad=np.full(100, 3e-4),
            )
        )
    assert_sound(directing_lines)
