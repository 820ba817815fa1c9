"""Normal equations: the sums that fits to many rays are made of."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.compiling import compiled
from cornertouchd.fusion.normal_equations import add_products, total
from cornertouchd.model import FloatArray


@compiled("f8(f8[::1], i8)")
def total_of(values: FloatArray, count: int) -> float:
    return total(values, count)


@compiled("void(f8[:,::1], i8, f8[::1], f8[::1], f8[::1], f8[:,::1], f8[::1])")
def add(
    derivatives: FloatArray,
    count: int,
    weights: FloatArray,
    pulls: FloatArray,
    weighted: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> None:
    add_products(derivatives, count, weights, pulls, weighted, normal, slope)


@given(count=st.integers(0, 70), seed=st.integers(0, 1000))
@settings(deadline=None)
def test_total_is_the_sum_of_the_first_values(count: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=70)
    assert total_of(values, count) == pytest.approx(values[:count].sum(), abs=1e-12)


@given(terms=st.integers(1, 7), count=st.integers(0, 70), seed=st.integers(0, 1000))
@settings(deadline=None)
def test_products_of_all_rays_are_added(terms: int, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    derivatives, weights = rng.normal(size=(terms, 70)), rng.uniform(0.0, 2.0, 70)
    pulls, before, slope_before = rng.normal(size=70), rng.normal(size=(terms,) * 2), np.ones(terms)
    normal, slope = before.copy(), slope_before.copy()
    add(derivatives, count, weights, pulls, np.empty(70), normal, slope)
    few = derivatives[:, :count]
    assert slope == pytest.approx(slope_before + few @ pulls[:count], abs=1e-11)
    expected = before + (few * weights[:count]) @ few.T
    assert np.tril(normal) == pytest.approx(np.tril(expected), abs=1e-11)
    assert (np.triu(normal, 1) == np.triu(before, 1)).all(), "only the lower triangle is written"


def test_rays_beyond_the_count_do_not_matter() -> None:
    derivatives, weights, pulls = np.full((2, 9), np.nan), np.full(9, np.nan), np.full(9, np.nan)
    derivatives[:, :3], weights[:3], pulls[:3] = 1.0, 2.0, 3.0
    normal, slope = np.zeros((2, 2)), np.zeros(2)
    add(derivatives, 3, weights, pulls, np.empty(9), normal, slope)
    assert slope.tolist() == [9.0, 9.0]
    assert normal.tolist() == [[6.0, 0.0], [6.0, 6.0]]
