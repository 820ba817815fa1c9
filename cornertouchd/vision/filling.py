"""Columns of which nothing is known take after their neighbours."""

from cornertouchd.compiling import inlined
from cornertouchd.model import BoolArray, FloatArray


@inlined
def fill_in(values: FloatArray, known: BoolArray) -> None:
    """Fill in the columns that are not known from their nearest neighbours that are."""
    width = len(values)
    column = 0
    while column < width:
        if known[column]:
            column += 1
            continue
        before = column - 1
        while column < width and not known[column]:
            column += 1
        for unknown in range(before + 1, column):
            if column == width:
                values[unknown] = values[before] if before >= 0 else 0.0
            elif before < 0:
                values[unknown] = values[column]
            else:
                share = (unknown - before) / (column - before)
                step = values[column] - values[before]
                values[unknown] = values[before] + share * step
