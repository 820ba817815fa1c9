"""Parts of compiled functions: they see what they are given, and leave arrays as they were held."""

import sys

import numpy as np
import pytest

from cornertouchd.compiling import borrowing, compiled, inlined, summing
from cornertouchd.model import FloatArray


@borrowing
def write(values: FloatArray, place: int, value: float) -> None:
    values[place] = value


@borrowing
def second_half(values: FloatArray) -> float:
    half = values[len(values) // 2 :]
    added = 0.0
    for value in half:
        added += value
    return added


@inlined
def made(count: int) -> FloatArray:
    return np.zeros(count)


@summing
def total(values: FloatArray) -> float:
    added = 0.0
    for value in values:
        added += value
    return added


@compiled("f8[::1](f8[::1], i8)")
def use(given: FloatArray, times: int) -> FloatArray:
    own = made(3)
    for number in range(times):
        write(given, 0, number + 1.0)
        write(own, number % 3, second_half(given) + total(given))
    return own


def test_parts_work_on_the_arrays_of_their_callers() -> None:
    given = np.array([0.0, 0.0, 5.0, 7.0])
    assert use(given, 2).tolist() == [12.0 + 13.0, 12.0 + 14.0, 0.0]
    assert given.tolist() == [2.0, 0.0, 5.0, 7.0]


def test_borrowing_neither_keeps_nor_releases_arrays() -> None:
    given = np.zeros(4)
    held = sys.getrefcount(given)
    results = [use(given, 1000) for _ in range(100)]
    assert sys.getrefcount(given) == held
    assert all(result.tolist() == results[0].tolist() for result in results)


def test_sums_in_any_order_differ_by_rounding() -> None:
    values = np.random.default_rng(1).normal(size=1001)

    @compiled("f8(f8[::1])")
    def total_of(values: FloatArray) -> float:
        return total(values)

    assert total_of(values) == pytest.approx(values.sum(), abs=1e-11)
