"""Functions that only borrow arrays: parts of compiled ones that count no references.

numba counts the references to each array that a function is given, twice for each call, with
instructions that lock memory: for the small functions that run thousands of times that takes as
long as what they do.
"""

from typing import Any, cast

import numba

from cornertouchd.compiling import INLINED_OPTIONS, F

# numba's own name for counting references: they are kept by its runtime.
BORROWING: dict[str, Any] = {**INLINED_OPTIONS, "_nrt": False}
SUMMING: dict[str, Any] = {**BORROWING, "fastmath": {"reassoc"}}


def borrowing(function: F) -> F:
    """Make a function callable from compiled ones, as `inlined` does, without counting references.

    It must neither make arrays nor return any, nor call what does: nobody would release them.
    """
    return cast("F", numba.njit(**BORROWING)(function))


def summing(function: F) -> F:
    """Make a function borrow arrays, and let a processor add up its sums in any order.

    It then adds several numbers at once, which changes a sum by its rounding.
    """
    return cast("F", numba.njit(**SUMMING)(function))
