from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle.nearest_point import nearest_point_to_lines

from cornertouchd.config import CrossingSettings, PaperCrossingSettings
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.paper_crossing import MOST_GROUPS, PaperCrossing
from cornertouchd.geometry import distances_to_lines
from cornertouchd.model import Contact, DirectingLines

SURFACE_MM = (350.0, 400.0)
CORNERS_MM = {
    "C1": (-10.0, -10.0),
    "C2": (360.0, -10.0),
    "C3": (360.0, 410.0),
    "C4": (-10.0, 410.0),
}


def lines(
    camera: str, angles_rad: list[float], width_rad: float = 0.02, *, whole: bool = True
) -> DirectingLines:
    x_mm, y_mm = CORNERS_MM[camera]
    centre = np.array(sorted(angles_rad))
    return DirectingLines(
        camera=camera,
        x_mm=x_mm,
        y_mm=y_mm,
        first_rad=centre - width_rad / 2.0,
        centre_rad=centre,
        last_rad=centre + width_rad / 2.0,
        first_valid=np.full(len(centre), whole),
        last_valid=np.full(len(centre), True),
        sigma_rad=np.full(len(centre), 3e-4),
    )


def towards(points_mm: list[tuple[float, float]], camera: str) -> list[float]:
    x_mm, y_mm = CORNERS_MM[camera]
    return [float(np.arctan2(y - y_mm, x - x_mm)) for x, y in points_mm]


def lines_to(
    points_mm: list[tuple[float, float]], cameras: str = "C1 C2 C3 C4"
) -> list[DirectingLines]:
    return [lines(camera, towards(points_mm, camera)) for camera in cameras.split()]


def paper(th1_mm: float = 12.0, th2_mm: float = 0.1) -> PaperCrossing:
    settings = PaperCrossingSettings(th1_mm=th1_mm, th2_mm=th2_mm)
    crossing = make_crossing(CrossingSettings(method="paper", paper=settings), SURFACE_MM)
    assert isinstance(crossing, PaperCrossing)
    return crossing


def places(contacts: tuple[Contact, ...]) -> list[tuple[float, float]]:
    return [(contact.x_mm, contact.y_mm) for contact in contacts]


@given(st.floats(0.0, 350.0), st.floats(0.0, 400.0))
def test_four_lines_through_a_point_give_that_point(x_mm: float, y_mm: float) -> None:
    (contact,) = paper().cross(lines_to([(x_mm, y_mm)])).contacts
    assert places((contact,))[0] == pytest.approx((x_mm, y_mm), abs=1e-6)
    assert contact.cameras == ("C1", "C2", "C3", "C4")
    assert contact.confidence == pytest.approx(1.0)


def test_the_diameter_is_what_the_shadows_span_at_the_distance_of_the_contact() -> None:
    centre = (175.0, 200.0)
    (contact,) = paper().cross(lines_to([centre])).contacts
    distance_mm = np.hypot(centre[0] + 10.0, centre[1] + 10.0)
    assert contact.diameter_mm == pytest.approx(0.02 * distance_mm)


@given(st.integers(0, 10_000), st.sampled_from([2.0, 12.0, 40.0]), st.sampled_from([0.1, 5.0]))
def test_it_accepts_what_the_paper_accepts_group_by_group(
    seed: int, th1_mm: float, th2_mm: float
) -> None:
    rng = np.random.default_rng(seed)
    points = [(float(x), float(y)) for x, y in rng.uniform((20, 20), (330, 380), (3, 2))]
    directing_lines = [
        lines(camera, [angle + rng.normal(0.0, 0.01) for angle in towards(points, camera)])
        for camera in CORNERS_MM
    ]
    accepted: list[np.ndarray] = []
    for group in product(range(3), repeat=4):
        angles = np.array([b.centre_rad[n] for b, n in zip(directing_lines, group, strict=True)])
        origins = np.array([(b.x_mm, b.y_mm) for b in directing_lines])
        point = nearest_point_to_lines(origins, angles)
        if np.any(point < -2.0) or np.any(point > np.array(SURFACE_MM) + 2.0):
            continue
        near = np.max(np.abs(distances_to_lines(point[None], origins, angles))) <= th1_mm
        if near and all(np.hypot(*(point - other)) > th2_mm for other in accepted):
            accepted.append(point)
    on_surface = np.clip(np.array(accepted).reshape(-1, 2), 0.0, SURFACE_MM)
    found = np.array(places(paper(th1_mm, th2_mm).cross(directing_lines).contacts)).reshape(-1, 2)
    np.testing.assert_allclose(found, on_surface, atol=1e-6)


def test_it_accepts_ghosts() -> None:
    rectangle = [(100.0, 100.0), (250.0, 300.0)]
    assert len(paper(th1_mm=40.0).cross(lines_to(rectangle)).contacts) > len(rectangle)


def test_a_line_that_passes_farther_than_th1_refuses_the_group() -> None:
    directing_lines = lines_to([(175.0, 200.0)])
    directing_lines[2] = lines("C3", [directing_lines[2].centre_rad[0] + 0.1])
    assert paper(th1_mm=5.0).cross(directing_lines).contacts == ()
    (contact,) = paper(th1_mm=30.0).cross(directing_lines).contacts
    assert 0.0 < contact.confidence < 1.0


def test_a_camera_without_a_shadow_is_left_out() -> None:
    directing_lines = [*lines_to([(120.0, 90.0)], "C1 C2 C4"), lines("C3", [])]
    (contact,) = paper().cross(directing_lines).contacts
    assert contact.cameras == ("C1", "C2", "C4")
    assert places((contact,))[0] == pytest.approx((120.0, 90.0))


def test_a_shadow_with_only_one_edge_has_no_centre() -> None:
    directing_lines = lines_to([(120.0, 90.0)], "C1 C2 C4")
    directing_lines.append(lines("C3", towards([(300.0, 40.0)], "C3"), whole=False))
    (contact,) = paper().cross(directing_lines).contacts
    assert contact.cameras == ("C1", "C2", "C4")


def test_two_cameras_cross_on_the_surface_only() -> None:
    (contact,) = paper().cross(lines_to([(120.0, 90.0)], "C1 C2")).contacts
    assert places((contact,))[0] == pytest.approx((120.0, 90.0))
    assert contact.confidence < 0.5  # not sure enough to begin a touch at once
    assert paper().cross(lines_to([(120.0, 600.0)], "C1 C2")).contacts == ()


def test_two_cameras_that_look_along_one_line_locate_nothing() -> None:
    assert paper().cross(lines_to([(175.0, 200.0)], "C1 C3")).contacts == ()


def test_one_camera_locates_nothing() -> None:
    assert paper().cross(lines_to([(120.0, 90.0)], "C2")).contacts == ()
    assert paper().cross([]).contacts == ()


def test_too_many_groups_are_refused_and_counted() -> None:
    crossing = paper()
    count = int(MOST_GROUPS ** (1 / 4)) + 1
    directing_lines = [
        lines(camera, list(np.linspace(a, a + 1.4, count)), width_rad=0.001)
        for camera, a in zip(CORNERS_MM, (0.1, 1.7, 3.2, -1.5), strict=True)
    ]
    assert crossing.cross(directing_lines).contacts == ()
    assert crossing.refused_sets == 1
    assert len(crossing.cross(lines_to([(120.0, 90.0)])).contacts) == 1
    assert crossing.refused_sets == 1
