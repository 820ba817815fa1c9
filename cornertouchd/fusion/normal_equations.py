"""Normal equations of fits to many rays: sums of products, several of them at once.

What is summed is kept term after term, so that a processor takes the same term of several rays at
once.
"""

from cornertouchd.compiling import summing
from cornertouchd.model import FloatArray


@summing
def total(values: FloatArray, count: int) -> float:
    """Return the sum of the first `count` values."""
    added = 0.0
    for number in range(count):
        added += values[number]
    return added


@summing
def add_products(
    derivatives: FloatArray,
    count: int,
    weights: FloatArray,
    pulls: FloatArray,
    weighted: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> None:
    """Add what `count` rays say of T terms to the lower triangle of `normal` (T, T), and `slope`.

    Term i changes the residuals by `derivatives[i]`; the normal matrix takes their products times
    `weights`, the slope (T,) their products with `pulls`.  `weighted` is room for one term.
    """
    for i in range(len(slope)):
        pulled = 0.0
        for ray in range(count):
            weighted[ray] = weights[ray] * derivatives[i, ray]
            pulled += pulls[ray] * derivatives[i, ray]
        slope[i] += pulled
        for j in range(i + 1):
            added = 0.0
            for ray in range(count):
                added += weighted[ray] * derivatives[j, ray]
            normal[i, j] += added
