"""Sets of small numbers as rows of 64-bit words, for compiled functions."""

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import borrowing, inlined

WordArray = NDArray[np.uint64]


@inlined
def empty_sets(count: int, size: int) -> WordArray:
    """Return empty sets of numbers below `size`, (count, words)."""
    return np.zeros((count, (size + 63) // 64), np.uint64)


@borrowing
def put_in(sets: WordArray, row: int, number: int) -> None:
    """Add a number to a set."""
    sets[row, number >> 6] |= np.uint64(1) << np.uint64(number & 63)


@borrowing
def fill(sets: WordArray, size: int) -> None:
    """Make the only set that of all numbers below `size`."""
    for word in range(sets.shape[1]):
        sets[0, word] = ~np.uint64(0)
    if size & 63:
        sets[0, size >> 6] = (np.uint64(1) << np.uint64(size & 63)) - np.uint64(1)


@borrowing
def is_in(sets: WordArray, row: int, number: int) -> bool:
    """Tell whether a set holds a number."""
    bit = np.uint64(1) << np.uint64(number & 63)
    return bool((sets[row, number >> 6] & bit) != np.uint64(0))


@borrowing
def take_out(sets: WordArray, others: WordArray, other: int) -> None:
    """Remove from the only set all numbers that another one holds."""
    for word in range(sets.shape[1]):
        sets[0, word] &= ~others[other, word]


@borrowing
def count_common(sets: WordArray, row: int, others: WordArray, other: int) -> int:
    """Return how many numbers two sets have in common."""
    count = 0
    for word in range(sets.shape[1]):
        count += _count_ones(sets[row, word] & others[other, word])
    return count


@borrowing
def _count_ones(word: np.uint64) -> int:
    """Sum neighbouring bits, pairs, then nibbles: LLVM knows this form as one instruction."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
