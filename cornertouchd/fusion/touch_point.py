"""Touch points: where fingers meet the surface, how they lean, and whether they touch at all.

The crossing finds sections: how fingers look at the height of the cameras.  The rows of the strip
and its mirror image tell the rest.  A contact that has too few rows of its own keeps its section,
with the covariance that its unknown lean gives it, so that whoever follows it can weigh both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.rays import SeesHeights, views_of
from cornertouchd.fusion.touch_table import (
    AT_RADIUS,
    AT_X,
    AT_Y,
    AZIMUTH,
    AZIMUTH_SIGMA,
    GAP,
    GAP_CAMERAS,
    LEAN,
    LEAN_SIGMA,
    METHOD,
    MOST_CAMERAS,
    XX,
    YY,
    touch_points,
)
from cornertouchd.model import FloatArray, Outlines


@dataclass(frozen=True, slots=True, eq=False)
class TouchPoints:
    """Where N contacts touch, all arrays (N,) but for `covariances_mm2` (N, 3): xx, xy, yy.

    The finger leans by `lean_rad` from upright towards `azimuth_rad` (from +x towards +y), away
    from the tip; the sigmas are their standard deviations.  `methods` are `SECTION`, `SHAPE_FREE`
    or `CAPSULE`.  `gaps` is the light below the finger in units of what a touching one lets
    through: it hovers above 1; NaN if none of the `gap_cameras` could tell.
    """

    x_mm: FloatArray
    y_mm: FloatArray
    covariances_mm2: FloatArray
    lean_rad: FloatArray
    azimuth_rad: FloatArray
    lean_sigma_rad: FloatArray
    azimuth_sigma_rad: FloatArray
    radii_mm: FloatArray
    methods: IntArray
    gaps: FloatArray
    gap_cameras: IntArray


class TouchPointFinder:
    """Finds the touch points of contacts seen by cameras; keeps nothing from one call to the next.

    `cameras` are the tables of all C cameras of the rig, at most `MOST_CAMERAS`, in a lasting
    order.
    """

    def __init__(self, cameras: Sequence[SeesHeights]) -> None:
        self._views = views_of(cameras)
        self._nothing = [_no_outlines(len(camera.horizon_px)) for camera in cameras]
        self._lacking = [_no_outlines(0)] * (MOST_CAMERAS - len(self._nothing))

    def find(
        self,
        discs: FloatArray,
        sigma_mm: FloatArray,
        owned: IntArray,
        outlines: Sequence[Outlines | None],
    ) -> TouchPoints:
        """Return the touch points of N contacts.

        `discs` (N, 3) are their sections as x, y, r with `sigma_mm` (N,).  `owned` (N, C, 2) is the
        number of the outline in each camera's picture whose left and right edge belong to the
        contact alone, -1 for none.  `outlines` are those of each camera, None for one without a
        picture.  Raises `ValueError` if they are not as wide as the camera's table.
        """
        sections = np.column_stack([discs, sigma_mm]).astype(np.float64)
        return _points_of(self.table(sections, np.ascontiguousarray(owned, np.intp), outlines))

    def table(
        self, sections: FloatArray, owned: IntArray, outlines: Sequence[Outlines | None]
    ) -> FloatArray:
        """Return the same as the table of `touch_points`.

        The columns of `sections` (N, 4 or more) begin with x, y, r and the sigma.
        """
        seen = [
            nothing if one is None else one
            for one, nothing in zip(outlines, self._nothing, strict=True)
        ]
        for number, (one, nothing) in enumerate(zip(seen, self._nothing, strict=True)):
            if len(one.light_at) != len(nothing.light_at):
                raise ValueError(
                    f"outlines of camera {number}: {len(one.light_at)} columns; "
                    f"its table has {len(nothing.light_at)}"
                )
        seen += self._lacking
        return touch_points(
            *self._views,
            tuple([np.ascontiguousarray(one.columns_px) for one in seen]),
            tuple([np.ascontiguousarray(one.rows_px) for one in seen]),
            tuple([np.ascontiguousarray(one.light) for one in seen]),
            tuple([one.light_at for one in seen]),
            tuple([one.light_row_px for one in seen]),
            sections,
            owned,
        )


def _no_outlines(width_px: int) -> Outlines:
    return Outlines(
        np.empty((0, 2, 0)),
        np.empty((0, 2, 0)),
        np.empty((0, 0), np.float32),
        np.full(width_px, -1, np.int32),
        np.zeros(width_px, np.int32),
    )


def _points_of(table: FloatArray) -> TouchPoints:
    return TouchPoints(
        x_mm=table[:, AT_X],
        y_mm=table[:, AT_Y],
        covariances_mm2=table[:, XX : YY + 1],
        lean_rad=table[:, LEAN],
        azimuth_rad=table[:, AZIMUTH],
        lean_sigma_rad=table[:, LEAN_SIGMA],
        azimuth_sigma_rad=table[:, AZIMUTH_SIGMA],
        radii_mm=table[:, AT_RADIUS],
        methods=table[:, METHOD].astype(np.intp),
        gaps=table[:, GAP],
        gap_cameras=table[:, GAP_CAMERAS].astype(np.intp),
    )
