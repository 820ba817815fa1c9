"""All simulated cameras of a rig, in one process: they show the same picture at the same time.

Started by `rig.UvcRig` with a JSON object as its argument.  Commands come as lines on stdin, a
camera's name and what it is to do; each is answered by a line on stdout: "ok", or what went wrong.
"standstills" is answered by the times, as pairs, between which all cameras stood still; "all show
FIRST COUNT" lets all cameras show these pictures only.
On a machine that cannot follow, all cameras leave out the same pictures, as triggered ones do.
"""

import json
import os
import select
import sys
import time
from pathlib import Path

from uvc.camera import UvcCamera
from uvc.descriptors import CameraKind
from uvc.pictures import PictureLoop

STANDSTILL_S = 0.1
"""Longer between two turns, and no camera sent anything: the machine was busy, or its kernel with a
plug."""
NICE = 5
"""Cameras of their own would not take the daemon's processor."""


def main() -> None:
    """Serve until stdin ends."""
    os.nice(NICE)
    given = json.loads(sys.argv[1])
    rate_hz, start_s = given["rate_hz"], given["start_s"]
    cameras = {
        name: _camera(one["serial"], Path(one["pictures"]), rate_hz)
        for name, one in given["cameras"].items()
    }
    typed, shown = b"", -1
    standstills: list[tuple[float, float]] = []
    before_s = time.monotonic()
    while True:
        now_s = time.monotonic()
        if now_s - before_s > STANDSTILL_S:
            standstills.append((before_s, now_s))
        before_s = now_s
        number = int((now_s - start_s) * rate_hz)
        if number > shown:
            shown = number
            for camera in cameras.values():
                camera.show(number)
            for camera in cameras.values():
                camera.go_on()
            for camera in cameras.values():
                camera.prepare(number + 1)
        linked = {camera.link: camera for camera in cameras.values() if camera.link is not None}
        wait_s = max(0.0, start_s + (shown + 1) / rate_hz - time.monotonic())
        for ready in select.select([0, *linked], [], [], wait_s)[0]:
            if ready == 0:
                read = os.read(0, 4096)
                if not read:
                    for camera in cameras.values():
                        camera.unplug()
                    return
                *lines, typed = (typed + read).split(b"\n")
                for line in lines:
                    asked = line == b"standstills"
                    answer = json.dumps(standstills) if asked else _obey(cameras, line.decode())
                    print(answer, flush=True)
            else:
                linked[ready].receive()


def _camera(serial: str, pictures: Path, rate_hz: float) -> UvcCamera:
    loop = PictureLoop(pictures)
    return UvcCamera(CameraKind(serial, *loop.size_px, (rate_hz, rate_hz / 2)), loop)


def _obey(cameras: dict[str, UvcCamera], line: str) -> str:
    name, _, command = line.partition(" ")
    if name == "all":
        _, first, count = command.split()
        for camera in cameras.values():
            camera.loop.show_only(int(first), int(count))
        return "ok"
    try:
        return cameras[name].obey(command)
    except OSError as error:
        return str(error)


if __name__ == "__main__":
    main()
