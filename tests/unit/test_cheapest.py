"""Partners at the least cost, against scipy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from cornertouchd.compiling import compiled
from cornertouchd.fusion.assignment import COST_OF_TENTATIVE, OUT_OF_REACH
from cornertouchd.fusion.cheapest import NONE, cheapest_partners
from cornertouchd.model import FloatArray

# All that is out of reach costs the same; what is tentative costs much; few levels make ties.
COSTS = st.one_of(
    st.just(OUT_OF_REACH),
    st.floats(0.0, 500.0),
    st.floats(0.0, 500.0).map(lambda cost: cost + COST_OF_TENTATIVE),
    st.sampled_from([0.0, 1.0, 2.0]),
)


@compiled("i8[::1](f8[:,::1])")
def partners_of(costs: FloatArray) -> np.ndarray:
    return cheapest_partners(costs)


@st.composite
def tables(draw: st.DrawFn) -> FloatArray:
    rows, columns = draw(st.integers(0, 9)), draw(st.integers(0, 9))
    flat = draw(st.lists(COSTS, min_size=rows * columns, max_size=rows * columns))
    return np.array(flat, dtype=float).reshape(rows, columns)


@given(tables())
@settings(max_examples=300)
def test_no_other_partners_cost_less(costs: FloatArray) -> None:
    partners = partners_of(costs)
    rows = np.flatnonzero(partners != NONE)
    assert len(rows) == min(costs.shape)
    assert len(set(partners[rows])) == len(rows)
    theirs = costs[linear_sum_assignment(costs)].sum()
    # Costs of 1e12 leave a thousandth of a unit to the others.
    assert costs[rows, partners[rows]].sum() == pytest.approx(theirs, rel=1e-12, abs=1e-9)


def test_a_neighbour_is_left_to_who_has_no_other() -> None:
    costs = np.array([[1.0, 2.0, 9.0], [2.0, OUT_OF_REACH, OUT_OF_REACH]])
    assert list(partners_of(costs)) == [1, 0]


def test_most_rows_have_none_when_columns_are_few() -> None:
    costs = np.array([[4.0], [1.0], [3.0]])
    assert list(partners_of(costs)) == [NONE, 0, NONE]
