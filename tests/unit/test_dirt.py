"""Dirt before the strip: told after a minute, out of the way of touches, gone when it is gone."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from seen_discs import (
    TABLES,
    Columns,
    Disc,
    at_time,
    column_of,
    frame_set,
    observe,
    places,
    shadow_of,
    surface_pipeline,
)

from cornertouchd.config import DirtSettings, Settings
from cornertouchd.fusion.dirt import DirtWatch
from cornertouchd.model import Contact, FrameSet
from cornertouchd.pipeline import SurfacePipeline

GUM = {"C2": [(201.0, 206.0)]}
FINGER = (120.0, 150.0, 6.0)


def finger_contact(disc: Disc, cameras: tuple[str, ...] = ("C1", "C2", "C3", "C4")) -> Contact:
    return Contact(disc[0], disc[1], 2 * disc[2], cameras, 1.0, 0.1)


def watch(after_s: float = 60.0) -> DirtWatch:
    return DirtWatch(DirtSettings(after_s=after_s), TABLES.values())


def show(
    dirt_watch: DirtWatch,
    seconds: float,
    discs: Sequence[Disc] = (),
    dirt: Mapping[str, Sequence[Columns]] | None = None,
    *,
    since_s: float = 0.0,
    explained: bool = True,
    noise: bool = False,
) -> float:
    """Show the same to a watch, a frame set a second; return the time after it."""
    rng = np.random.default_rng(5)
    contacts = [finger_contact(disc) for disc in discs] if explained else []
    seen = frame_set(discs, since_s, dirt)
    for second in range(int(seconds)):
        if noise:
            seen = frame_set(discs, since_s, dirt, rng)
        dirt_watch.learn(at_time(seen, since_s + second), contacts)
    return since_s + seconds


def columns(dirt_watch: DirtWatch) -> list[tuple[str, int, int]]:
    return [(d.camera, round(d.left_px), round(d.right_px)) for d in dirt_watch.dirt]


class TestWhatIsDirt:
    def test_gum_is_told_after_a_minute(self) -> None:
        dirt_watch = watch()
        now_s = show(dirt_watch, 60, dirt=GUM, since_s=1000.0, noise=True)
        assert dirt_watch.dirt == ()
        show(dirt_watch, 2, dirt=GUM, since_s=now_s, noise=True)
        assert columns(dirt_watch) == [("C2", 201, 206)]
        (dirt,) = dirt_watch.dirt
        assert dirt.since_s == 1001.0
        assert str(dirt) == (
            "camera C2: something has hung before the strip at columns 201..206 for 60 s; "
            "touches go on without it: clean the strip, or replace the LED that has died there"
        )

    def test_the_setting_says_how_long_it_takes(self) -> None:
        dirt_watch = watch(after_s=5.0)
        show(dirt_watch, 8, dirt=GUM)
        assert columns(dirt_watch) == [("C2", 201, 206)]

    def test_several_pieces_before_several_cameras(self) -> None:
        pieces = {"C1": [(50.0, 53.0), (300.0, 320.0)], "C4": [(500.0, 504.0)]}
        dirt_watch = watch()
        show(dirt_watch, 65, dirt=pieces)
        assert columns(dirt_watch) == [("C1", 50, 53), ("C1", 300, 320), ("C4", 500, 504)]

    def test_it_is_the_same_object_until_something_changes(self) -> None:
        dirt_watch = watch()
        now_s = show(dirt_watch, 65, dirt=GUM)
        told = dirt_watch.dirt
        now_s = show(dirt_watch, 30, dirt=GUM, since_s=now_s)
        assert dirt_watch.dirt is told
        more = {**GUM, "C3": [(400.0, 410.0)]}
        show(dirt_watch, 65, dirt=more, since_s=now_s)
        assert dirt_watch.dirt[0] is told[0]
        assert len(dirt_watch.dirt) == 2

    def test_what_rests_for_an_hour_and_is_explained_is_none(self) -> None:
        finger, cup = FINGER, (230.0, 280.0, 33.0)
        dirt_watch = watch()
        show(dirt_watch, 3600, discs=[finger, cup])
        assert dirt_watch.dirt == ()

    def test_a_finger_that_is_found_now_and_then_is_none(self) -> None:
        dirt_watch, now_s = watch(), 0.0
        for _ in range(60):
            now_s = show(dirt_watch, 3, discs=[FINGER], since_s=now_s, explained=False)
            now_s = show(dirt_watch, 1, discs=[FINGER], since_s=now_s)
        assert dirt_watch.dirt == ()

    def test_what_one_camera_alone_takes_for_a_touch_is_dirt(self) -> None:
        dirt_watch = watch()
        only_c2 = finger_contact(FINGER, cameras=("C2",))
        for second in range(65):
            seen = [observe(c, [FINGER] if c == "C2" else [], float(second)) for c in TABLES]
            dirt_watch.learn(FrameSet(float(second), tuple(seen)), [only_c2])
        assert [dirt.camera for dirt in dirt_watch.dirt] == ["C2"]

    def test_a_fly_that_walks_is_none(self) -> None:
        dirt_watch = watch()
        for second in range(200):
            fly = {"C2": [(200.0 + second // 5, 205.0 + second // 5)]}
            show(dirt_watch, 1, dirt=fly, since_s=float(second))
        assert dirt_watch.dirt == ()

    def test_gum_is_told_though_fingers_pass_over_it(self) -> None:
        dirt_watch, now_s = watch(), 0.0
        left, right = GUM["C2"][0]
        over = {"C2": [(left - 8.0, right + 3.0)]}
        for _ in range(20):
            now_s = show(dirt_watch, 4, dirt=GUM, since_s=now_s)
            now_s = show(dirt_watch, 1, dirt=over, since_s=now_s)
        assert columns(dirt_watch) == [("C2", 201, 206)]

    def test_gum_is_told_though_it_makes_a_ghost_now_and_then(self) -> None:
        dirt_watch = watch()
        angle = np.interp(203.5, np.arange(641), TABLES["C2"].angles_rad)
        on_the_line = (360.0 + 200.0 * np.cos(angle), -10.0 + 200.0 * np.sin(angle), 6.0)
        for second in range(100):
            ghosts = [finger_contact(on_the_line)] if second % 20 == 0 else []
            dirt_watch.learn(frame_set([], float(second), GUM), ghosts)
        assert columns(dirt_watch) == [("C2", 201, 206)]

    def test_the_border_of_the_view_is_none(self) -> None:
        dirt_watch = watch()
        blind = {"C1": [(-5.0, 700.0)]}
        show(dirt_watch, 100, dirt=blind)
        assert dirt_watch.dirt == ()


class TestWhatIsNoDirtAnyMore:
    def test_dirt_that_is_wiped_off_is_gone(self) -> None:
        dirt_watch = watch()
        now_s = show(dirt_watch, 65, dirt=GUM)
        now_s = show(dirt_watch, 2, since_s=now_s)
        assert columns(dirt_watch) == [("C2", 201, 206)]
        show(dirt_watch, 2, since_s=now_s)
        assert dirt_watch.dirt == ()

    def test_a_shadow_that_covers_it_says_nothing(self) -> None:
        dirt_watch = watch()
        now_s = show(dirt_watch, 65, dirt=GUM)
        show(dirt_watch, 300, dirt={"C2": [(190.0, 230.0)]}, since_s=now_s)
        assert ("C2", 201, 206) in columns(dirt_watch)

    def test_dirt_that_creeps_is_followed(self) -> None:
        dirt_watch = watch()
        now_s = show(dirt_watch, 65, dirt=GUM)
        for step in range(400):
            creeping = {"C2": [(201.0 + step / 40, 206.0 + step / 40)]}
            now_s = show(dirt_watch, 1, dirt=creeping, since_s=now_s)
        assert len(dirt_watch.dirt) == 1
        (seen,) = [
            one
            for one in dirt_watch.set_aside(frame_set([], now_s, creeping)).observations
            if one.camera == "C2"
        ]
        assert not seen.shadows.valid.any()

    def test_when_time_jumps_back_it_begins_anew(self) -> None:
        dirt_watch = watch()
        show(dirt_watch, 65, dirt=GUM, since_s=5000.0)
        now_s = show(dirt_watch, 30, dirt=GUM)
        assert dirt_watch.dirt == ()
        show(dirt_watch, 35, dirt=GUM, since_s=now_s)
        assert columns(dirt_watch) == [("C2", 201, 206)]

    def test_one_time_that_is_a_little_back_costs_nothing(self) -> None:
        dirt_watch = watch()
        now_s = show(dirt_watch, 59, dirt=GUM, since_s=1000.0)
        dirt_watch.learn(at_time(frame_set([], now_s, GUM), now_s - 1.05), [])
        show(dirt_watch, 3, dirt=GUM, since_s=now_s)
        assert columns(dirt_watch) == [("C2", 201, 206)]
        dirt_watch.learn(at_time(frame_set([], now_s, GUM), now_s + 1.0), [])
        assert columns(dirt_watch) == [("C2", 201, 206)]

    def test_what_was_before_a_long_silence_does_not_count(self) -> None:
        dirt_watch = watch()
        show(dirt_watch, 3, dirt=GUM)
        show(dirt_watch, 3, dirt=GUM, since_s=7200.0)
        assert dirt_watch.dirt == ()


class TestSettingAside:
    @pytest.fixture
    def knowing(self) -> DirtWatch:
        dirt_watch = watch()
        show(dirt_watch, 65, dirt=GUM)
        return dirt_watch

    def of_c2(self, dirt_watch: DirtWatch, dirt: Columns) -> list[tuple[bool, bool]]:
        seen = dirt_watch.set_aside(frame_set([], 100.0, {"C2": [dirt]}))
        shadows = next(one.shadows for one in seen.observations if one.camera == "C2")
        return [(one.left_valid, one.right_valid) for one in shadows]

    def test_its_own_edges_bound_nothing(self, knowing: DirtWatch) -> None:
        assert self.of_c2(knowing, (201.2, 205.9)) == [(False, False)]

    def test_of_a_shadow_that_reaches_beyond_it_the_other_edge_counts(
        self, knowing: DirtWatch
    ) -> None:
        assert self.of_c2(knowing, (201.0, 222.0)) == [(False, True)]
        assert self.of_c2(knowing, (188.0, 206.0)) == [(True, False)]
        assert self.of_c2(knowing, (188.0, 222.0)) == [(True, True)]

    def test_other_shadows_are_left_alone(self, knowing: DirtWatch) -> None:
        given = frame_set([FINGER], 100.0)
        seen = knowing.set_aside(given)
        for one, other in zip(given.observations, seen.observations, strict=True):
            assert one.shadows.valid.tolist() == other.shadows.valid.tolist()

    def test_without_dirt_nothing_is_touched(self) -> None:
        given = frame_set([FINGER])
        assert watch().set_aside(given) is given


GUM_OF_TWO = {
    "C1": [(column_of("C1", 200.0, 180.0) - 4.0, column_of("C1", 200.0, 180.0) + 4.0)],
    "C3": [(column_of("C3", 120.0, 280.0) - 3.0, column_of("C3", 120.0, 280.0) + 3.0)],
}
GUM_OF_ONE = {"C1": GUM_OF_TWO["C1"]}


class TestTouchesBesideDirt:
    """The whole way from shadows to contacts, with the crossing as it is."""

    @pytest.fixture(params=[GUM_OF_ONE, GUM_OF_TWO], ids=["one camera", "two cameras"])
    def gum(self, request: pytest.FixtureRequest) -> Mapping[str, Sequence[Columns]]:
        return request.param  # type: ignore[no-any-return]

    @pytest.fixture
    def knowing(self, gum: Mapping[str, Sequence[Columns]]) -> SurfacePipeline:
        pipeline = surface_pipeline(Settings(dirt=DirtSettings(after_s=5.0)))
        for second in range(8):
            contacts, _ = pipeline.follow(frame_set([], float(second), gum))
            assert contacts == ()
        assert {dirt.camera for dirt in pipeline.dirt} == set(gum)
        return pipeline

    def cross(
        self,
        pipeline: SurfacePipeline,
        discs: Sequence[Disc],
        gum: Mapping[str, Sequence[Columns]],
        now_s: float,
    ) -> list[tuple[float, float]]:
        rng = np.random.default_rng(int(1000 * now_s))
        pipeline.reset()
        contacts, _ = pipeline.follow(frame_set(discs, now_s, gum, rng))
        return places(contacts)

    def test_fingers_make_no_ghosts_with_it(
        self, knowing: SurfacePipeline, gum: Mapping[str, Sequence[Columns]]
    ) -> None:
        rng = np.random.default_rng(2)
        for scene in range(40):
            discs = _apart(rng, 3)
            found = self.cross(knowing, discs, gum, 20.0 + scene)
            assert len(found) == len(discs), (discs, found)
            for place, disc in zip(found, sorted(discs), strict=True):
                assert place == pytest.approx(disc[:2], abs=1.5)

    @pytest.mark.parametrize("beside_px", [-14.0, -7.0, -3.0, 0.0, 3.0, 7.0, 14.0])
    @pytest.mark.parametrize("distance_mm", [120.0, 300.0])
    def test_a_finger_behind_or_partly_behind_it_is_found(
        self,
        knowing: SurfacePipeline,
        gum: Mapping[str, Sequence[Columns]],
        beside_px: float,
        distance_mm: float,
    ) -> None:
        for camera, ((left, right),) in gum.items():
            table = TABLES[camera]
            angle = np.interp((left + right) / 2.0 + beside_px, np.arange(641), table.angles_rad)
            disc = (
                table.x_mm + distance_mm * np.cos(angle),
                table.y_mm + distance_mm * np.sin(angle),
                6.0,
            )
            (found,) = self.cross(knowing, [disc], gum, 20.0)
            assert found == pytest.approx(disc[:2], abs=0.5)

    def test_a_thin_finger_wholly_behind_wide_dirt_is_found(self) -> None:
        disc = (250.0, 250.0, 4.0)
        left, right = shadow_of("C1", disc)
        gum = {"C1": [(left - 10.0, right + 10.0)]}
        pipeline = surface_pipeline(Settings(dirt=DirtSettings(after_s=5.0)))
        for second in range(8):
            pipeline.follow(frame_set([], float(second), gum))
        (found,) = self.cross(pipeline, [disc], gum, 20.0)
        assert found == pytest.approx(disc[:2], abs=0.3)

    def test_what_stood_there_before_it_was_known_makes_no_touch(self) -> None:
        """Until then it is an unexplained shadow like any other."""
        pipeline = surface_pipeline()
        rng = np.random.default_rng(4)
        told = [
            len(pipeline.follow(frame_set([FINGER], n / 100.0, GUM_OF_ONE, rng))[1])
            for n in range(30)
        ]
        assert set(told) == {1}

    def test_each_frame_set_on_its_own_knows_no_dirt(
        self, knowing: SurfacePipeline, gum: Mapping[str, Sequence[Columns]]
    ) -> None:
        seen = frame_set([FINGER], 20.0, gum)
        assert knowing.cross(seen) == surface_pipeline().cross(seen)

    def test_dirt_stays_known_when_touches_are_forgotten(self, knowing: SurfacePipeline) -> None:
        told = knowing.dirt
        knowing.reset()
        assert knowing.dirt is told


def _apart(rng: np.random.Generator, count: int) -> list[Disc]:
    discs: list[Disc] = []
    while len(discs) < count:
        x, y = rng.uniform((10.0, 10.0), (340.0, 390.0))
        if all(np.hypot(x - other[0], y - other[1]) > 25.0 for other in discs):
            discs.append((float(x), float(y), 6.0))
    return discs
