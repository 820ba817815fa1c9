"""The look of the empty strip is followed for hours; what stands before it never fades into it.

Pictures are made from the light of a simulated camera, changed as LEDs, exposure and sun would.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.config import BackgroundSettings, Settings
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import FloatArray, Frame, Picture, Shadows
from cornertouchd.pipeline import CameraPipeline, PictureError
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.lighting import Lighting, lighting

RIG = SimulatedRig()
CAMERA = "C3"
WIDTH = RIG.formats[CAMERA].width_px
EMPTY = RIG.light(CAMERA).astype(np.float64)
TOUCHED = RIG.light(CAMERA, [Finger(100.0, 200.0), Finger(250.0, 60.0)]).astype(np.float64)
COLUMNS = np.arange(WIDTH)
SIDE = np.clip((COLUMNS - 400) / 40, 0, 1)
"""A third of the columns, with a soft border: where the sun shines."""

Light = Callable[[float], FloatArray]


def calibrated(
    empty: FloatArray = EMPTY, background: BackgroundSettings | None = None
) -> CameraPipeline:
    """A camera whose calibration saw this light."""
    mean = np.mean([expose(empty, index) for index in range(8)], axis=0)
    model = AnglePolynomial((0.0, 0.0), (0.8, 0.8), WIDTH)
    known = CameraCalibration(CAMERA, "", RIG.formats[CAMERA], mean, model, 0.1)
    settings = Settings() if background is None else Settings(background=background)
    return CameraPipeline(known, settings)


def expose(light: FloatArray, index: int) -> Picture:
    return RIG.expose(CAMERA, index, light.astype(np.float32))


def frame(light: FloatArray, at_s: float, lit_mask: int | None = 15) -> Frame:
    return Frame(CAMERA, 0, at_s, lit_mask, expose(light, round(at_s * 1000)))


def see(camera: CameraPipeline, light: FloatArray, at_s: float) -> Shadows:
    return camera.observe(frame(light, at_s)).shadows


def watch(
    camera: CameraPipeline, light: Light, from_s: float, to_s: float, every_s: float = 1.0
) -> Iterator[Shadows]:
    for at_s in np.arange(from_s, to_s, every_s).tolist():
        yield see(camera, light(at_s), at_s)


def edges(shadows: Shadows) -> list[float]:
    assert shadows.valid.all()
    return [float(edge) for edge in shadows.edges_px.ravel()]


REFERENCE = edges(see(calibrated(), TOUCHED, 0.0))
"""Where the two fingers' edges are in good light."""


def test_there_are_two_fingers_to_see() -> None:
    assert len(REFERENCE) == 4


class TestWhatRests:
    def test_a_finger_that_rests_for_an_hour_never_fades(self) -> None:
        camera = calibrated()
        for shadows in watch(camera, lambda _: TOUCHED, 0.0, 3600.0, 2.0):
            assert edges(shadows) == pytest.approx(REFERENCE, abs=0.1)

    def test_when_it_leaves_the_strip_is_empty(self) -> None:
        camera = calibrated()
        for _ in watch(camera, lambda _: TOUCHED, 0.0, 300.0):
            pass
        assert len(see(camera, EMPTY, 300.0)) == 0

    def test_a_finger_shows_at_once_after_an_hour_without_any(self) -> None:
        camera = calibrated()
        for shadows in watch(camera, lambda _: EMPTY, 0.0, 3600.0, 10.0):
            assert len(shadows) == 0
        assert edges(see(camera, TOUCHED, 3600.0)) == pytest.approx(REFERENCE, abs=0.1)

    def test_a_finger_stays_while_leds_age_around_it(self) -> None:
        def ageing(at_s: float) -> FloatArray:
            dimmer: FloatArray = 1 - 0.05 * at_s / 3600 * np.sin(COLUMNS / 15) ** 2
            return TOUCHED * dimmer

        camera = calibrated()
        for shadows in watch(camera, ageing, 0.0, 3600.0, 5.0):
            assert edges(shadows) == pytest.approx(REFERENCE, abs=0.2)


class TestExposure:
    @pytest.mark.parametrize("factor", [0.33, 0.5, 0.8, 1.3, 2.0, 2.9])
    def test_a_step_is_no_shadow_and_moves_none(self, factor: float) -> None:
        dim = 0.3 if factor > 1 else 1.0
        camera = calibrated(dim * EMPTY)
        assert len(see(camera, factor * dim * EMPTY, 0.01)) == 0
        assert edges(see(camera, factor * dim * TOUCHED, 0.02)) == pytest.approx(REFERENCE, abs=0.2)

    @pytest.mark.parametrize("factor", [0.5, 1.0, 1.2])
    def test_a_palm_over_most_of_the_strip_is_no_step(self, factor: float) -> None:
        covered = slice(120, 500)  # 60 % of the columns
        light = EMPTY.copy()
        light[:, covered] *= 0.06
        camera = calibrated()
        for shadows in watch(camera, lambda _: factor * light, 0.0, 60.0):
            (palm,) = shadows
            assert (palm.left_px, palm.right_px) == pytest.approx((120, 500), abs=1.0)

    def test_two_arms_in_half_light_are_no_step(self) -> None:
        light = EMPTY.copy()
        for arm in (slice(60, 240), slice(300, 490)):
            light[:, arm] *= np.linspace(0.1, 0.45, 190)[: arm.stop - arm.start]
        assert len(see(calibrated(), light, 0.0)) == 2

    def test_flicker_from_picture_to_picture_is_no_shadow(self) -> None:
        camera = calibrated()

        def flickering(at_s: float) -> FloatArray:
            return EMPTY * (1.0 + 0.1 * np.sin(37.0 * at_s))

        assert all(len(seen) == 0 for seen in watch(camera, flickering, 0.0, 2.0, 0.01))

    def test_a_frame_that_is_switched_off_is_no_step(self) -> None:
        (shadow,) = see(calibrated(), 0.0 * EMPTY, 0.0)
        assert not shadow.left_valid
        assert not shadow.right_valid


class TestSun:
    @staticmethod
    def sunrise(light: FloatArray) -> Light:
        """The sun rises over one side within ten minutes, and is gone after ten more."""

        def at(at_s: float) -> FloatArray:
            height = 1 - abs(at_s - 600) / 600
            return light * (1 + 0.7 * height * SIDE)

        return at

    @staticmethod
    def camera() -> CameraPipeline:
        return calibrated(0.6 * EMPTY)

    def test_a_sunrise_over_one_side_makes_no_shadow(self) -> None:
        risen = self.sunrise(0.6 * EMPTY)
        assert all(len(seen) == 0 for seen in watch(self.camera(), risen, 0.0, 1300.0, 2.0))

    def test_touches_are_found_all_the_while(self) -> None:
        camera = self.camera()
        risen, touched = self.sunrise(0.6 * EMPTY), self.sunrise(0.6 * TOUCHED)
        for at_s in range(0, 1300, 10):
            for _ in watch(camera, risen, at_s, at_s + 9):
                pass
            shadows = see(camera, touched(at_s + 9), at_s + 9)
            assert edges(shadows) == pytest.approx(REFERENCE, abs=0.3)

    def test_a_touch_that_rests_all_the_while_is_kept(self) -> None:
        for seen in watch(self.camera(), self.sunrise(0.6 * TOUCHED), 0.0, 1300.0, 2.0):
            assert edges(seen) == pytest.approx(REFERENCE, abs=0.6)

    def test_a_cloud_makes_no_shadow(self) -> None:
        camera = self.camera()
        for _ in watch(camera, self.sunrise(0.6 * EMPTY), 0.0, 400.0):
            pass
        assert all(len(seen) == 0 for seen in watch(camera, lambda _: 0.6 * EMPTY, 400.0, 600.0))
        assert edges(see(camera, 0.6 * TOUCHED, 600.0)) == pytest.approx(REFERENCE, abs=0.2)


class TestFullScale:
    FLASH = 1 + 4.0 * ((COLUMNS >= 200) & (COLUMNS < 260))

    def test_columns_at_full_scale_are_neither_shadow_nor_light(self) -> None:
        camera = calibrated(0.5 * EMPTY)
        assert len(see(camera, 0.5 * EMPTY * self.FLASH, 0.0)) == 0
        assert camera.masked_columns
        (masked,) = camera.masked_columns
        assert abs(masked.first_px - 200) <= 2
        assert abs(masked.last_px - 259) <= 2
        assert "full scale" in str(masked)

    def test_a_shadow_beside_them_has_no_edge_there(self) -> None:
        light = 0.5 * EMPTY * self.FLASH
        light[:, 252:290] *= 0.04 / self.FLASH[252:290]
        seen = see(calibrated(0.5 * EMPTY), light, 0.0)
        (shadow,) = [one for one in seen if one.right_px > 280]
        assert not shadow.left_valid
        assert shadow.right_valid

    def test_where_they_hide_something_the_camera_says_so(self) -> None:
        light = 0.5 * EMPTY * self.FLASH
        light[:, 400:420] *= 0.04
        hidden, shadow = see(calibrated(0.5 * EMPTY), light, 0.0)
        assert (hidden.left_px, hidden.right_px) == pytest.approx((200, 260), abs=2)
        assert hidden.depth == 0.0
        assert not hidden.left_valid
        assert not hidden.right_valid
        assert shadow.left_valid

    def test_when_the_light_has_gone_all_is_as_before(self) -> None:
        camera = calibrated(0.5 * EMPTY)
        for _ in watch(camera, lambda _: 0.5 * EMPTY * self.FLASH, 0.0, 5.0, 0.1):
            pass
        assert edges(see(camera, 0.5 * TOUCHED, 5.0)) == pytest.approx(REFERENCE, abs=0.2)
        assert camera.masked_columns == ()

    def test_light_that_stays_is_background_after_some_minutes(self) -> None:
        camera = calibrated(0.5 * EMPTY)
        for _ in watch(camera, lambda _: 0.5 * EMPTY * self.FLASH, 0.0, 180.0, 0.5):
            pass
        light = 0.5 * EMPTY * self.FLASH
        light[:, 220:240] *= 0.04 / self.FLASH[220:240]
        (shadow,) = see(camera, light, 180.0)
        assert (shadow.left_px, shadow.right_px) == pytest.approx((220, 240), abs=1.5)
        assert "shade the sun" in str(camera.masked_columns[0])  # fingers that it lights hide there


class TestDarkPictures:
    AMBIENT = 0.35 * EMPTY * SIDE
    """The sun on one side; it lights fingers as it does the strip."""

    def alternating(
        self, camera: CameraPipeline, lit: FloatArray, ambient: FloatArray, from_s: float
    ) -> Shadows:
        """Show dark and lit pictures in turn for half a second; return what the last one shows."""
        for at_s in (from_s + 0.02 * np.arange(25)).tolist():
            camera.learn_dark(frame(ambient, at_s, lit_mask=0))
            shadows = see(camera, lit + ambient, at_s + 0.01)
        return shadows

    def test_sun_that_comes_and_goes_moves_no_edge(self) -> None:
        camera = calibrated(0.6 * EMPTY)
        sunless = np.zeros_like(EMPTY)
        for step, ambient in enumerate((sunless, self.AMBIENT, sunless, 0.7 * self.AMBIENT)):
            shadows = self.alternating(camera, 0.6 * TOUCHED, ambient, float(step))
            assert edges(shadows) == pytest.approx(REFERENCE, abs=0.2)

    def test_without_them_the_same_sun_lights_fingers_up(self) -> None:
        shadows = see(calibrated(0.6 * EMPTY), 0.6 * TOUCHED + self.AMBIENT, 0.0)
        seen = shadows.edges_px.ravel()
        assert len(seen) != 4 or np.abs(seen - REFERENCE).max() > 0.3

    def test_the_first_one_changes_nothing_by_itself(self) -> None:
        camera = calibrated(0.6 * EMPTY + self.AMBIENT)
        camera.learn_dark(frame(self.AMBIENT, 0.0, lit_mask=0))
        shadows = see(camera, 0.6 * TOUCHED + self.AMBIENT, 0.01)
        assert edges(shadows) == pytest.approx(REFERENCE, abs=0.2)

    def test_sun_that_shone_before_the_start_moves_no_edge(self) -> None:
        camera = calibrated(EMPTY)
        ambient = 0.6 * EMPTY * SIDE
        see(camera, 0.4 * TOUCHED + ambient, 0.0)
        shadows = self.alternating(camera, 0.4 * TOUCHED, ambient, 0.1)
        assert edges(shadows) == pytest.approx(REFERENCE, abs=0.2)
        assert not camera.masked_columns

    def test_old_ones_do_not_count(self) -> None:
        camera = calibrated(0.6 * EMPTY)
        self.alternating(camera, 0.6 * EMPTY, np.zeros_like(EMPTY), 0.0)
        self.alternating(camera, 0.6 * EMPTY, self.AMBIENT, 1.0)
        # four seconds later the sun is still there, and nothing is known of it
        for seen in watch(camera, lambda _: 0.6 * EMPTY + self.AMBIENT, 6.0, 8.0, 0.1):
            assert len(seen) == 0
        # then it goes: that is no worse than before there were any dark pictures
        assert len(see(camera, 0.6 * EMPTY, 8.0)) == 0

    def test_they_are_told_from_others_by_the_lit_mask(self) -> None:
        masks = {None: Lighting.LIT, 15: Lighting.LIT, 0: Lighting.DARK, 5: Lighting.PARTLY}
        for mask, expected in masks.items():
            assert lighting(frame(EMPTY, 0.0, mask)) is expected


class TestDeadLeds:
    def test_they_are_listed_and_hide_what_is_behind_them(self) -> None:
        light = EMPTY.copy()
        light[:, 300:316] *= 0.1
        camera = calibrated(light)
        (masked,) = camera.masked_columns
        assert abs(masked.first_px - 300) <= 1
        assert abs(masked.last_px - 315) <= 1
        assert "dead or dim LED, 10% of the strip's light" in str(masked)
        assert len(see(camera, light, 0.0)) == 0
        light[:, 100:120] *= 0.04
        shadow, hidden = see(camera, light, 0.1)
        assert shadow.left_valid
        assert hidden.depth == 0.0

    def test_a_strip_without_any_has_none_to_list(self) -> None:
        assert calibrated().masked_columns == ()


class TestStateless:
    def test_to_find_is_not_to_learn(self) -> None:
        camera = calibrated()
        first = camera.find(frame(TOUCHED, 0.0)).shadows
        for at_s in range(1, 200):
            camera.find(frame(EMPTY * (1 - 0.2 * SIDE), at_s))
        again = camera.find(frame(TOUCHED, 0.0)).shadows
        assert again.edges_px.tolist() == first.edges_px.tolist()

    def test_what_was_learned_does_not_change_what_is_found(self) -> None:
        camera = calibrated()
        before = camera.find(frame(TOUCHED, 0.0)).shadows
        for _ in watch(camera, lambda _: EMPTY * (1 + 0.2 * SIDE), 0.0, 100.0):
            pass
        assert camera.find(frame(TOUCHED, 0.0)).shadows.edges_px.tolist() == (
            before.edges_px.tolist()
        )

    def test_a_reset_forgets_what_was_learned(self) -> None:
        camera, fresh = calibrated(), calibrated()
        for _ in watch(camera, lambda _: EMPTY * (1 + 0.1 * SIDE), 0.0, 100.0):
            pass
        camera.learn_dark(frame(0.1 * EMPTY, 100.0, lit_mask=0))
        camera.reset()
        seen, expected = see(camera, TOUCHED, 0.0), see(fresh, TOUCHED, 0.0)
        assert seen.edges_px.tolist() == expected.edges_px.tolist()

    def test_learning_can_be_switched_off(self) -> None:
        camera = calibrated(background=BackgroundSettings(learn=False))
        dimmed = TOUCHED * (1 - 0.3 * SIDE)
        first = edges(see(camera, dimmed, 0.0))
        for _ in watch(camera, lambda _: EMPTY * (1 - 0.3 * SIDE), 1.0, 200.0):
            pass
        assert edges(see(camera, dimmed, 0.0)) == first

    def test_the_same_pictures_give_the_same_shadows(self) -> None:
        runs = [
            [
                shadows.edges_px.tolist()
                for shadows in watch(calibrated(), TestSun.sunrise(TOUCHED), 0.0, 60.0)
            ]
            for _ in range(2)
        ]
        assert runs[0] == runs[1]

    def test_times_that_jump_back_do_no_harm(self) -> None:
        camera = calibrated()
        camera.learn_dark(frame(0.0 * EMPTY, 500.0, lit_mask=0))
        for at_s in (500.0, 501.0, 3.0, 4.0, 900.0, 0.0):
            assert edges(see(camera, TOUCHED, at_s)) == pytest.approx(REFERENCE, abs=0.1)


def test_noise_is_no_strip_and_teaches_nothing() -> None:
    camera = calibrated()
    for number in range(50):
        noise = np.random.default_rng(number).integers(0, 256, (64, WIDTH), np.uint8)
        garbage = Frame(CAMERA, number, 0.1 * number, 15, noise)
        for look in (camera.observe, camera.find):
            with pytest.raises(PictureError, match="noise instead of the strip"):
                look(garbage)
    assert edges(see(camera, TOUCHED, 5.0)) == pytest.approx(REFERENCE, abs=0.1)


@pytest.mark.parametrize("off_s", [0.2, 1.0, 60.0])
def test_darkness_teaches_nothing(off_s: float) -> None:
    """The LEDs are off, or a hand is over the lens."""
    camera = calibrated()
    list(watch(camera, lambda _: TOUCHED, 0.0, 5.0, 0.1))
    list(watch(camera, lambda _: 0.05 * EMPTY, 5.0, 5.0 + off_s, 0.1))
    for shadows in watch(camera, lambda _: TOUCHED, 6.0 + off_s, 66.0 + off_s):
        assert edges(shadows) == pytest.approx(REFERENCE, abs=0.1)


def test_a_lamp_that_shone_for_minutes_leaves_no_shadow_when_it_goes() -> None:
    camera = calibrated()
    lit = EMPTY * (1.0 + 1.2 * SIDE)
    list(watch(camera, lambda _: lit, 0.0, 300.0))
    list(watch(camera, lambda _: EMPTY, 300.0, 303.0, 0.1))
    assert edges(see(camera, TOUCHED, 303.0)) == pytest.approx(REFERENCE, abs=0.8)
    list(watch(camera, lambda _: EMPTY, 304.0, 400.0))
    assert edges(see(camera, TOUCHED, 400.0)) == pytest.approx(REFERENCE, abs=0.15)


def test_a_lit_picture_that_is_said_to_be_dark_is_refused_and_teaches_nothing() -> None:
    camera = calibrated()
    with pytest.raises(PictureError, match="the strip is lit"):
        camera.learn_dark(frame(EMPTY, 0.0, 0))
    for shadows in watch(camera, lambda _: TOUCHED, 0.1, 30.0):
        assert edges(shadows) == pytest.approx(REFERENCE, abs=0.1)
