"""Udev rules: lasting names for the cameras of a rig, and the right to reset them."""

from collections.abc import Iterator, Mapping

from cornertouchd.devices.camera_places import CameraPlace

RULES_FILE = "/etc/udev/rules.d/70-cornertouchd-cameras.rules"
"""After 60-persistent-v4l.rules, which finds out ID_PATH."""

INDEX_ENDING = "-video-index0"

INTRODUCTION = f"""\
# The cameras of cornertouchd, by the USB ports that they are plugged into.
# Written by `cornertouchd cameras --udev-rules`. Install it as
#   {RULES_FILE}
# and let it take effect:
#   udevadm control --reload && udevadm trigger --action=add --settle
"""


def render_rules(bound: Mapping[str, CameraPlace]) -> str:
    """Return the rules for cameras, by the names of their corners."""
    return "\n".join([INTRODUCTION, *_names(bound), "", *_rights(bound)]) + "\n"


def _names(bound: Mapping[str, CameraPlace]) -> Iterator[str]:
    id_paths = [id_path(place) for place in bound.values()]
    for camera, place in bound.items():
        where = f" at port {place.usb.port}" if place.usb else ""
        yield f"# {camera}: {place.name}{where}"
        # Two buses of one controller may have ports of the same number; then ID_PATH is the same.
        unique = bool(id_path(place)) and id_paths.count(id_path(place)) == 1
        match = f'ENV{{ID_PATH}}=="{id_path(place)}"' if unique else _by_port(place)
        yield (
            f'SUBSYSTEM=="video4linux", KERNEL=="video*", ATTR{{index}}=="0", {match}, '
            f'SYMLINK+="cornertouch/{camera.lower()}"'
        )


def _by_port(place: CameraPlace) -> str:
    if place.usb is None:
        return f'KERNEL=="{place.node.removeprefix("/dev/")}"'
    interface = f"{place.usb.port}:{place.usb.interface}"
    return f'SUBSYSTEMS=="usb", KERNELS=="{interface}"'


def _rights(bound: Mapping[str, CameraPlace]) -> Iterator[str]:
    kinds = sorted({place.usb.kind for place in bound.values() if place.usb is not None})
    if kinds:
        yield "# They are never sent to sleep; group video, to which the daemon belongs, may reset"
        yield "# them."
    for kind in kinds:
        vendor, _, product = kind.partition(":")
        yield (
            f'ACTION!="remove", SUBSYSTEM=="usb", ENV{{DEVTYPE}}=="usb_device", '
            f'ATTR{{idVendor}}=="{vendor}", ATTR{{idProduct}}=="{product}", '
            'ATTR{power/control}="on", GROUP="video", MODE="0664", '
            'RUN+="/bin/chgrp video $sys$devpath/authorized", '
            'RUN+="/bin/chmod g+w $sys$devpath/authorized"'
        )


def id_path(place: CameraPlace) -> str:
    """Return the place as udev names it, empty where udev has not."""
    return place.by_path.removesuffix(INDEX_ENDING)
