"""How long a simulated picture takes: run `python benchmarks/simulation.py`.

The baseline is what any source of pictures must do at the least: copy one.
"""

import timeit
from collections.abc import Callable

from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import demo_script

PICTURES = 300
ROUNDS = 5


def milliseconds(action: Callable[[], object], times: int) -> float:
    """Return the time of one call in the best of some rounds, which others disturbed least."""
    return min(timeit.repeat(action, number=times, repeat=ROUNDS)) / times * 1e3


def fingers_of(rig: SimulatedRig, touches: int) -> list[list[Finger]]:
    """Return the fingers of as many instants of the show as pictures are measured."""
    script = demo_script(rig.surface_mm, touches)
    return [[each.finger for each in script(index / 10.0)] for index in range(PICTURES)]


def measure(name: str, rig: SimulatedRig) -> None:
    """Print a line for each number of fingers."""
    picture = rig.render("C1", 0, ())
    copy_ms = milliseconds(picture.copy, 2000)
    print(f"{name}: a copy of the picture takes {copy_ms:.4f} ms")
    for touches in (0, 1, 5, 10, 20):
        shown = fingers_of(rig, touches)

        def render_all(shown: list[list[Finger]] = shown) -> None:
            for index, fingers in enumerate(shown):
                rig.render(f"C{1 + index % 4}", index, fingers)

        picture_ms = milliseconds(render_all, 1) / PICTURES
        print(
            f"  {touches:2d} fingers: {picture_ms:.3f} ms a picture ({picture_ms / copy_ms:.0f} "
            f"copies); four cameras at 100 Hz take {picture_ms * 40.0:.0f} % of a core"
        )


def main() -> None:
    print(f"best of {ROUNDS} rounds of {PICTURES} pictures, one core")
    measure("350 x 400 mm, 640x64 px", SimulatedRig())
    measure("2400 x 1350 mm, 1280x64 px", SimulatedRig((2400.0, 1350.0), 1280, 800))


if __name__ == "__main__":
    main()
