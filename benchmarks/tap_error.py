"""What taps that miss their targets cost: the error of touch points after such a calibration.

    python benchmarks/tap_error.py [--fingers 300] [--rigs 5] [--markdown docs/touch-point.md]

Simulated rigs are calibrated (auto) from 16 taps that miss by so much (standard deviation per axis)
and a scribble of fingers that lean.  Then single fingers, 8 to 16 mm thick, leaning by up to 45
degrees towards any side, are located, every frame set on its own.  RMS / 95 % of all fingers of all
rigs, in mm: of the touch point; of the section at the height of the cameras, against the true
section (what crossing alone is off by); and of that section taken for the touch.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot
from pathlib import Path

import click
import doc_tables
import numpy as np
from calibration_sets import RigKind
from leaning_fingers import KINDS, calibrated_rig, contact_of, random_finger

from cornertouchd.config import Settings
from cornertouchd.pipeline import SurfacePipeline

TAP_SIGMAS_MM = (0.0, 0.3, 0.5, 1.0)
TITLES = (
    "frame",
    "taps off by, mm",
    "touch point",
    "section",
    "section for touch",
    "worst rig's touch point, RMS",
    "not found",
)


@dataclass
class Errors:
    """Errors of the fingers of some rigs, in mm; `rigs_mm` has the RMS of each rig."""

    point_mm: list[float] = field(default_factory=list)
    section_mm: list[float] = field(default_factory=list)
    plain_mm: list[float] = field(default_factory=list)
    rigs_mm: list[float] = field(default_factory=list)
    missed: int = 0

    def row(self, rig: str, tap_sigma_mm: float) -> list[str]:
        """Return the cells of its row."""
        return [
            rig,
            f"{tap_sigma_mm:g}" if tap_sigma_mm else "exact",
            *(_figures(errors) for errors in (self.point_mm, self.section_mm, self.plain_mm)),
            f"{max(self.rigs_mm):.2f}",
            str(self.missed),
        ]


def measure(kind: RigKind, tap_sigma_mm: float, rigs: int, fingers: int) -> Errors:
    """Return the errors on so many rigs, with the same fingers for every tap error."""
    errors = Errors()
    for seed in range(1, rigs + 1):
        calibrated = calibrated_rig(kind, seed, tap_sigma_mm)
        surface = SurfacePipeline(calibrated.calibration, Settings())
        rng = np.random.default_rng([seed, 4])
        located = len(errors.point_mm)
        for index in range(fingers):
            finger = random_finger(kind.surface_mm, rng)
            section = calibrated.rig.truth.section(finger)
            assert section is not None
            contact = contact_of(surface, calibrated.observe(1000 + index, finger), finger)
            if contact is None:
                errors.missed += 1
                continue
            x_mm, y_mm = contact.section_mm
            errors.point_mm.append(hypot(contact.x_mm - finger.x_mm, contact.y_mm - finger.y_mm))
            errors.section_mm.append(hypot(x_mm - section.x_mm, y_mm - section.y_mm))
            errors.plain_mm.append(hypot(x_mm - finger.x_mm, y_mm - finger.y_mm))
        errors.rigs_mm.append(_rms(errors.point_mm[located:]))
    return errors


def _rms(errors_mm: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors_mm))))


def _figures(errors_mm: Sequence[float]) -> str:
    return f"{_rms(errors_mm):.2f} / {np.percentile(errors_mm, 95.0):.2f}"


@click.command(help=__doc__)
@click.option("--fingers", default=300, show_default=True, help="On each rig.")
@click.option("--rigs", default=5, show_default=True, help="Of each size, mounted differently.")
@click.option("--markdown", type=click.Path(path_type=Path), help="Page that has the table.")
def main(fingers: int, rigs: int, markdown: Path | None) -> None:
    print("\n".join(doc_tables.table(TITLES, [])))
    rows = []
    for kind in KINDS:
        for tap_sigma_mm in TAP_SIGMAS_MM:
            rows.append(measure(kind, tap_sigma_mm, rigs, fingers).row(kind.name, tap_sigma_mm))
            print(doc_tables.table(TITLES, rows[-1:])[-1], flush=True)
    if markdown:
        doc_tables.put_into(markdown, "tap error", doc_tables.table(TITLES, rows))


if __name__ == "__main__":
    main()
