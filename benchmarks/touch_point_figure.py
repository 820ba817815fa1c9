"""The pictures of docs/touch-point.md, made from a simulated rig.

    python benchmarks/touch_point_figure.py [--into docs]

Needs matplotlib.  Writes touch-point-strip.png (what a camera sees), touch-point-hourglass.png (a
touching finger, a hovering one, and their traced edges) and touch-point-fit.png (a finger from the
side and from above, as it is and as it is reported).
"""

from collections.abc import Sequence
from dataclasses import replace
from math import cos, degrees, pi, radians, sin
from pathlib import Path

import click
import numpy as np
from leaning_fingers import KINDS, CalibratedRig, calibrated_rig, contact_of
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from cornertouchd.config import Settings
from cornertouchd.fusion.capsule_fit import PRESSED_MM
from cornertouchd.model import Contact, FloatArray, Outlines, Picture
from cornertouchd.pipeline import SurfacePipeline
from cornertouchd.simulation.fingers import Finger
from cornertouchd.vision.strip import Strip, find_strip

SEED = 1
CAMERA = "C1"
FINGER = Finger(150.0, 130.0, 11.0, lean_rad=radians(38.0), lean_azimuth_rad=2.2)
HOVER_MM = 1.5
BESIDE_PX = 26
ABOVE_PX = 10
DOTS_PER_INCH = 90


def rows_of(strip: Strip) -> dict[str, tuple[FloatArray, str]]:
    """Return the lines that are found in an empty picture, with their colours."""
    return {
        "upper end": (strip.top_px, "tab:cyan"),
        "horizon": (strip.horizon_px, "tab:green"),
        "surface line, z = 0": (strip.surface_px, "tab:red"),
        "end of the mirror image": (strip.bottom_px, "tab:orange"),
    }


def show(axes: Axes, picture: Picture) -> None:
    """Show a picture so that pixel k reaches from k to k + 1."""
    rows, columns = picture.shape
    axes.imshow(picture, cmap="gray", vmin=0, vmax=230, extent=(0, columns, rows, 0), aspect="auto")


def draw_strip(calibrated: CalibratedRig, file: Path) -> None:
    """Draw a whole picture, and below it the same with the lines that are found in it."""
    picture = calibrated.rig.render(CAMERA, 0, [FINGER])
    strip = find_strip(calibrated.calibration.camera(CAMERA).empty)
    figure, (plain, marked) = plt.subplots(2, 1, figsize=(11, 4.4), sharex=True)
    for axes in (plain, marked):
        show(axes, picture)
        axes.set_ylabel("row")
    columns = np.arange(picture.shape[1]) + 0.5
    for name, (rows_px, colour) in rows_of(strip).items():
        seen = np.where(strip.visible, rows_px, np.nan)
        marked.plot(columns, seen, color=colour, linewidth=1.2, label=name)
    marked.legend(loc="lower center", ncols=4, fontsize="small", framealpha=0.8)
    plain.set_title(f"camera {CAMERA}: strip, surface line, mirror image, a finger", fontsize=10)
    marked.set_xlabel("column")
    save(figure, file)


def draw_hourglass(calibrated: CalibratedRig, file: Path) -> None:
    """Draw a finger that touches, one that hovers, and the edges traced in both."""
    figure, all_axes = plt.subplots(1, 4, figsize=(11, 3.9), sharey=True)
    strip = find_strip(calibrated.calibration.camera(CAMERA).empty)
    column_px = calibrated.rig.truth.cameras[CAMERA].column_of(FINGER.x_mm, FINGER.y_mm)
    middle = int(column_px)
    for pair, (name, height_mm) in zip(
        (all_axes[:2], all_axes[2:]),
        (("touches", 0.0), (f"hovers {HOVER_MM:g} mm high", HOVER_MM)),
        strict=True,
    ):
        finger = replace(FINGER, height_mm=height_mm)
        picture = calibrated.rig.render(CAMERA, 1, [finger])
        for axes in pair:
            show(axes, picture)
            axes.set(
                xlim=(middle - BESIDE_PX, middle + BESIDE_PX),
                ylim=(
                    strip.bottom_px[middle] + ABOVE_PX / 2,
                    strip.top_px[middle] - ABOVE_PX / 2,
                ),
                title=name,
            )
        draw_outlines(pair[1], outlines_of(calibrated, finger))
        for title, (rows_px, colour) in rows_of(strip).items():
            if title.startswith(("horizon", "surface")):
                columns = np.arange(len(rows_px)) + 0.5
                pair[1].plot(columns, rows_px, color=colour, linewidth=1, label=title)
    all_axes[1].legend(loc="lower left", fontsize="x-small", framealpha=0.8)
    save(figure, file)


def outlines_of(calibrated: CalibratedRig, finger: Finger) -> Outlines:
    """Return the edges that the camera traces."""
    for seen in calibrated.observe(1, finger).observations:
        if seen.camera == CAMERA and seen.outlines is not None:
            return seen.outlines
    raise SystemExit(f"camera {CAMERA} traces no edges of the finger")


def draw_outlines(axes: Axes, outlines: Outlines) -> None:
    """Mark where traced edges meet the levels."""
    axes.plot(
        outlines.columns_px.ravel(),
        outlines.rows_px.ravel(),
        "o",
        markersize=4,
        markerfacecolor="none",
        color="yellow",
        label="traced edges",
    )


def draw_fit(calibrated: CalibratedRig, file: Path) -> None:
    """Draw the finger from the side, as it is and as it is fitted, and from above."""
    surface = SurfacePipeline(calibrated.calibration, Settings())
    contact = contact_of(surface, calibrated.observe(1, FINGER), FINGER)
    if contact is None or contact.lean is None:
        raise SystemExit("the finger has no touch point")
    figure, (side, above) = plt.subplots(1, 2, figsize=(11, 4.4))
    draw_side(side, contact, calibrated)
    draw_above(above, contact, calibrated)
    save(figure, file)


def outline_from_side(
    tip_mm: float, radius_mm: float, lean_rad: float, along_mm: float
) -> FloatArray:
    """Return places (2, N) on the outline of a finger whose tip's centre is `tip_mm` high."""
    ahead = np.array([sin(lean_rad), cos(lean_rad)])
    across = np.array([cos(lean_rad), -sin(lean_rad)])
    centre = np.array([0.0, tip_mm])
    turn = np.linspace(0.0, pi, 60)
    tip = centre + radius_mm * (np.outer(np.cos(turn), across) - np.outer(np.sin(turn), ahead))
    right, left = (centre + along_mm * ahead + side * radius_mm * across for side in (1.0, -1.0))
    return np.vstack([right, tip, left]).T


def draw_side(axes: Axes, contact: Contact, calibrated: CalibratedRig) -> None:
    """Draw the true finger, grey, and the reported one, red, in the plane of the true lean.

    A report has no shape: the red one is a capsule, flattened as fingers usually are.
    """
    assert contact.lean is not None
    radius_mm = FINGER.diameter_mm / 2.0
    truth = outline_from_side(FINGER.tip_height_mm, radius_mm, FINGER.lean_rad, 18.0)
    reported = outline_from_side(
        contact.diameter_mm / 2.0 - PRESSED_MM,
        contact.diameter_mm / 2.0,
        contact.lean.angle_rad,
        18.0,
    )
    along = (contact.x_mm - FINGER.x_mm) * cos(FINGER.lean_azimuth_rad) + (
        contact.y_mm - FINGER.y_mm
    ) * sin(FINGER.lean_azimuth_rad)
    for sign in (1.0, -1.0):
        axes.fill(truth[0], sign * truth[1], color="0.8" if sign > 0 else "0.92")
        axes.plot(reported[0] + along, sign * reported[1], color="tab:red", linewidth=1)
    height_mm = float(np.mean([one.height_mm for one in calibrated.rig.truth.cameras.values()]))
    for z_mm, name, colour in (
        (height_mm, "height of the cameras", "tab:green"),
        (0.0, "screen, z = 0", "tab:red"),
    ):
        axes.axhline(z_mm, color=colour, linewidth=0.8, linestyle="--")
        axes.text(-17.5, z_mm + 0.3, name, fontsize="small", color=colour)
    section = calibrated.rig.truth.section(FINGER)
    if section is not None:
        off_mm = np.hypot(section.x_mm - FINGER.x_mm, section.y_mm - FINGER.y_mm)
        axes.plot(
            off_mm,
            height_mm,
            "x",
            color="tab:green",
            label=f"section, {off_mm:.2f} mm beside the tip",
        )
    axes.plot(along, 0.0, "o", color="tab:red", markersize=5, label="touch point")
    axes.legend(loc="lower right", fontsize="small")
    axes.set(
        title=f"from the side: leans {degrees(FINGER.lean_rad):.0f}°, "
        f"found {degrees(contact.lean.angle_rad):.1f}°",
        xlabel="along the lean, mm",
        ylabel="z, mm (below 0: mirror image)",
        xlim=(-18, 22),
        ylim=(-15, 15),
        aspect="equal",
    )


def draw_above(axes: Axes, contact: Contact, calibrated: CalibratedRig) -> None:
    """Draw the places from above, relative to the true one, with the direction of the lean."""
    assert contact.lean is not None
    section = calibrated.rig.truth.section(FINGER)
    places: Sequence[tuple[str, float, float, str, str]] = [
        ("true place of the tip", FINGER.x_mm, FINGER.y_mm, "+", "black"),
        ("touch point", contact.x_mm, contact.y_mm, "o", "tab:red"),
        ("section found", *contact.section_mm, "x", "tab:green"),
    ]
    if section is not None:
        places = [*places, ("true section", section.x_mm, section.y_mm, "+", "tab:olive")]
    for name, x_mm, y_mm, marker, colour in places:
        off = f"{x_mm - FINGER.x_mm:+.2f}, {y_mm - FINGER.y_mm:+.2f} mm"
        axes.plot(
            x_mm - FINGER.x_mm, y_mm - FINGER.y_mm, marker, color=colour, label=f"{name}: {off}"
        )
    for name, azimuth_rad, colour in (
        ("true lean", FINGER.lean_azimuth_rad, "0.6"),
        ("found", contact.lean.azimuth_rad, "tab:red"),
    ):
        axes.annotate(
            "",
            (1.9 * cos(azimuth_rad), 1.9 * sin(azimuth_rad)),
            (0.0, 0.0),
            arrowprops={"arrowstyle": "->", "color": colour},
        )
        axes.plot([], [], color=colour, label=f"{name}: azimuth {degrees(azimuth_rad):.1f}°")
    axes.add_patch(
        plt.Circle(
            (contact.x_mm - FINGER.x_mm, contact.y_mm - FINGER.y_mm),
            contact.sigma_mm,
            fill=False,
            color="tab:red",
            linewidth=0.8,
        )
    )
    axes.legend(loc="upper right", fontsize="small")
    axes.set(
        title=f"from above, circle: sigma_mm {contact.sigma_mm:.2f}",
        xlabel="x, mm",
        ylabel="y, mm (down)",
        xlim=(-2.5, 2.5),
        ylim=(2.5, -2.5),
        aspect="equal",
    )


def save(figure: plt.Figure, file: Path) -> None:
    """Write a figure, the same bytes every time."""
    figure.tight_layout()
    figure.savefig(file, dpi=DOTS_PER_INCH, metadata={"Software": None})
    plt.close(figure)
    print(file)


@click.command(help=__doc__)
@click.option("--into", default=Path("docs"), type=click.Path(path_type=Path, exists=True))
def main(into: Path) -> None:
    calibrated = calibrated_rig(KINDS[0], SEED, 0.0)
    draw_strip(calibrated, into / "touch-point-strip.png")
    draw_hourglass(calibrated, into / "touch-point-hourglass.png")
    draw_fit(calibrated, into / "touch-point-fit.png")


if __name__ == "__main__":
    main()
