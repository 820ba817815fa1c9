"""Columns of which nothing is known take after their neighbours."""

from cornertouchd.compiling import inlined
from cornertouchd.model import BoolArray, FloatArray


@inlined
def fill_in(values: FloatArray, known: BoolArray) -> None:
    """Fill in the columns that are not known from their nearest neighbours that are."""
    width = len(values)
    before = -1
    for column in range(width):
        if not known[column]:
            continue
        for unknown in range(before + 1, column):
            if before < 0:
                values[unknown] = values[column]
            else:
                share = (unknown - before) / (column - before)
                step = values[column] - values[before]
                values[unknown] = values[before] + share * step
        before = column
    for unknown in range(before + 1, width):
        values[unknown] = values[before] if before >= 0 else 0.0
