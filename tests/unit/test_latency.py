"""Latencies are counted where they belong, and none is lost."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.runtime.latency import BOUNDS_S, LatencyHistogram


@given(st.lists(st.floats(0.0, 1.0)))
def test_each_latency_is_in_the_first_bucket_that_holds_it(latencies_s: list[float]) -> None:
    histogram = LatencyHistogram()
    for latency_s in latencies_s:
        histogram.note(latency_s)
    told = histogram.read()
    assert sum(told.counts) == len(latencies_s)
    assert told.sum_s == pytest.approx(sum(latencies_s))
    for place, bound_s in enumerate(BOUNDS_S):
        below = sum(latency_s <= bound_s for latency_s in latencies_s)
        assert sum(told.counts[: place + 1]) == below


def test_a_quantile_is_the_bound_that_this_share_is_below() -> None:
    histogram = LatencyHistogram()
    assert histogram.read().quantile_s(0.5) is None
    for latency_s in [0.0045] * 98 + [0.018, 0.4]:
        histogram.note(latency_s)
    told = histogram.read()
    assert [told.quantile_s(share) for share in (0.5, 0.99, 1.0)] == [0.005, 0.02, math.inf]
