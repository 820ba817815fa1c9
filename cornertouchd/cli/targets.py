"""Words of the command line that stand for values."""

import math
import re

import click

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import CalibrationError


class FiniteRange(click.FloatRange):
    """A number within bounds; not NaN, which is within all of them."""

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number."""
        number = float(super().convert(str(value), param, ctx))  # type: ignore[arg-type]
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


class HostPort(click.ParamType[tuple[str, int]]):
    """`HOST:PORT`, as (host, port)."""

    name = "host:port"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, int]:
        """Return host and port."""
        found = re.fullmatch(r"\[?([!-Z^-~]+?)\]?:(\d{1,5})", str(value))
        if found is None or not 1 <= int(found[2]) <= 65535:
            self.fail(f"{value!r} is not HOST:PORT, such as 127.0.0.1:3333", param, ctx)
        return found[1], int(found[2])


class SetRuns(click.ParamType[tuple[tuple[int, int], ...]]):
    """`0-7,24-27`: runs of frame sets, as ((0, 7), (24, 27))."""

    name = "runs"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[tuple[int, int], ...]:
        """Return first and last frame set of every run, in order."""
        runs = []
        for part in str(value).split(","):
            found = re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part)
            if found is None:
                self.fail(f"{part!r} is not a run of frame sets, such as 0-7", param, ctx)
            runs.append((int(found[1]), int(found[2] or found[1])))
        ends = [end for run in runs for end in run]
        if ends != sorted(ends):
            self.fail(f"{value!r}: runs must follow each other, such as 0-7,24-27", param, ctx)
        return tuple(runs)


class Speed(click.ParamType[float]):
    """A factor above 0, or `max`: as fast as it goes (inf)."""

    name = "speed"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the factor."""
        if value == "max":
            return float("inf")
        try:
            factor = float(str(value))
        except ValueError:
            factor = 0.0
        if not 0.0 < factor <= 1000.0:
            self.fail(f"{value!r} is neither a factor up to 1000 nor max", param, ctx)
        return factor


class Board(click.ParamType[BoardPlan]):
    """`charuco:9x6:29:23` (squares, square and marker in mm) or `checkerboard:9x6:25`."""

    name = "board"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> BoardPlan:
        """Return the plan of the board."""
        if isinstance(value, BoardPlan):
            return value
        found = re.fullmatch(
            r"(checkerboard|charuco):(\d+)x(\d+):(\d+(?:\.\d+)?)(?::(\d+(?:\.\d+)?))?", str(value)
        )
        if found is None or (found[1] == "charuco") != (found[5] is not None):
            self.fail(f"{value!r} is neither charuco:9x6:29:23 nor checkerboard:9x6:25", param, ctx)
        squares = (int(found[2]), int(found[3]))
        try:
            if found[1] == "charuco":
                return BoardPlan("charuco", squares, float(found[4]), float(found[5]))
            return BoardPlan("checkerboard", squares, float(found[4]))
        except CalibrationError as error:
            self.fail(str(error), param, ctx)
