"""Small systems of normal equations, solved in place by the Cholesky factor of their matrix.

Only the lower triangle of a matrix is read and written.  The diagonal of a factor holds one over
its elements, because processors multiply faster than they divide.
"""

import numpy as np

from cornertouchd.compiling import borrowing
from cornertouchd.model import FloatArray


@borrowing
def factorise(matrix: FloatArray) -> None:
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = 1.0 / np.sqrt(rest) if i == j else rest * matrix[j, j]


@borrowing
def solve(factor: FloatArray, values: FloatArray) -> None:
    """Replace the right-hand side by the solution."""
    for i in range(len(values)):
        for k in range(i):
            values[i] -= factor[i, k] * values[k]
        values[i] *= factor[i, i]
    for i in range(len(values) - 1, -1, -1):
        for k in range(i + 1, len(values)):
            values[i] -= factor[k, i] * values[k]
        values[i] *= factor[i, i]


@borrowing
def write_inverse_column(factor: FloatArray, place: int, column: FloatArray) -> None:
    """Write one column of the inverse of the factorised matrix."""
    column[:] = 0.0
    column[place] = 1.0
    solve(factor, column)


@borrowing
def variance_of_term(factor: FloatArray, place: int, column: FloatArray) -> float:
    """Return one element of the diagonal of the inverse; `column` is room for one."""
    total = 0.0
    for i in range(place, len(column)):
        column[i] = 1.0 if i == place else 0.0
        for k in range(place, i):
            column[i] -= factor[i, k] * column[k]
        column[i] *= factor[i, i]
        total += column[i] * column[i]
    return total
