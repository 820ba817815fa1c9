"""Where cameras are plugged in, and the lasting names by which they are bound to corners.

Video nodes are numbered in the order in which cameras appear; the port a camera hangs on stays.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.devices.usb_sysfs import (
    SYSFS,
    read_attribute,
    read_number,
    usb_device_above,
    usb_device_at,
    usb_kind,
)
from cornertouchd.errors import ReportedError

DEV = Path("/dev")
PORT_PREFIX, SERIAL_PREFIX = "port:", "serial:"


class PlaceError(ReportedError):
    """No camera, or more than one, answers to the name of a device."""


@dataclass(frozen=True, slots=True)
class UsbPlace:
    """How a camera hangs on USB.

    `port` is the path through the hubs, bus and ports, such as 1-2.3; `interface` tells several
    cameras in one housing apart.  `kind` is vendor:product; `serial` is empty where there is none.
    `device_number` is given anew whenever something is plugged in.  `directory` is the device in
    sysfs.
    """

    port: str
    interface: str
    kind: str
    serial: str
    bus: int
    device_number: int
    root_hub: str
    speed_mbit_s: float
    directory: Path


@dataclass(frozen=True, slots=True)
class CameraPlace:
    """A video node that cameras give their pictures at; `usb` is None for other connections.

    `by_path` is the name that udev gives the place, empty without udev.
    """

    node: str
    name: str
    driver: str
    by_path: str
    usb: UsbPlace | None


def camera_places(sysfs: Path = SYSFS, dev: Path = DEV) -> tuple[CameraPlace, ...]:
    """Return the cameras that are plugged in, in the order of their nodes.

    Drivers make further nodes for a camera, for metadata or output; the first is for pictures.
    """
    names = _names_by_path(dev)
    nodes = sorted(_picture_nodes(sysfs), key=lambda node: int(node.name.removeprefix("video")))
    return tuple(_place(node, names.get(node.name, "")) for node in nodes)


def bus_mates(place: CameraPlace, places: Sequence[CameraPlace]) -> tuple[CameraPlace, ...]:
    """Return the other cameras that share the bandwidth of a camera's bus."""
    if place.usb is None:
        return ()
    return tuple(
        other
        for other in places
        if other.usb is not None and other.usb.bus == place.usb.bus and other.node != place.node
    )


def device_path(device: str, sysfs: Path = SYSFS) -> str:
    """Return the node of a camera at this moment.

    `device` is a path, returned as it is, or port:1-2.3 (port:1-2.3:1.0 for one of several cameras
    in a housing), or serial:NUMBER.  Raises `PlaceError` if no camera or several answer to it.
    """
    if device.startswith(PORT_PREFIX):
        return _node_at_port(device.removeprefix(PORT_PREFIX), sysfs)
    if device.startswith(SERIAL_PREFIX):
        return _node_of_serial(device.removeprefix(SERIAL_PREFIX), sysfs)
    return device


def _node_at_port(given: str, sysfs: Path) -> str:
    port, _, interface = given.partition(":")
    usb_device = usb_device_at(port, sysfs)
    if usb_device is None:
        raise PlaceError(f"no camera at USB port {given}; is it plugged in?")
    nodes = _nodes_of(usb_device)
    found = [node for node in nodes if interface in {"", _interface_of(node)}]
    if not found:
        raise PlaceError(
            f"what is plugged in at USB port {port} ({usb_kind(usb_device)}) gives no pictures; "
            "`cornertouchd cameras` shows where cameras are"
        )
    if len(found) > 1:
        choices = ", ".join(f"port:{port}:{_interface_of(node)}" for node in found)
        raise PlaceError(f"USB port {port} has {len(found)} cameras; choose one of {choices}")
    return f"/dev/{found[0].name}"


def _node_of_serial(serial: str, sysfs: Path) -> str:
    found = [
        (node.name, usb_device.name)
        for usb_device in (sysfs / "bus" / "usb" / "devices").glob("*")
        if read_attribute(usb_device / "serial") == serial
        for node in _nodes_of(usb_device)
    ]
    if not found:
        raise PlaceError(f"no camera has the serial number {serial}; is it plugged in?")
    if len(found) > 1:
        twins = ", ".join(f"port:{port} (/dev/{name})" for name, port in sorted(found))
        raise PlaceError(
            f"{len(found)} cameras have the serial number {serial}; name the camera by its port "
            f"instead, one of {twins}"
        )
    return f"/dev/{found[0][0]}"


def _nodes_of(usb_device: Path) -> list[Path]:
    """Return the nodes for pictures of one USB device, in order of their interfaces."""
    nodes = sorted(usb_device.resolve().glob("*:*/video4linux/video*"))
    return [node for node in nodes if read_attribute(node / "index") == "0"]


def _interface_of(node: Path) -> str:
    return (node / "device").resolve().name.partition(":")[2]


def _picture_nodes(sysfs: Path) -> Iterator[Path]:
    directory = sysfs / "class" / "video4linux"
    if not directory.is_dir():
        return
    for node in directory.iterdir():
        if re.fullmatch(r"video\d+", node.name) and read_attribute(node / "index") == "0":
            yield node


def _names_by_path(dev: Path) -> dict[str, str]:
    directory = dev / "v4l" / "by-path"
    links = sorted(directory.iterdir(), reverse=True) if directory.is_dir() else []
    # Newer versions of udev give two names; the shorter one, first in order, is on all machines.
    return {link.resolve().name: link.name for link in links}


def _place(node: Path, by_path: str) -> CameraPlace:
    usb_device = usb_device_above(node)
    return CameraPlace(
        f"/dev/{node.name}",
        read_attribute(node / "name"),
        (node / "device" / "driver").resolve().name
        if (node / "device" / "driver").exists()
        else "",
        by_path,
        None if usb_device is None else _usb_place(usb_device, (node / "device").resolve()),
    )


def _usb_place(usb_device: Path, interface: Path) -> UsbPlace:
    return UsbPlace(
        usb_device.name,
        interface.name.partition(":")[2],
        usb_kind(usb_device),
        read_attribute(usb_device / "serial"),
        int(read_number(usb_device / "busnum")),
        int(read_number(usb_device / "devnum")),
        next((above.name for above in usb_device.parents if above.name.startswith("usb")), ""),
        read_number(usb_device / "speed"),
        usb_device,
    )
