"""Cameras are found, named and brought back on the kernel's own USB and video drivers.

Runs in the guest of tests/system, as root.
"""

import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from uvc.rig import UvcRig, device, serial, wait_for

from cornertouchd.config import CameraSettings, CamerasSettings
from cornertouchd.devices.camera_abilities import look_at_node
from cornertouchd.devices.camera_places import PlaceError, bus_mates, camera_places, device_path
from cornertouchd.devices.camera_plug import DevicePlug
from cornertouchd.devices.camera_survey import survey_cameras
from cornertouchd.devices.udev_rules import render_rules
from cornertouchd.devices.usb_bandwidth import streaming_of
from cornertouchd.devices.usb_sysfs import usb_device_at
from cornertouchd.devices.v4l2_camera import V4l2CameraPort
from cornertouchd.model import PictureFormat
from cornertouchd.ports import CameraError
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.recovery import Recovery, may_be_cured_by_reset

CAMERAS = ("C1", "C2", "C3", "C4")
RATE_HZ = 60.0
BACK_S = 2.0
"""A camera that is plugged in again is in service within this time of its node."""
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[UvcRig]:
    folder = tmp_path_factory.mktemp("pictures")
    pictures = {}
    for number, camera in enumerate(CAMERAS):
        pictures[camera] = folder / f"{camera}.npy"
        np.save(pictures[camera], np.full((4, 120, 640), 50 * (number + 1), np.uint8))
    with UvcRig(pictures, RATE_HZ) as rig:
        yield rig


def usb_port(camera: str) -> str:
    node = device(camera).resolve()
    return next(
        place.usb.port for place in camera_places() if place.usb and place.node == str(node)
    )


def inode(camera: str) -> int:
    """Return what changes when the driver makes the node anew."""
    return (Path("/sys/class/video4linux") / device(camera).resolve().name).resolve().stat().st_ino


def wait_until_new(camera: str, before: int) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not device(camera).exists() or inode(camera) == before:
        assert time.monotonic() < until_s, f"{camera} did not come back"
        time.sleep(0.02)
    subprocess.run(["udevadm", "settle"], check=True)


def test_cameras_are_listed_once_with_port_serial_and_bus(rig: UvcRig) -> None:
    places = [place for place in camera_places() if place.usb is not None]
    assert {place.node for place in places} == {str(device(c).resolve()) for c in CAMERAS}
    assert {place.usb.serial for place in places if place.usb} == {serial(c) for c in CAMERAS}
    assert len({place.usb.port for place in places if place.usb}) == 4
    for place in places:
        assert place.driver == "uvcvideo"
        assert place.by_path.endswith("-video-index0")
        assert Path("/dev/v4l/by-path", place.by_path).resolve() == Path(place.node)
        assert len(bus_mates(place, places)) == 3
        assert place.usb is not None
        assert place.usb.speed_mbit_s >= 5000.0
        assert streaming_of(place.usb.directory).packet_bytes == ()  # they send in bulk


def test_ports_and_serial_numbers_lead_to_the_nodes(rig: UvcRig) -> None:
    for camera in CAMERAS:
        node = str(device(camera).resolve())
        assert device_path(f"serial:{serial(camera)}") == node
        assert device_path(f"port:{usb_port(camera)}") == node
    with pytest.raises(PlaceError, match="no camera at USB port 9-9"):
        device_path("port:9-9")


def test_the_survey_tells_modes_and_bandwidth(rig: UvcRig) -> None:
    units = {c: CameraSettings(device=f"port:{usb_port(c)}") for c in CAMERAS}
    settings = CamerasSettings(width_px=640, height_px=120, rate_hz=RATE_HZ, units=units)
    survey = survey_cameras(settings, lambda node: look_at_node(node, "auto", (640, 120), RATE_HZ))
    assert survey.missing == {}
    assert tuple(survey.bound) == CAMERAS
    assert {camera.abilities.pixel_format for camera in survey.cameras} == {"GREY"}
    assert all("GREY 640x120 at" in camera.abilities.modes[0] for camera in survey.cameras)
    (load,) = survey.loads
    assert load.fits
    assert load.bytes_s == pytest.approx(4 * 640 * 120 * RATE_HZ)


def test_udev_gives_the_names_and_rights_that_the_rules_say(rig: UvcRig) -> None:
    nodes = {place.node: place for place in camera_places()}
    bound = {camera: nodes[str(device(camera).resolve())] for camera in CAMERAS}
    rules = Path("/run/udev/rules.d/70-cornertouchd-cameras.rules")
    rules.parent.mkdir(parents=True, exist_ok=True)
    rules.write_text(render_rules(bound))
    subprocess.run(["udevadm", "control", "--reload"], check=True)
    subprocess.run(["udevadm", "trigger", "--action=add", "--settle"], check=True)
    for camera, place in bound.items():
        link = Path("/dev/cornertouch", camera.lower())
        assert str(link.resolve()) == place.node
        assert place.usb is not None
        assert (place.usb.directory / "power" / "control").read_text() == "on\n"
        assert (place.usb.directory / "authorized").stat().st_mode & 0o020
        assert (place.usb.directory / "authorized").group() == "video"
        bus, number = place.usb.bus, place.usb.device_number
        assert Path(f"/dev/bus/usb/{bus:03}/{number:03}").group() == "video"
    rig.unplug("C2")
    rig.plug("C2")
    wait_for(Path("/dev/cornertouch/c2"), exists=True)
    assert Path("/dev/cornertouch/c2").resolve() == device("C2").resolve()


@pytest.mark.parametrize("way", [0, 1], ids=["USB reset", "reauthorization"])
def test_a_reset_makes_the_driver_begin_anew_with_this_camera_only(rig: UvcRig, way: int) -> None:
    before = {camera: inode(camera) for camera in CAMERAS}
    plug = DevicePlug(f"port:{usb_port('C3')}")
    plugged = plug.plugged_in()
    plug.resets[way].apply()
    wait_until_new("C3", before["C3"])
    assert plug.plugged_in() == plugged
    usb_device = usb_device_at(usb_port("C3"))
    assert usb_device is not None
    assert (usb_device / "authorized").read_text() == "1\n"
    assert all(inode(camera) == before[camera] for camera in CAMERAS if camera != "C3")


class Reader:
    """Reads one camera as the capture thread does, and notes when pictures came."""

    def __init__(self, camera: str, settings: CamerasSettings) -> None:
        name = f"serial:{serial(camera)}"
        self._port = V4l2CameraPort(
            camera, name, PictureFormat(640, 120, 0, 120), RATE_HZ, time.monotonic
        )
        self._settings = settings
        self.recovery = Recovery(camera, DevicePlug(name), settings, MonotonicClock())
        self.stop = threading.Event()
        self.pictures = 0
        self.last_s = 0.0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self.stop.is_set():
            before, curable = self.pictures, True
            try:
                self._read()
            except CameraError as error:
                curable = may_be_cured_by_reset(error)
            if not self.stop.is_set():
                self.recovery.wait_to_reopen(
                    worked=self.pictures - before >= 50,
                    reset_may_help=curable,
                    wait=self.stop.wait,
                )

    def _read(self) -> None:
        camera = self._port.open()
        try:
            missed = 0
            while missed < self._settings.failures_before_reopen and not self.stop.is_set():
                if camera.read(self._settings.read_timeout_s) is None:
                    missed += 1
                else:
                    missed, self.pictures, self.last_s = 0, self.pictures + 1, time.monotonic()
        finally:
            camera.close()

    def wait_for_picture_after(self, time_s: float) -> float:
        """Return how long after `time_s` the next picture came."""
        until_s = time.monotonic() + PATIENCE_S
        while self.last_s <= time_s:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        return self.last_s - time_s

    def end(self) -> None:
        self.stop.set()
        self._thread.join(PATIENCE_S)


@pytest.fixture
def reader(rig: UvcRig) -> Iterator[Reader]:
    settings = CamerasSettings(
        read_timeout_s=0.3, failures_before_reopen=2, reopen_delay_s=0.5, reopen_delay_max_s=30.0
    )
    reader = Reader("C4", settings)
    reader.wait_for_picture_after(0.0)
    yield reader
    rig.go("C4")
    reader.end()


def test_a_replugged_camera_is_back_within_two_seconds_of_its_node(
    rig: UvcRig, reader: Reader
) -> None:
    first_port = rig.ports["C4"]
    for pause_s, port in ((0.0, first_port), (6.0, first_port), (0.0, first_port + 4)):
        rig.unplug("C4")
        time.sleep(pause_s)
        rig.plug("C4", port)
        taken_s = reader.wait_for_picture_after(time.monotonic())
        print(f"back {taken_s:.2f} s after its node")
        assert taken_s <= BACK_S
    assert reader.recovery.resets == 0


def test_a_camera_that_stalls_is_reset_by_both_ways_and_recovers(
    rig: UvcRig, reader: Reader
) -> None:
    rig.stall("C4")
    until_s = time.monotonic() + PATIENCE_S
    while reader.recovery.resets < 2:
        assert time.monotonic() < until_s
        time.sleep(0.05)
    rig.go("C4")
    reader.wait_for_picture_after(time.monotonic())
