"""The V4L2 reader against the kernel's own test driver, vivid: formats, controls, crop, faults.

Runs as root where vivid can be loaded: in the guest.
"""

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from cornertouchd.devices.luma import PACKINGS
from cornertouchd.devices.v4l2_camera import V4l2Camera, V4l2CameraPort
from cornertouchd.devices.v4l2_controls import Controls
from cornertouchd.devices.v4l2_device import V4l2Device
from cornertouchd.devices.v4l2_node import DeviceNode
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.ports import CameraError

NODE = "/dev/video40"
WEBCAM, TELEVISION = 0, 1
WIDTH, HEIGHT = 640, 360
STRIP = PictureFormat(WIDTH, HEIGHT, 100, 64)
VIVID = ("n_devs=1", "node_types=0x1", "vid_cap_nr=40", "num_inputs=2", "input_types=0x4")
Opener = Callable[..., V4l2Camera]
RAMP = {"test_pattern": "Gray Ramp", "quantization": "Full Range"}


@pytest.fixture(autouse=True)
def vivid() -> Iterator[None]:
    """Load the driver with a webcam and a television input, still and without text."""
    subprocess.run(
        ["modprobe", "vivid", *VIVID],
        check=True,
    )
    wait_for(Path(NODE).exists)
    choose_input(WEBCAM)
    yield
    wait_for(lambda: subprocess.run(["rmmod", "-s", "vivid"], check=False).returncode == 0)


def wait_for(holds: Callable[[], bool]) -> None:
    """Wait while udev looks at the device, or a test that failed still has it open."""
    until_s = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < until_s
        time.sleep(0.02)


def choose_input(number: int) -> None:
    subprocess.run(
        ["v4l2-ctl", "-d", NODE, "-i", str(number), "-c", "osd_text_mode=2"],
        check=True,
        capture_output=True,
    )


def inject(control: str) -> None:
    subprocess.run(["v4l2-ctl", "-d", NODE, "-c", control], check=True, capture_output=True)


def port(**given: object) -> V4l2CameraPort:
    settings = {"picture_format": STRIP, "rate_hz": 60.0, "now_s": time.monotonic, **given}
    return V4l2CameraPort("C1", NODE, **settings)


@pytest.fixture
def opened() -> Iterator[Opener]:
    """Open cameras; they are closed even when the test fails."""
    with ExitStack() as all_opened:

        def open_one(**given: object) -> V4l2Camera:
            camera = port(**given).open()
            all_opened.callback(camera.close)
            return camera

        yield open_one


@pytest.fixture
def camera(opened: Opener) -> V4l2Camera:
    return opened()


def read(camera: V4l2Camera) -> Frame:
    frame = camera.read(2.0)
    assert frame is not None
    return frame


def read_on(camera: V4l2Camera) -> None:
    for _ in range(10):
        camera.read(1.0)


@pytest.mark.parametrize("name", PACKINGS)
def test_every_format_shows_the_same_ramp(name: str, opened: Opener) -> None:
    node = DeviceNode(NODE)
    has = [one for one, _ in V4l2Device(node).pixel_formats()]
    node.close()
    if name not in has:
        pytest.skip(f"vivid has no {name}")
    camera = opened(pixel_format=name, controls=RAMP)
    assert camera.layout.pixel_format == name
    pixels = read(camera).pixels
    assert pixels.shape == (64, WIDTH)
    ramp = np.arange(WIDTH) * 256.0 / WIDTH
    assert np.abs(pixels - ramp)[:, 8:-8].max() <= 3.0


def test_pictures_have_numbers_and_times_of_their_own(camera: V4l2Camera) -> None:
    frames = [read(camera) for _ in range(20)]
    assert [frame.sequence for frame in frames] == sorted({frame.sequence for frame in frames})
    assert all(abs(time.monotonic() - frame.captured_at_s) < 5.0 for frame in frames)
    assert camera.counts().stream.foreign == 0


def test_a_television_sends_only_the_rows_of_the_strip(opened: Opener) -> None:
    choose_input(TELEVISION)
    node = DeviceNode(NODE)
    area = V4l2Device(node).default_area()
    node.close()
    assert area is not None
    whole = PictureFormat(area.width_px, area.height_px, 0, area.height_px)
    camera = opened(picture_format=whole)
    expected = read(camera).pixels.copy()
    assert camera.layout.height_px == area.height_px
    camera.close()
    camera = opened(picture_format=PictureFormat(area.width_px, area.height_px, 101, 63))
    assert camera.layout.height_px < 80
    assert np.array_equal(read(camera).pixels[:, 40::90], expected[101:164, 40::90])
    camera.close()
    assert opened(picture_format=whole).layout.height_px == area.height_px


def test_an_unknown_size_lists_what_there_is() -> None:
    with pytest.raises(CameraError, match=r"has no 641x360; it has .*GREY 640x360 at 120, 60"):
        port(picture_format=PictureFormat(641, 360, 0, 64)).open()


def test_a_rate_that_is_not_there_is_told() -> None:
    cameras = port(rate_hz=500.0)
    cameras.open().close()
    assert "gives GREY 640x360 at 120 Hz, configured 500 Hz" in cameras.complaints[0]


def test_controls_are_set_and_read_back_at_every_opening() -> None:
    wanted = {"brightness": 100, "boolean": True, "menu": "menu item 4", "integer_64_bits": 2**40}
    cameras = port(controls=wanted)
    for _ in range(2):
        inject("brightness=7")
        cameras.open().close()
        assert cameras.complaints == ()
        node = DeviceNode(NODE)
        controls = Controls(node)
        now = {name: controls.read(controls.by_name[name]) for name in wanted}
        automatic = controls.read(controls.by_name["gain_automatic"])
        node.close()
        assert now == {"brightness": 100, "boolean": 1, "menu": 4, "integer_64_bits": 2**40}
        assert automatic == 0


def test_controls_that_cannot_be_are_explained() -> None:
    wanted = {
        "brightnes": 1,
        "contrast": 999,
        "menu": 2,
        "string": 1,
        "read_only_integer_32_bits": 1,
    }
    cameras = port(controls=wanted)
    cameras.open().close()
    told = dict(
        complaint.removeprefix("control ").split(" = ", 1) for complaint in cameras.complaints
    )
    assert "the camera has no such control; did you mean brightness?" in told["brightnes"]
    assert "it takes 0 to 255" in told["contrast"]
    assert 'it takes 1 "Menu Item 1", 3 "Menu Item 3"' in told["menu"]
    for unsettable in ("string", "read_only_integer_32_bits"):
        assert "the driver lets nobody set it; remove it" in told[unsettable]


def test_damaged_pictures_are_left_out(camera: V4l2Camera) -> None:
    read(camera)
    inject("inject_v4l2_buf_flag_error=1")
    for _ in range(10):
        read(camera)
    assert camera.counts().marked_bad == 1


def test_lost_pictures_are_counted(camera: V4l2Camera) -> None:
    inject("percentage_of_dropped_buffers=60")
    for _ in range(15):
        read(camera)
    inject("percentage_of_dropped_buffers=0")
    assert camera.counts().stream.lost > 3


def test_numbers_that_wrap_around_go_on(camera: V4l2Camera) -> None:
    inject("wrap_sequence_number=1")
    numbers = [read(camera).sequence for _ in range(150)]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] - numbers[0] < 1000


def test_a_stall_is_a_timeout_and_ends_by_itself(camera: V4l2Camera) -> None:
    read(camera)
    inject("percentage_of_dropped_buffers=100")
    camera.read(0.2)  # one may be under way
    before_s = time.monotonic()
    assert camera.read(0.3) is None
    assert 0.25 < time.monotonic() - before_s < 5.0
    inject("percentage_of_dropped_buffers=0")
    read(camera)


def test_a_fatal_error_ends_the_stream_and_opening_anew_helps(opened: Opener) -> None:
    camera = opened()
    read(camera)
    inject("inject_fatal_streaming_error=1")
    with pytest.raises(CameraError, match="stopped with EIO"):
        read_on(camera)
    camera.close()
    read(opened())


@pytest.mark.parametrize("fault", ["inject_vidioc_streamon_error", "inject_vidioc_reqbufs_error"])
def test_a_failed_start_gives_the_device_back(fault: str, opened: Opener) -> None:
    inject(f"{fault}=1")
    with pytest.raises(CameraError, match="refuses 640x360 at 60 Hz: EINVAL"):
        port().open()
    camera = opened()
    read(camera)


def test_a_disconnected_device_is_gone(opened: Opener) -> None:
    camera = opened()
    read(camera)
    inject("disconnect=1")
    with pytest.raises(CameraError, match=f"{NODE} is gone"):
        read_on(camera)
    camera.close()
    read(opened())  # vivid is there again when its last user has left


def test_a_second_reader_is_told_who_holds_it(camera: V4l2Camera) -> None:
    holder = subprocess.Popen(["v4l2-ctl", "-d", NODE, "--sleep", "60"], stdout=subprocess.DEVNULL)
    try:
        with pytest.raises(CameraError, match="is held by another program") as refused:
            port().open()
        assert f"v4l2-ctl, process {holder.pid}" in refused.value.reason
    finally:
        holder.kill()
        holder.wait()


def test_pixels_in_hand_do_not_keep_the_device_busy(opened: Opener) -> None:
    camera = opened()
    frame = read(camera)
    camera.close()
    read(opened())
    assert frame.pixels.shape == (64, WIDTH)
