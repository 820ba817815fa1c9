"""Boards to print: a page at true size, with a ruler that shows whether the printer kept it."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import CalibrationError

DPI = 300
"""Places are rounded to .04 mm, which does not add up from square to square."""

MM_PER_INCH = 25.4
PAGES_MM = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
MARGIN_MM = 8.0
"""Printers leave 4 to 6 mm of a page white."""

FOOTER_MM = 13.0
RULER_MM, TICK_MM = 100.0, 10.0
TEXT_MM = 3.2
WHITE, BLACK = 1, 0


def print_board(plan: BoardPlan, path: Path) -> None:
    """Write the board as a PDF or PNG, by the suffix of `path`, on the smallest page that holds it.

    Raises `CalibrationError` for another suffix, for a board that no page holds, and when the file
    cannot be written.
    """
    if path.suffix.lower() not in (".pdf", ".png"):
        raise CalibrationError(f"{path}: a board is written as .pdf or .png; name it so")
    name, page_mm = _page_for(plan)
    page = Image.new("1", (_dots(page_mm[0]), _dots(page_mm[1])), WHITE)
    draw = ImageDraw.Draw(page)
    left = (page_mm[0] - plan.size_mm[0]) / 2.0
    top = MARGIN_MM + (page_mm[1] - 2.0 * MARGIN_MM - FOOTER_MM - plan.size_mm[1]) / 2.0
    for x0, y0, x1, y1 in (plan.dark_mm() + np.array([left, top, left, top])).tolist():
        draw.rectangle((_dots(x0), _dots(y0), _dots(x1) - 1, _dots(y1) - 1), fill=BLACK)
    _draw_footer(draw, plan, name, left, top + plan.size_mm[1] + 4.0)
    try:
        if path.suffix.lower() == ".pdf":
            page.save(path, format="PDF", resolution=DPI)
        else:
            page.save(path, format="PNG", dpi=(DPI, DPI))
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be written: {error.strerror or error}") from None


def _page_for(plan: BoardPlan) -> tuple[str, tuple[float, float]]:
    """Return name and size of the smallest page, turned so that the board fits."""
    width, height = plan.size_mm
    needed = width + 2.0 * MARGIN_MM, height + 2.0 * MARGIN_MM + FOOTER_MM
    for name, (short, long) in PAGES_MM.items():
        for page in ((long, short), (short, long)):
            if needed[0] <= page[0] and needed[1] <= page[1]:
                return name, page
    raise CalibrationError(
        f"board: {width:g} x {height:g} mm do not fit on A0 with its margins; give smaller squares"
    )


def _draw_footer(
    draw: ImageDraw.ImageDraw, plan: BoardPlan, page: str, left_mm: float, top_mm: float
) -> None:
    """Draw the ruler, and beside it what the board is and how to print it."""
    line = _dots(0.3)
    for tick in range(round(RULER_MM / TICK_MM) + 1):
        x = _dots(left_mm + tick * TICK_MM)
        draw.line((x, _dots(top_mm), x, _dots(top_mm + 3.0)), BLACK, line)
    ends = (_dots(left_mm), _dots(top_mm + 3.0), _dots(left_mm + RULER_MM), _dots(top_mm + 3.0))
    draw.line(ends, BLACK, line)
    font = ImageFont.load_default(size=_dots(TEXT_MM))
    columns, rows = plan.squares
    board = f"{plan.kind} {columns}x{rows}, squares {plan.square_mm:g} mm"
    if plan.kind == "charuco":
        board += f", markers {plan.marker_mm:g} mm, {plan.dictionary}"
    beside = _dots(left_mm + RULER_MM + 5.0)
    draw.text((beside, _dots(top_mm - 1.5)), f"{page}: print at 100 %. {board}", BLACK, font)
    draw.text((beside, _dots(top_mm + 3.0)), "The ruler is 100 mm long.", BLACK, font)
    draw.text(
        (_dots(left_mm), _dots(top_mm + 4.5)),
        "Laser or pigment black; glue it to something flat.",
        BLACK,
        font,
    )


def _dots(length_mm: float) -> int:
    return round(length_mm * DPI / MM_PER_INCH)
