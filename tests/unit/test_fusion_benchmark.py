"""The scenes of the benchmarks are what they claim to be."""

import importlib
import itertools
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
SEEDS = st.integers(0, 2**32 - 1)


def benchmark(name: str) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        return importlib.import_module(name)


scenes = benchmark("scenes")
RIGS = st.sampled_from([scenes.SMALL, scenes.LARGE, scenes.LARGE_1280])


def distances(places: np.ndarray) -> np.ndarray:
    return np.array(
        [np.hypot(*(one - other)) for one, other in itertools.combinations(places[:, :2], 2)]
    )


def hidden_from(rig: object, discs: np.ndarray, place: np.ndarray) -> Iterator[bool]:
    """Tell of each camera whether a small disc at this place is wholly inside a shadow."""
    for _, *camera in rig.cameras():
        shadows = scenes.shadows_px(rig, discs, tuple(camera))
        ((first, last),) = scenes.shadows_px(rig, np.array([[*place, 3.0]]), tuple(camera))
        yield bool(np.any((shadows[:, 0] <= first) & (last <= shadows[:, 1])))


@given(SEEDS, RIGS, st.sampled_from(["random", "hands", "close"]), st.integers(2, 20))
def test_discs_lie_on_the_surface_and_are_as_many_as_asked_for(
    seed: int, rig: object, name: str, count: int
) -> None:
    discs = scenes.SCENES[name](rig, count, np.random.default_rng(seed))
    assert discs.shape == (count, 3)
    assert np.all((discs[:, :2] >= 6.0) & (discs[:, :2] <= np.array(rig.surface_mm) - 6.0))
    assert np.all((discs[:, 2] >= 4.0) & (discs[:, 2] <= 8.0))


@given(SEEDS, RIGS, st.integers(2, 15))
def test_random_discs_keep_apart(seed: int, rig: object, count: int) -> None:
    discs = scenes.random_discs(rig, count, np.random.default_rng(seed))
    assert distances(discs).min() > 20.0


@given(SEEDS, RIGS)
def test_a_hand_has_five_fingers_within_its_span(seed: int, rig: object) -> None:
    discs = scenes.hands(rig, 10, np.random.default_rng(seed))
    for hand in (discs[:5], discs[5:]):
        assert distances(hand).min() >= 16.0
        assert distances(hand).max() < 180.0
    between = np.hypot(*(discs[:5, None, :2] - discs[None, 5:, :2]).transpose(2, 0, 1))
    assert between.min() >= 25.0


@given(SEEDS, RIGS, st.integers(2, 10))
def test_the_first_two_of_close_pairs_nearly_touch(seed: int, rig: object, count: int) -> None:
    discs = scenes.close_pairs(rig, count, np.random.default_rng(seed))
    (apart,) = distances(discs[:2])
    assert 1.05 <= apart / discs[:2, 2].sum() <= 2.0
    assert distances(discs)[1:].min(initial=np.inf) > 20.0


@given(SEEDS, RIGS)
def test_a_ghost_fits_in_the_middle_of_the_rectangle(seed: int, rig: object) -> None:
    discs = scenes.rectangle(rig, 4, np.random.default_rng(seed))
    middle = discs[:, :2].mean(axis=0)
    assert all(hidden_from(rig, discs, middle))


@given(SEEDS, RIGS)
def test_two_crossed_lines_look_like_four_to_two_cameras(seed: int, rig: object) -> None:
    rng = np.random.default_rng(seed)
    places = scenes.fig_2_places(rig, rng)
    discs = np.column_stack([places[[0, 2]], [5.0, 5.0]])

    def is_on_a_line(camera: tuple[float, float, float], place: np.ndarray) -> bool:
        x_mm, y_mm, _ = camera
        away, fingers = place - (x_mm, y_mm), discs[:, :2] - (x_mm, y_mm)
        across = fingers[:, 0] * away[1] - fingers[:, 1] * away[0]
        return bool(np.min(np.abs(across) / np.hypot(*fingers.T)) < 1e-6)

    fooled = [
        number
        for number, (_, *camera) in enumerate(rig.cameras())
        if all(is_on_a_line(camera, place) for place in places[[1, 3]])
    ]
    assert any({number, (number + 1) % 4} <= set(fooled) for number in range(4))


@given(SEEDS, st.integers(2, 4))
def test_crossed_lines_leave_out_ghosts_last(seed: int, count: int) -> None:
    discs = scenes.crossed_lines(scenes.SMALL, count, np.random.default_rng(seed))
    assert len(discs) == count
    assert distances(discs).min() > 20.0


def test_shadows_merge_where_one_disc_hides_the_other() -> None:
    rig = scenes.SMALL
    camera = next(rig.cameras())[1:]
    behind = np.array([[90.0, 90.0, 5.0], [190.0, 190.0, 5.0]])
    beside = np.array([[90.0, 150.0, 5.0], [150.0, 90.0, 5.0]])
    assert len(scenes.shadows_px(rig, behind, camera)) == 1
    assert len(scenes.shadows_px(rig, beside, camera)) == 2


def test_too_little_light_between_two_shadows_is_lost() -> None:
    rig = scenes.SMALL
    camera = next(rig.cameras())[1:]
    apart = [
        len(scenes.shadows_px(rig, np.array([[200.0, y, 5.0], [200.0, 200.0, 5.0]]), camera))
        for y in (184.0, 188.0)
    ]
    assert apart == [2, 1]


def test_cameras_measure_shadows_with_noise_and_do_not_see_beyond_their_view() -> None:
    rig = scenes.SMALL.with_cameras(3)
    rng = np.random.default_rng(1)
    lines = scenes.observed(rig, np.array([[175.0, 200.0, 6.0]]), rng)
    assert [one.camera for one in lines] == ["C1", "C2", "C3"]
    for one in lines:
        distance = np.hypot(one.x_mm - 175.0, one.y_mm - 200.0)
        width = one.last_rad - one.first_rad
        assert width == pytest.approx(2.0 * np.arcsin(6.0 / distance), abs=5 * 0.1 / rig.focal_px)
        assert one.first_valid.all()
        assert one.last_valid.all()


def test_each_true_place_is_found_once() -> None:
    points = np.array([[10.0, 10.0], [11.0, 10.0], [100.0, 100.0]])
    truth = np.array([[10.4, 10.0], [50.0, 50.0]])
    found, truly = scenes.matched(points, truth, 6.0)
    assert (found.tolist(), truly.tolist()) == ([0], [0])


def test_our_crossing_finds_a_single_disc_in_the_benchmark() -> None:
    fusion = benchmark("fusion")
    crossing = fusion.make_crossing(fusion.CrossingSettings(), scenes.SMALL.surface_mm)
    score = fusion.measure(scenes.SMALL, crossing, 1, 5, 1)
    assert (score.precision, score.recall, score.exact) == (1.0, 1.0, 1.0)
    assert score.rmse_mm < 0.3


@pytest.mark.parametrize(
    ("recall", "judged"), [(0.99, "yes"), (0.985, "nearly"), (0.95, "no"), (1.0, "yes")]
)
def test_a_figure_is_met_nearly_met_or_not(recall: float, judged: str) -> None:
    fusion = benchmark("fusion")
    goal = fusion.Goal(0.99, 0.99, 0.9, 0.5)
    score = fusion.Score(0.99, recall, 0.9, 0.5, 1.0, 0.1)
    assert goal.judge(score, 10, 100) == judged


def test_a_table_is_put_into_its_place_in_a_page(tmp_path: Path) -> None:
    tables = benchmark("doc_tables")
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- fusion -->\nold\n<!-- end of fusion -->\nafter\n")
    for _ in range(2):
        tables.put_into(page, "fusion", tables.table(["n", "found"], [["1", "all"]]))
    assert page.read_text() == (
        "before\n<!-- fusion -->\n\n| n | found |\n| --- | --- |\n| 1 | all |\n\n"
        "<!-- end of fusion -->\nafter\n"
    )
    with pytest.raises(SystemExit, match="has no place"):
        tables.put_into(page, "speed", [])
