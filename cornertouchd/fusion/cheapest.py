"""The assignment problem: whose partner is which, at the least cost in all."""

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.model import BoolArray, FloatArray

NONE = -1


@inlined
def cheapest_partners(costs: FloatArray) -> IntArray:
    """Return for each row (R,) of finite costs (R, C) its column, or -1.

    All rows or all columns have partners, whichever are fewer, at the least sum of costs.  Shortest
    augmenting paths: Jonker and Volgenant 1987; for rectangles Crouse 2016, section II.

    Our own: scipy's is as fast, but to import it takes a fifth of the time in which a daemon that
    was killed is back (benchmarks/restart.py).
    """
    if costs.shape[0] > costs.shape[1]:
        return _partners_of_columns(np.ascontiguousarray(costs.T))
    partners = np.empty(costs.shape[0], np.int64)
    rows = _partners_of_columns(costs)
    for column in range(len(rows)):
        if rows[column] != NONE:
            partners[rows[column]] = column
    return partners


@inlined
def _partners_of_columns(costs: FloatArray) -> IntArray:
    """Return for each column (C,) its row, or -1; there are no more rows than columns."""
    row_prices, column_prices = np.zeros(costs.shape[0]), np.zeros(costs.shape[1])
    partners = np.empty(costs.shape[1], np.int64)
    partners[:] = NONE
    distances = np.empty(costs.shape[1])
    before = np.empty(costs.shape[1], np.int64)
    reached = np.empty(costs.shape[1], np.bool_)
    for row in range(costs.shape[0]):
        distances[:] = np.inf
        reached[:] = False
        end = _shortest_path(
            row, costs, row_prices, column_prices, partners, distances, before, reached
        )
        row_prices[row] += distances[end]
        for column in range(len(partners)):
            if reached[column] and column != end:
                saved = distances[end] - distances[column]
                row_prices[partners[column]] += saved
                column_prices[column] -= saved
        _take_path(row, end, before, partners)
    return partners


@borrowing
def _shortest_path(
    row: int,
    costs: FloatArray,
    row_prices: FloatArray,
    column_prices: FloatArray,
    partners: IntArray,
    distances: FloatArray,
    before: IntArray,
    reached: BoolArray,
) -> int:
    """Return the nearest column without a partner, by way of columns that would change theirs.

    `distances` and `before`, the column that each is reached from, are filled in on the way.
    """
    column, distance = NONE, 0.0
    while True:
        nearest = NONE
        for other in range(len(partners)):
            if reached[other]:
                continue
            further = distance + costs[row, other] - row_prices[row] - column_prices[other]
            if further < distances[other]:
                distances[other] = further
                before[other] = column
            if nearest == NONE or distances[other] < distances[nearest]:
                nearest = other
        column, distance = nearest, distances[nearest]
        reached[column] = True
        if partners[column] == NONE:
            return column
        row = partners[column]


@borrowing
def _take_path(row: int, end: int, before: IntArray, partners: IntArray) -> None:
    """Let every column of the path take the row of the one before, the first one `row`."""
    column = end
    while before[column] != NONE:
        partners[column] = partners[before[column]]
        column = before[column]
    partners[column] = row
