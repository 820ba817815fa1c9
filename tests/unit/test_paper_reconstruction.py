"""The paper's crossing for its 3D reconstruction: pairs of cameras that must agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle.nearest_point import nearest_point_to_lines

from cornertouchd.config import CrossingSettings, PaperCrossingSettings
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.edge_crossing import EdgeCrossing
from cornertouchd.fusion.paper_crossing import PaperCrossing
from cornertouchd.model import Contact, DirectingLines

SURFACE_MM = (350.0, 400.0)
CORNERS_MM = {
    "C1": (-10.0, -10.0),
    "C2": (360.0, -10.0),
    "C3": (360.0, 410.0),
    "C4": (-10.0, 410.0),
}
Point = tuple[float, float]


def lines_to(
    points_mm: list[Point], cameras: str = "C1 C2 C3 C4", off_rad: dict[str, float] | None = None
) -> list[DirectingLines]:
    result = []
    for camera in cameras.split():
        x_mm, y_mm = CORNERS_MM[camera]
        centre = np.sort([np.arctan2(y - y_mm, x - x_mm) for x, y in points_mm])
        centre = centre + (off_rad or {}).get(camera, 0.0)
        whole = np.full(len(centre), True)
        sigma = np.full(len(centre), 3e-4)
        result.append(
            DirectingLines(
                camera, x_mm, y_mm, centre - 0.01, centre, centre + 0.01, whole, whole, sigma
            )
        )
    return result


def cross(lines: list[DirectingLines], th1_mm: float = 12.0) -> tuple[Contact, ...]:
    paper = PaperCrossingSettings(th1_mm=th1_mm)
    settings = CrossingSettings(method="paper", paper=paper)
    return make_crossing(settings, SURFACE_MM, reconstructed=True).cross(lines).contacts


def pairwise(lines: list[DirectingLines], a: str, b: str) -> np.ndarray:
    two = [one for one in lines if one.camera in (a, b)]
    origins = np.array([(one.x_mm, one.y_mm) for one in two])
    return nearest_point_to_lines(origins, np.array([one.centre_rad[0] for one in two]))


@given(st.floats(5.0, 345.0), st.floats(5.0, 395.0))
def test_four_shadows_of_a_finger_give_the_finger(x_mm: float, y_mm: float) -> None:
    (contact,) = cross(lines_to([(x_mm, y_mm)]))
    assert (contact.x_mm, contact.y_mm) == pytest.approx((x_mm, y_mm), abs=1e-6)
    assert contact.cameras == ("C1", "C2", "C3", "C4")
    assert contact.confidence == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("point", "last_pair"), [((290.0, 200.0), ("C4", "C3")), ((175.0, 330.0), ("C2", "C3"))]
)
def test_the_contact_is_the_mean_of_three_pairs(point: Point, last_pair: tuple[str, str]) -> None:
    """C3 is linked by C2 or C4, whichever line it crosses at the larger angle."""
    lines = lines_to([point], off_rad={"C1": 0.004, "C2": -0.003, "C3": 0.005})
    three = [pairwise(lines, *pair) for pair in (("C1", "C2"), ("C1", "C4"), last_pair)]
    (contact,) = cross(lines)
    assert (contact.x_mm, contact.y_mm) == pytest.approx(tuple(np.mean(three, axis=0)))


def test_pairs_that_do_not_converge_within_th1_are_refused() -> None:
    lines = lines_to([(290.0, 200.0)], off_rad={"C1": 0.02})
    three = [pairwise(lines, *pair) for pair in (("C1", "C2"), ("C1", "C4"), ("C4", "C3"))]
    apart = max(float(np.linalg.norm(a - b)) for a in three for b in three)
    assert cross(lines, th1_mm=0.99 * apart) == ()
    (contact,) = cross(lines, th1_mm=1.01 * apart)
    assert 0.0 < contact.confidence < 0.05


def test_three_cameras_are_paired_with_the_first() -> None:
    lines = lines_to([(120.0, 150.0)], "C1 C2 C4", {"C2": 0.01})
    two = [pairwise(lines, *pair) for pair in (("C1", "C2"), ("C1", "C4"))]
    (contact,) = cross(lines)
    assert (contact.x_mm, contact.y_mm) == pytest.approx(tuple(np.mean(two, axis=0)))


def test_two_cameras_give_a_doubtful_contact() -> None:
    (contact,) = cross(lines_to([(120.0, 150.0)], "C2 C3"))
    assert (contact.x_mm, contact.y_mm) == pytest.approx((120.0, 150.0))
    assert contact.confidence < 0.5


def test_a_pair_that_looks_along_one_line_locates_nothing() -> None:
    assert cross(lines_to([(175.0, 200.0)], "C1 C3")) == ()
    assert cross(lines_to([(100.0, -10.0 + 1e-9)], "C1 C2")) == ()


def test_a_contact_is_found_once() -> None:
    points = [(100.0, 120.0), (250.0, 180.0)]
    found = {(round(c.x_mm, 3), round(c.y_mm, 3)) for c in cross(lines_to(points), th1_mm=5.0)}
    assert found == set(points)


@given(st.lists(st.tuples(st.floats(0, 350), st.floats(0, 400)), min_size=1, max_size=4))
def test_contacts_are_always_numbers_on_the_surface(points: list[Point]) -> None:
    for contact in cross(lines_to(points), th1_mm=100.0):
        values = (contact.diameter_mm, contact.sigma_mm, contact.confidence)
        assert np.isfinite(values).all()
        assert 0.0 <= contact.x_mm <= 350.0
        assert 0.0 <= contact.y_mm <= 400.0


def test_only_the_papers_crossing_asks_how_the_cameras_were_calibrated() -> None:
    default = make_crossing(CrossingSettings(), SURFACE_MM, reconstructed=True)
    assert isinstance(default, EdgeCrossing)
    paper = make_crossing(CrossingSettings(method="paper"), SURFACE_MM, reconstructed=True)
    assert isinstance(paper, PaperCrossing)
