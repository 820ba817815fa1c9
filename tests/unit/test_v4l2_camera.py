"""Cameras through V4L2, against a driver in memory that does what drivers do."""

import errno
import logging
import select

import cv2
import numpy as np
import pytest
from fake_v4l2 import FakeControl, FakeDriver

from cornertouchd.devices import v4l2_abi as abi
from cornertouchd.devices.v4l2_camera import V4l2Camera, V4l2CameraPort
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.ports import CameraError

STRIP = PictureFormat(64, 48, 10, 20)
PICTURE = np.arange(64 * 48, dtype=np.uint32).astype(np.uint8).reshape(48, 64)
OTHER = 255 - PICTURE


@pytest.fixture
def driver() -> FakeDriver:
    return FakeDriver()


def port(driver: FakeDriver, **given: object) -> V4l2CameraPort:
    settings = {"picture_format": STRIP, "rate_hz": 100.0, **given}
    return V4l2CameraPort(
        "C2", "/dev/cam", now_s=lambda: driver.now_s, open_node=driver.open, **settings
    )


def read(camera: V4l2Camera) -> Frame:
    frame = camera.read(0.5)
    assert frame is not None
    return frame


def refusal(driver: FakeDriver, **given: object) -> str:
    with pytest.raises(CameraError) as refused:
        port(driver, **given).open()
    assert all(node.closed for node in driver.nodes)
    return refused.value.reason


class TestPictures:
    def test_come_cut_to_the_rows_with_their_number_and_time(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.fill(PICTURE, age_s=0.004)
        frame = read(camera)
        assert (frame.camera, frame.sequence, frame.lit_mask) == ("C2", 0, None)
        assert frame.captured_at_s == pytest.approx(driver.now_s - 0.004, abs=1e-6)
        assert np.array_equal(frame.pixels, PICTURE[10:30])

    def test_the_newest_is_read_and_the_overtaken_are_counted(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        for picture in (OTHER, OTHER, PICTURE):
            driver.fill(picture)
        frame = read(camera)
        assert np.array_equal(frame.pixels, PICTURE[10:30])
        assert frame.sequence == 2
        assert camera.counts().stream.overtaken == 2

    def test_pixels_stay_until_the_next_read_while_the_driver_goes_on(
        self, driver: FakeDriver
    ) -> None:
        camera = port(driver).open()
        driver.fill(PICTURE)
        frame = read(camera)
        for _ in range(6):
            driver.fill(OTHER)
        assert np.array_equal(frame.pixels, PICTURE[10:30])

    def test_none_comes_in_time(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        before_s = driver.now_s
        assert camera.read(0.25) is None
        assert driver.now_s == pytest.approx(before_s + 0.25)

    def test_lost_ones_are_seen_in_the_numbers(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.fill(PICTURE)
        read(camera)
        driver.fill(PICTURE, lost=3)
        assert read(camera).sequence == 4
        assert camera.counts().stream.lost == 3

    def test_numbers_go_on_when_the_driver_wraps_around(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.sequence = 2**32 - 2
        numbers = []
        for _ in range(4):
            driver.fill(PICTURE)
            numbers.append(read(camera).sequence)
        assert numbers == [0, 1, 2, 3]

    def test_a_driver_that_does_not_count_is_counted_for(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        numbers = []
        for _ in range(3):
            driver.sequence = 0
            driver.fill(PICTURE)
            numbers.append(read(camera).sequence)
        assert numbers == [0, 1, 2]

    @pytest.mark.parametrize(
        ("clock", "age_s"), [(0x4000, 0.01), (abi.BUF_FLAG_TIMESTAMP_MONOTONIC, 99.0)]
    )
    def test_a_time_of_another_clock_is_replaced_by_the_arrival(
        self, driver: FakeDriver, clock: int, age_s: float
    ) -> None:
        camera = port(driver).open()
        driver.fill(PICTURE, clock=clock, age_s=age_s)
        assert read(camera).captured_at_s == driver.now_s
        assert camera.counts().stream.foreign == 1

    def test_none_is_taken_in_the_future(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.fill(PICTURE, age_s=-0.02)
        assert read(camera).captured_at_s == driver.now_s
        assert camera.counts().stream.foreign == 0


class TestDamage:
    def test_damaged_pictures_are_left_out_counted_and_told_once(
        self, driver: FakeDriver, caplog: pytest.LogCaptureFixture
    ) -> None:
        camera = port(driver).open()
        driver.while_waiting = [
            lambda: driver.fill(OTHER, flags=abi.BUF_FLAG_ERROR),
            lambda: driver.fill(OTHER, used=100),
            lambda: driver.fill(PICTURE),
        ]
        with caplog.at_level(logging.WARNING):
            assert np.array_equal(read(camera).pixels, PICTURE[10:30])
        counts = camera.counts()
        assert (counts.marked_bad, counts.damaged) == (1, 1)
        told = "camera C2: a damaged picture is left out (the driver marks it so)"
        assert [told in record.message for record in caplog.records] == [True]

    def test_nothing_but_damage_asks_for_a_new_start(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.while_waiting = [lambda: driver.fill(OTHER, flags=abi.BUF_FLAG_ERROR)] * 3
        with pytest.raises(CameraError, match=r"all 3 pictures within 0\.5 s were damaged"):
            camera.read(0.5)

    def test_what_a_stall_leaves_behind_is_a_mere_timeout(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.fill(OTHER, flags=abi.BUF_FLAG_ERROR, used=10)
        assert camera.read(0.5) is None

    @pytest.mark.parametrize(
        ("number", "told"),
        [
            (errno.ENODEV, r"camera C2: /dev/cam is gone; look at its plug"),
            (errno.EIO, r"/dev/cam stopped with EIO \(Input/output error\); if that comes back"),
        ],
    )
    def test_a_lost_device_is_told_from_a_broken_stream(
        self, driver: FakeDriver, number: int, told: str
    ) -> None:
        camera = port(driver).open()
        driver.events_when_idle = select.POLLERR
        driver.fails[abi.VIDIOC_DQBUF] = number
        with pytest.raises(CameraError, match=told):
            camera.read(0.5)
        camera.close()

    def test_an_error_without_a_name_does_not_spin(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.events_when_idle = select.POLLERR
        with pytest.raises(CameraError, match="reports an error without saying which"):
            camera.read(0.5)

    def test_closing_stops_and_frees_even_with_a_picture_in_hand(self, driver: FakeDriver) -> None:
        camera = port(driver).open()
        driver.fill(PICTURE)
        frame = read(camera)
        camera.close()
        camera.close()
        assert not driver.streaming
        assert driver.memory == []
        assert driver.nodes[0].closed
        assert frame.pixels.shape == (20, 64)

    def test_the_same_port_opens_again(self, driver: FakeDriver) -> None:
        cameras = port(driver)
        cameras.open().close()
        camera = cameras.open()
        driver.fill(PICTURE)
        assert np.array_equal(read(camera).pixels, PICTURE[10:30])


class TestFormats:
    def test_padded_lines(self, driver: FakeDriver) -> None:
        driver.padding = 24
        camera = port(driver).open()
        driver.fill(np.hstack([PICTURE, np.zeros((48, 24), np.uint8)]))
        frame = read(camera)
        assert np.array_equal(frame.pixels, PICTURE[10:30])
        assert frame.pixels.flags.c_contiguous

    @pytest.mark.parametrize(
        ("name", "packed"),
        [
            ("Y10", (PICTURE.astype("<u2") << 2) + 3),
            ("Y16", (PICTURE.astype("<u2") << 8) + 200),
            ("YUYV", PICTURE.astype("<u2") + (128 << 8)),
        ],
    )
    def test_sixteen_bits_a_pixel(self, driver: FakeDriver, name: str, packed: np.ndarray) -> None:
        driver.sizes, driver.rates = {name: [(64, 48)]}, {name: [100]}
        camera = port(driver).open()
        driver.fill(packed)
        assert np.array_equal(read(camera).pixels, PICTURE[10:30])

    def test_jpeg_pictures_and_damaged_ones(self, driver: FakeDriver) -> None:
        driver.sizes, driver.rates = {"MJPG": [(64, 48)]}, {"MJPG": [100]}
        camera = port(driver).open()
        _, jpeg = cv2.imencode(".jpg", PICTURE)
        whole = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE)
        driver.while_waiting = [lambda: driver.fill(jpeg[:300]), lambda: driver.fill(jpeg)]
        assert np.array_equal(read(camera).pixels, whole[10:30])
        assert camera.counts().damaged == 1

    def test_auto_takes_the_best_that_reaches_the_rate(self, driver: FakeDriver) -> None:
        driver.sizes = {"MJPG": [(64, 48)], "YUYV": [(64, 48)], "GREY": [(64, 48)]}
        driver.rates = {"MJPG": [120], "YUYV": (1, 100), "GREY": [60]}
        assert port(driver).open().layout.pixel_format == "YUYV"
        assert port(driver, rate_hz=60.0).open().layout.pixel_format == "GREY"
        assert port(driver, rate_hz=110.0).open().layout.pixel_format == "MJPG"
        assert driver.rate == 120

    def test_a_rate_that_none_reaches_is_told_once(
        self, driver: FakeDriver, caplog: pytest.LogCaptureFixture
    ) -> None:
        cameras = port(driver, rate_hz=200.0)
        cameras.open().close()
        cameras.open().close()
        told = "gives GREY 64x48 at 100 Hz, configured 200 Hz"
        assert [told in record.message for record in caplog.records] == [True]
        assert told in cameras.complaints[0]

    def test_a_format_by_name(self, driver: FakeDriver) -> None:
        driver.sizes["MJPG"] = [(64, 48)]
        assert port(driver, pixel_format="MJPG").open().layout.pixel_format == "MJPG"

    def test_a_size_it_does_not_have_is_answered_with_those_it_has(
        self, driver: FakeDriver
    ) -> None:
        driver.sizes = {"GREY": [(32, 24), (64, 24)], "RGB3": [(64, 48)]}
        assert refusal(driver) == (
            "/dev/cam has no 64x48; it has GREY 32x24 at 100, 30 Hz, GREY 64x24 at 100, 30 Hz: "
            "choose one of these"
        )
        driver.sizes = {"RGB3": [(64, 48)]}
        assert "its pixel formats (RGB3) cannot be read here" in refusal(driver)

    def test_any_size_of_a_range(self, driver: FakeDriver) -> None:
        driver.sizes = {"GREY": (16, 128, 16, 16, 96, 8)}
        camera = port(driver).open()
        assert camera.layout.width_px == 64
        camera.close()
        odd = PictureFormat(65, 48, 10, 20)
        assert "has no 65x48; it has GREY 16..128x16..96" in refusal(driver, picture_format=odd)

    def test_a_driver_that_makes_another_size_of_ours_is_refused(self, driver: FakeDriver) -> None:
        driver.makes_of_size = lambda width, height: (width, height // 2)
        told = "gives 64x24 GREY when asked for 64x48 GREY; it has GREY 64x48 at 100, 30 Hz"
        assert told in refusal(driver)

    @pytest.mark.parametrize(("step", "rows", "first"), [(1, 20, 0), (8, 24, 2)])
    def test_only_the_rows_of_the_strip_travel_where_the_driver_crops(
        self, driver: FakeDriver, step: int, rows: int, first: int
    ) -> None:
        driver.crops, driver.crop_step = True, step
        camera = port(driver).open()
        assert camera.layout.height_px == rows
        driver.fill(PICTURE[10 - first : 10 - first + rows])
        assert np.array_equal(read(camera).pixels, PICTURE[10:30])

    def test_a_driver_that_crops_badly_sends_whole_pictures(self, driver: FakeDriver) -> None:
        driver.crops = True
        driver.makes_of_size = lambda width, height: (width, 48)
        camera = port(driver).open()
        driver.fill(PICTURE)
        assert np.array_equal(read(camera).pixels, PICTURE[10:30])


class TestRefusals:
    @pytest.mark.parametrize(
        ("number", "told"),
        [
            (errno.ENOENT, "/dev/cam is not there; is it plugged in?"),
            (errno.EACCES, "put the user into the group video"),
            (errno.EBUSY, "is held by another program"),
        ],
    )
    def test_a_device_that_does_not_open(self, driver: FakeDriver, number: int, told: str) -> None:
        driver.fails["open"] = number
        assert told in refusal(driver)

    def test_a_bus_without_bandwidth(self, driver: FakeDriver) -> None:
        driver.fails[abi.VIDIOC_STREAMON] = errno.ENOSPC
        told = refusal(driver)
        assert "no bandwidth is left on its USB bus for 64x48 at 100 Hz" in told
        assert "lower cameras.rate_hz" in told

    def test_a_file_that_is_no_camera(self, driver: FakeDriver) -> None:
        driver.fails[abi.VIDIOC_QUERYCAP] = errno.ENOTTY
        assert "is no video device" in refusal(driver)
        driver.fails.clear()
        driver.capabilities = abi.CAP_STREAMING
        assert "(Fake Camera, driver fake) gives no pictures; a camera often has a second" in (
            refusal(driver)
        )
        driver.capabilities |= abi.CAP_VIDEO_CAPTURE_MPLANE
        assert 'try cameras.source = "opencv"' in refusal(driver)


class TestControls:
    @pytest.fixture(autouse=True)
    def has(self, driver: FakeDriver) -> None:
        menu = {0: "Auto Mode", 1: "Manual Mode"}
        self.gain = FakeControl(0x980913, "Gain", abi.CTRL_TYPE_INTEGER, 9, 0, 200, 2)
        self.auto = FakeControl(
            abi.CID_EXPOSURE_AUTO, "Auto Exposure", abi.CTRL_TYPE_MENU, 0, 0, 3, choices=menu
        )
        self.exposure = FakeControl(
            0x9A0902, "Exposure Time, Absolute", abi.CTRL_TYPE_INTEGER, 150, 1, 5000
        )
        driver.controls = [self.gain, self.auto, self.exposure]

    def test_are_set_at_every_opening(self, driver: FakeDriver) -> None:
        cameras = port(driver, controls={"exposure_time_absolute": 40, "gain": 4})
        for _ in range(2):
            self.gain.value = self.exposure.value = 77
            cameras.open().close()
            assert (self.gain.value, self.exposure.value) == (4, 40)
        assert cameras.complaints == ()

    def test_automatic_exposure_is_off_unless_it_is_configured(self, driver: FakeDriver) -> None:
        port(driver).open().close()
        assert self.auto.value == 1
        port(driver, controls={"auto_exposure": "auto mode"}).open().close()
        assert self.auto.value == 0

    def test_a_default_that_is_refused_is_no_complaint(self, driver: FakeDriver) -> None:
        self.auto.refuses = errno.EIO
        cameras = port(driver)
        cameras.open().close()
        assert cameras.complaints == ()

    @pytest.mark.parametrize(
        ("wanted", "told"),
        [
            ({"gian": 4}, "control gian = 4: the camera has no such control; did you mean gain?"),
            ({"zoom": 4}, "no such control; it has gain, auto_exposure, exposure_time_absolute"),
            ({"gain": 999}, "control gain = 999: it takes 0 to 200 in steps of 2"),
            ({"gain": 3}, "control gain = 3: it takes 0 to 200 in steps of 2"),
            ({"gain": "much"}, 'control gain = "much": it takes 0 to 200'),
            ({"auto_exposure": 2}, 'it takes 0 "Auto Mode", 1 "Manual Mode"'),
        ],
    )
    def test_what_cannot_be_is_explained_and_the_camera_works(
        self,
        driver: FakeDriver,
        caplog: pytest.LogCaptureFixture,
        wanted: dict[str, int | str],
        told: str,
    ) -> None:
        cameras = port(driver, controls=wanted)
        for _ in range(3):
            camera = cameras.open()
            driver.fill(PICTURE)
            read(camera)
            camera.close()
        assert [told in record.message for record in caplog.records] == [True]

    def test_what_the_driver_makes_otherwise_is_explained(self, driver: FakeDriver) -> None:
        self.gain.changes_to = 8
        cameras = port(driver, controls={"gain": 4})
        cameras.open().close()
        assert "control gain = 4: the driver made 8 of it" in cameras.complaints[0]

    @pytest.mark.parametrize(
        ("flags", "number", "told"),
        [
            (abi.CTRL_FLAG_INACTIVE, errno.EIO, "an automatic mode rules it: turn that off, too"),
            (abi.CTRL_FLAG_GRABBED, errno.EBUSY, "holds it while pictures flow"),
            (0, errno.EACCES, "the driver refuses it (Permission denied)"),
            (abi.CTRL_FLAG_READ_ONLY, 0, "the driver lets nobody set it; remove it"),
        ],
    )
    def test_a_refusal_is_explained(
        self, driver: FakeDriver, flags: int, number: int, told: str
    ) -> None:
        self.exposure.flags, self.exposure.refuses = flags, number
        cameras = port(driver, controls={"exposure_time_absolute": 40})
        cameras.open().close()
        assert told in cameras.complaints[0]

    def test_large_numbers_and_switches(self, driver: FakeDriver) -> None:
        wide = FakeControl(0x98_1000, "Pixel Rate", abi.CTRL_TYPE_INTEGER64, 0, -(2**62), 2**62)
        strobe = FakeControl(0x98_1001, "Strobe Output", abi.CTRL_TYPE_BOOLEAN, 0)
        driver.controls += [wide, strobe]
        cameras = port(driver, controls={"pixel_rate": 2**40, "strobe_output": True})
        cameras.open().close()
        assert (wide.value, strobe.value, cameras.complaints) == (2**40, 1, ())

    def test_a_device_that_leaves_meanwhile_is_gone(self, driver: FakeDriver) -> None:
        self.gain.refuses = errno.ENODEV
        assert "is gone" in refusal(driver, controls={"gain": 4})
