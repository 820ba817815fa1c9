"""What a V4L2 node says of itself, as `cornertouchd cameras` shows it."""

from collections.abc import Callable

from cornertouchd.devices.camera_survey import CameraAbilities
from cornertouchd.devices.v4l2_choice import FormatError, choose_format
from cornertouchd.devices.v4l2_device import V4l2Device
from cornertouchd.devices.v4l2_faults import explain
from cornertouchd.devices.v4l2_node import DeviceNode, Node


def look_at_node(
    device: str,
    pixel_format: str,
    size_px: tuple[int, int],
    rate_hz: float,
    open_node: Callable[[str], Node] = DeviceNode,
) -> CameraAbilities:
    """Ask a node what it can, and what it would use for pictures of this size and rate.

    Nothing is changed, so a camera that is at work may be asked as well.
    """
    wanted = f"{size_px[0]}x{size_px[1]} at {rate_hz:g} Hz"
    try:
        node = open_node(device)
    except OSError as error:
        return CameraAbilities(captures=True, problem=explain(error, device, wanted))
    try:
        return _abilities(V4l2Device(node), pixel_format, size_px, rate_hz)
    except OSError as error:
        return CameraAbilities(captures=True, problem=explain(error, device, wanted))
    finally:
        node.close()


def _abilities(
    device: V4l2Device, pixel_format: str, size_px: tuple[int, int], rate_hz: float
) -> CameraAbilities:
    if not device.capability().captures:
        return CameraAbilities(captures=False)
    modes = sorted(device.modes(), key=lambda mode: not mode.has_size(*size_px))
    told = tuple(str(mode) for mode in modes)
    try:
        chosen = choose_format(device, pixel_format, *size_px, rate_hz)
    except FormatError as error:
        return CameraAbilities(captures=True, modes=told, problem=str(error))
    return CameraAbilities(captures=True, modes=told, pixel_format=chosen)
