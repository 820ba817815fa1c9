"""Whether two identities are of the same camera."""

import re

_USB = re.compile(r"usb (?P<kind>\S+?)(?: serial (?P<serial>.*?))?(?: at port (?P<port>\S+))?")


def same_camera(one: str, other: str) -> bool:
    """Tell whether two identities may be of one camera; an empty one is not known, and may be.

    Where both tell a serial number, it decides; else the port, as with cameras that are all
    numbered alike: one that is plugged in alone tells its number, for there is no other like it.
    """
    if not one or not other or one == other:
        return True
    first, second = _USB.fullmatch(one), _USB.fullmatch(other)
    if first is None or second is None or first["kind"] != second["kind"]:
        return False
    if first["serial"] and second["serial"]:
        return first["serial"] == second["serial"]
    return first["port"] is not None and first["port"] == second["port"]
