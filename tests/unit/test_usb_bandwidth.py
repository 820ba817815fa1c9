"""Whether cameras fit a bus is told before the driver refuses them."""

from pathlib import Path

import pytest
from fake_sysfs import BULK_CAMERA, FakeSysfs, isochronous_camera
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.devices.usb_bandwidth import bus_loads, demand, streaming_of

THREE_TIMES_1024 = 0x1400
TWICE_1024 = 0x0C00


@pytest.fixture
def machine(tmp_path: Path) -> FakeSysfs:
    return FakeSysfs(tmp_path)


def test_the_alternate_settings_are_read_from_the_descriptors(machine: FakeSysfs) -> None:
    camera = isochronous_camera(128, 1024, TWICE_1024, THREE_TIMES_1024)
    device = machine.plug_in("1-1", [0], None, descriptors=camera)
    assert streaming_of(device).packet_bytes == (128, 1024, 2048, 3072)
    bulk = machine.plug_in("1-2", [2], None, descriptors=BULK_CAMERA)
    assert streaming_of(bulk).packet_bytes == ()
    assert streaming_of(machine.root / "nothing").packet_bytes == ()


@given(st.binary(max_size=200), st.integers(0, 200))
def test_damaged_descriptors_are_read_as_far_as_they_go(
    tmp_path_factory: pytest.TempPathFactory, junk: bytes, cut: int
) -> None:
    device = tmp_path_factory.mktemp("device")
    (device / "descriptors").write_bytes(isochronous_camera(128, THREE_TIMES_1024)[:cut] + junk)
    assert all(packet >= 0 for packet in streaming_of(device).packet_bytes)


def loads(machine: FakeSysfs, cameras: int, form: str, size: tuple[int, int], rate_hz: float):  # type: ignore[no-untyped-def]
    devices = [(machine.root / "bus/usb/devices" / f"1-{k + 1}").resolve() for k in range(cameras)]
    return bus_loads(
        [demand(f"/dev/video{k}", device, form, *size, rate_hz) for k, device in enumerate(devices)]
    )


def plug_in_four(machine: FakeSysfs, descriptors: bytes, speed: str = "480") -> None:
    for number in range(4):
        machine.plug_in(f"1-{number + 1}", [2 * number], None, descriptors=descriptors, speed=speed)


FULL_RANGE = isochronous_camera(128, 256, 512, 800, 1024, 0x0B20, TWICE_1024, THREE_TIMES_1024)


def test_four_strips_of_grey_fit_usb_2(machine: FakeSysfs) -> None:
    plug_in_four(machine, FULL_RANGE)
    (load,) = loads(machine, 4, "GREY", (640, 120), 60.0)  # 4.6 MB/s each: 588 bytes, so 800
    assert load.fits
    assert load.share == pytest.approx(4 * (800 * 7 / 6 + 38) / 7500)
    assert load.remedy == ""


def test_two_cameras_that_reserve_the_most_do_not_fit_usb_2(machine: FakeSysfs) -> None:
    plug_in_four(machine, FULL_RANGE)
    (alone,) = loads(machine, 1, "YUYV", (640, 480), 38.0)  # 23.3 MB/s: 2930 bytes, so 3072
    assert alone.fits
    (load,) = loads(machine, 2, "YUYV", (640, 480), 38.0)
    assert not load.fits
    assert "bus 1 (/dev/video0, /dev/video1) need 99% of it, at most 80% are theirs" in load.remedy
    assert "lower cameras.rate_hz" in load.remedy


def test_a_camera_whose_endpoint_is_too_small_does_not_fit_alone(machine: FakeSysfs) -> None:
    plug_in_four(machine, isochronous_camera(512))
    (load,) = loads(machine, 1, "GREY", (640, 480), 60.0)
    assert not load.fits


@pytest.mark.parametrize(
    ("form", "size", "rate_hz", "cameras"),
    [("GREY", (640, 480), 30.0, 4), ("GREY", (640, 480), 60.0, 2), ("YUYV", (640, 480), 60.0, 1)],
)
def test_bulk_cameras_share_what_a_usb_2_bus_carries(
    machine: FakeSysfs, form: str, size: tuple[int, int], rate_hz: float, cameras: int
) -> None:
    plug_in_four(machine, BULK_CAMERA)
    (load,) = loads(machine, cameras, form, size, rate_hz)
    assert load.fits
    assert load.bytes_s == pytest.approx(36.864e6)
    (more,) = loads(machine, cameras, form, size, 1.2 * rate_hz)
    assert not more.fits


def test_usb_3_carries_four_whole_pictures(machine: FakeSysfs) -> None:
    plug_in_four(machine, BULK_CAMERA, speed="5000")
    (load,) = loads(machine, 4, "GREY", (1280, 800), 90.0)  # 369 MB/s
    assert load.fits
    (load,) = loads(machine, 4, "YUYV", (1280, 800), 90.0)
    assert not load.fits


def test_jpeg_takes_less_than_grey(machine: FakeSysfs) -> None:
    plug_in_four(machine, FULL_RANGE)
    (grey,) = loads(machine, 4, "GREY", (640, 480), 60.0)
    (jpeg,) = loads(machine, 4, "MJPG", (640, 480), 60.0)
    assert not grey.fits
    assert jpeg.fits


def test_each_bus_is_counted_by_itself(machine: FakeSysfs) -> None:
    slow = machine.plug_in("1-1", [0], None, descriptors=FULL_RANGE)
    fast = machine.plug_in("2-1", [2], None, descriptors=BULK_CAMERA, speed="5000")
    told = bus_loads(
        [
            demand("/dev/video0", slow, "GREY", 640, 120, 60.0),
            demand("/dev/video2", fast, "GREY", 640, 120, 60.0),
        ]
    )
    assert [(load.bus, load.nodes) for load in told] == [
        (1, ("/dev/video0",)),
        (2, ("/dev/video2",)),
    ]
