"""Which fingers count as touching, by how high above the surface they are.

    python benchmarks/hover.py [--fingers 300] [--rigs 3] [--markdown docs/touch-point.md]

Single fingers on simulated rigs, which were calibrated from 16 taps (.5 mm off, standard deviation
per axis) and a scribble: 8 to 16 mm thick, leaning by up to 45 degrees towards any side, anywhere
but in the outer 10 mm.  A cell is the share of fingers of that clearance that are reported as
touching, every frame set on its own, for each setting of `touch_point.touch_height_mm`.  At 0 the
finger touches; what is missing from 100 % there was refused, but for those that have no contact at
all (`not found`) and those taken for palms, which are not asked whether they touch (`palm`).  A
column is an ROC curve: what is kept at 0 against what is let through above.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import click
import doc_tables
import numpy as np
from calibration_sets import RigKind
from leaning_fingers import KINDS, CalibratedRig, calibrated_rig, contact_of, random_finger

from cornertouchd.config import Settings, TouchPointSettings
from cornertouchd.model import Contact
from cornertouchd.pipeline import SurfacePipeline

CLEARANCES_MM = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)
TOUCH_HEIGHTS_MM = (0.0, 0.2, 0.4)
TAP_SIGMA_MM = 0.5


@dataclass
class Tally:
    """Of fingers at one clearance: how many there were, and what they were reported as."""

    fingers: int = 0
    missed: int = 0
    palms: int = 0
    touching: list[int] = field(default_factory=lambda: [0] * len(TOUCH_HEIGHTS_MM))

    def row(self, rig: str, clearance_mm: float) -> list[str]:
        """Return the cells of its row."""
        counts = (*self.touching, self.palms, self.missed)
        shares = [f"{100.0 * count / self.fingers:.1f} %" for count in counts]
        return [rig, f"{clearance_mm:g}", *shares]

    def add(self, contacts: Sequence[Contact | None]) -> None:
        """Count a finger, by the contact that it has at each setting."""
        self.fingers += 1
        self.missed += contacts[0] is None
        self.palms += contacts[0] is not None and contacts[0].kind == "palm"
        for place, contact in enumerate(contacts):
            self.touching[place] += (
                contact is not None and contact.touching and contact.kind != "palm"
            )


def surfaces_of(calibrated: CalibratedRig) -> list[SurfacePipeline]:
    """Return what tells touches from the rest, for every height that counts as a touch."""
    return [
        SurfacePipeline(
            calibrated.calibration,
            Settings(touch_point=TouchPointSettings(touch_height_mm=height_mm)),
        )
        for height_mm in TOUCH_HEIGHTS_MM
    ]


def measure(kind: RigKind, rigs: int, fingers: int) -> list[Tally]:
    """Return a tally for every clearance; each has the same fingers but for their height."""
    tallies = [Tally() for _ in CLEARANCES_MM]
    for seed in range(1, rigs + 1):
        calibrated = calibrated_rig(kind, seed, TAP_SIGMA_MM)
        surfaces = surfaces_of(calibrated)
        for number, (clearance_mm, tally) in enumerate(zip(CLEARANCES_MM, tallies, strict=True)):
            rng = np.random.default_rng([seed, 3])
            for index in range(fingers):
                finger = random_finger(kind.surface_mm, rng, clearance_mm)
                seen = calibrated.observe(1000 + number * fingers + index, finger)
                tally.add([contact_of(surface, seen, finger) for surface in surfaces])
    return tallies


def titles() -> Sequence[str]:
    heights = [f"touch_height_mm {height_mm:g}" for height_mm in TOUCH_HEIGHTS_MM]
    return ["frame", "clearance, mm", *heights, "palm", "not found"]


@click.command(help=__doc__)
@click.option("--fingers", default=300, show_default=True, help="At each clearance on each rig.")
@click.option("--rigs", default=3, show_default=True, help="Of each size, mounted differently.")
@click.option("--markdown", type=click.Path(path_type=Path), help="Page that has the table.")
def main(fingers: int, rigs: int, markdown: Path | None) -> None:
    print("\n".join(doc_tables.table(titles(), [])))
    rows = []
    for kind in KINDS:
        for clearance_mm, tally in zip(CLEARANCES_MM, measure(kind, rigs, fingers), strict=True):
            rows.append(tally.row(kind.name, clearance_mm))
            print(doc_tables.table(titles(), rows[-1:])[-1], flush=True)
    if markdown:
        doc_tables.put_into(markdown, "hover", doc_tables.table(titles(), rows))


if __name__ == "__main__":
    main()
