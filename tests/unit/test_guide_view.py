"""What a guided calibration shows: lines in a log, a picture that stands still in a terminal."""

from io import StringIO

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

from cornertouchd.cli.guide_view import GuideView
from cornertouchd.guiding.checking import CameraCheck, Finding
from cornertouchd.guiding.status import Status, StepName
from cornertouchd.ports import CameraError

SURFACE_MM = (350.0, 400.0)
STEPS: tuple[StepName, ...] = ("cameras", "empty", "taps", "scribble", "check")
MISSING = (CameraError("C2", "/dev/video1 is not there"), CameraError("C4", "[/dev/v4l] is busy"))


def tap_status(**changes: object) -> Status:
    values: dict[str, object] = {
        "step": "taps",
        "hint": "tap the marked place, and hold still",
        "progress": 0.25,
        "target_mm": (225.0, 142.0),
        "number": 5,
        "of": 16,
    }
    return Status(**{**values, **changes})  # type: ignore[arg-type]


def plain(*shown: Status | tuple[CameraError, ...]) -> list[str]:
    """Return the lines that a log gets."""
    console = Console(file=StringIO(), width=80, record=True)
    with GuideView(console, SURFACE_MM, STEPS) as view:
        for each in shown:
            if isinstance(each, Status):
                view.show(each)
            else:
                view.missing(each)
    return console.export_text().splitlines()


def terminal(
    shown: Status | tuple[CameraError, ...],
    size: tuple[int, int] = (80, 24),
    surface_mm: tuple[float, float] = SURFACE_MM,
) -> list[str]:
    """Return what stands in a terminal."""
    console = Console(
        file=StringIO(), force_terminal=True, width=size[0], height=size[1], record=True
    )
    with GuideView(console, surface_mm, STEPS) as view:
        console.export_text(clear=True)
        if isinstance(shown, Status):
            view.show(shown)
        else:
            view.missing(shown)
        return console.export_text().splitlines()


def plan_in(lines: list[str]) -> list[str]:
    """Return the characters within the border of the plan."""
    top = next(number for number, line in enumerate(lines) if "C1" in line and "C2" in line)
    bottom = next(number for number, line in enumerate(lines) if "C4" in line and "C3" in line)
    return [line.strip()[2:-2] for line in lines[top + 1 : bottom]]


def where(plan: list[str], character: str) -> list[tuple[float, float]]:
    """Return the places of a character in millimetres, of its middle."""
    return [
        (
            (column + 0.5) / len(line) * SURFACE_MM[0],
            (row + 0.5) / len(plan) * SURFACE_MM[1],
        )
        for row, line in enumerate(plan)
        for column, found in enumerate(line)
        if found == character
    ]


def test_a_log_gets_a_line_for_every_change_and_none_twice() -> None:
    lines = plain(
        tap_status(),
        tap_status(),
        tap_status(held=0.5),
        tap_status(hint="hold still", held=0.1),
        tap_status(hint="hold still", held=0.9),
        tap_status(number=6, target_mm=(325.0, 142.0)),
    )
    place = "Taps - 5 of 16 - 225 mm from the left, 142 mm from the top"
    assert lines == [
        f"{place} - tap the marked place, and hold still",
        f"{place} - hold still",
        (
            "Taps - 6 of 16 - 325 mm from the left, 142 mm from the top - "
            "tap the marked place, and hold still"
        ),
    ]


def test_a_log_tells_missing_cameras_once_and_then_what_goes_on() -> None:
    lines = plain(tap_status(), MISSING, MISSING, MISSING[:1], tap_status())
    assert lines[1:-1] == [
        "camera C2: /dev/video1 is not there",
        "camera C4: [/dev/v4l] is busy",
        "see to it: this goes on as soon as all are there",
        "camera C2: /dev/video1 is not there",
        "see to it: this goes on as soon as all are there",
    ]
    assert lines[0] == lines[-1]


def test_the_share_of_a_scribble_and_the_name_of_a_place_are_told() -> None:
    (scribbled,) = plain(
        Status("scribble", "move one finger", 0.5, visited=np.zeros((7, 6), np.bool_))
    )
    assert scribbled == "Scribble - 50% - move one finger"
    (checked,) = plain(tap_status(step="check", name="upper left", number=2, of=5))
    assert checked.startswith("Check - 2 of 5, upper left - 225 mm")


@pytest.mark.parametrize(
    "target_mm", [(0.0, 0.0), (350.0, 400.0), (225.0, 142.0), (25.0, 375.0), (325.0, 25.0)]
)
def test_the_cross_stands_where_to_tap(target_mm: tuple[float, float]) -> None:
    plan = plan_in(terminal(tap_status(target_mm=target_mm)))
    ((x_mm, y_mm),) = where(plan, "✕")
    assert abs(x_mm - target_mm[0]) <= SURFACE_MM[0] / len(plan[0]) / 2 + 1e-9
    assert abs(y_mm - target_mm[1]) <= SURFACE_MM[1] / len(plan) / 2 + 1e-9


def test_the_plan_is_to_scale_and_whole() -> None:
    lines = terminal(tap_status())
    plan = plan_in(lines)
    assert len(plan[0]) / (2.0 * len(plan)) == pytest.approx(350.0 / 400.0, rel=0.1)
    assert len(plan) >= 14
    assert {len(line) for line in plan} == {len(plan[0])}


def test_places_tapped_before_stay_in_sight_also_beside_the_cross() -> None:
    tapped_mm = ((25.0, 142.0), (125.0, 142.0), (225.0, 25.0), (300.0, 300.0))
    dots = where(plan_in(terminal(tap_status(tapped_mm=tapped_mm))), "●")
    assert len(dots) == 4
    for place in tapped_mm:
        assert min(np.hypot(*np.subtract(dot, place)) for dot in dots) < 20.0


def test_cells_that_a_scribble_covered_are_filled_and_the_finger_is_shown() -> None:
    visited = np.zeros((2, 2), np.bool_)
    visited[0, 1] = True
    status = Status("scribble", "go on", 0.25, visited=visited, finger_mm=(80.0, 300.0))
    plan = plan_in(terminal(status))
    filled = where(plan, "░")
    assert len(filled) == pytest.approx(len(plan) * len(plan[0]) / 4, rel=0.2)
    assert all(x_mm > 160.0 and y_mm < 215.0 for x_mm, y_mm in filled)
    ((x_mm, y_mm),) = where(plan, "●")
    assert (x_mm, y_mm) == pytest.approx((80.0, 300.0), abs=20.0)


def test_what_is_wrong_with_cameras_is_told() -> None:
    dark = Finding("level", "bad", "the strip is at [12%] of full scale: raise the exposure")
    stray = Finding("ambient", "doubtful", "stray light")
    checks = (
        CameraCheck("C1", None, ()),
        CameraCheck("C2", None, (dark, stray)),
    )
    rows = [
        " ".join(line.split())
        for line in terminal(Status("cameras", "see to C2", 0.5, checks=checks))
    ]
    assert "C1 good" in rows
    assert "C2 bad the strip is at [12%] of full scale: raise the exposure" in rows
    assert "C2 doubtful stray light" in rows
    assert "Cameras - see to C2" in rows


def test_missing_cameras_are_all_told_in_the_terminal() -> None:
    text = "\n".join(terminal(MISSING))
    assert "camera C2: /dev/video1 is not there" in text
    assert "camera C4: [/dev/v4l] is busy" in text


def test_the_step_at_work_is_one_of_all() -> None:
    assert terminal(tap_status())[0].split("  ") == [
        "1 Cameras",
        "2 Empty strip",
        "3 Taps",
        "4 Scribble",
        "5 Check",
    ]


@pytest.mark.parametrize("size", [(80, 24), (132, 43), (60, 20), (40, 15)])
@pytest.mark.parametrize("surface_mm", [SURFACE_MM, (2400.0, 1350.0), (1350.0, 2400.0)])
@pytest.mark.parametrize(
    "shown",
    [
        tap_status(hint="too few cameras see the finger: hold it upright, away from others"),
        Status("scribble", "go on", 0.25, visited=np.ones((7, 6), np.bool_)),
        MISSING,
    ],
    ids=["taps", "scribble", "missing"],
)
def test_nothing_is_larger_than_the_terminal(
    shown: Status | tuple[CameraError, ...],
    surface_mm: tuple[float, float],
    size: tuple[int, int],
) -> None:
    lines = terminal(shown, size, surface_mm)
    assert max(cell_len(line) for line in lines) <= size[0]
    assert len(lines) <= size[1]
    if isinstance(shown, Status):
        assert plan_in(lines)
