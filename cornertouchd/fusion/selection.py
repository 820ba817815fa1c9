"""Selection: of all discs that could be there, the set that explains the shadows most cheaply.

What a set would cost more without one of its discs, the disc's margin, says how sure we are of it.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.bits import (
    WordArray,
    count_common,
    empty_sets,
    fill,
    is_in,
    take_out,
)
from cornertouchd.fusion.costs import COST_OF_A_DARK_PIECE, Costs, saved_by_edges
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.pool import COST_OF_AN_EDGE
from cornertouchd.model import FloatArray

# Each round lowers the cost; ten contacts take one or two, twenty seldom more than eight.
MOST_ROUNDS = 10
# A disc whose loss costs less may be a ghost that covers for another: then other candidates are
# tried in its place, as they are when one of them explains this much better than the chosen ones.
SURE_MARGIN = 5.0
LEAST_PROMISE = 4.0
# Ten contacts have about 12 candidates beside themselves; trying twice as many finds no more.
MOST_PUT_IN = 16
# Less is rounding: two ways to add up the same cost.
SMALLEST_SAVING = 1e-6
# Without such a disc the shadows are explained as cheaply: nearly half of them are ghosts.
LEAST_MARGIN = 0.05
NOBODY = -1


class Explanation(NamedTuple):
    """N chosen discs of the pool (N,); `margins` (N,) say how much dearer it gets without each.

    `edge_costs` are left to pay for the edges, for the 2 S of all cameras first.
    """

    chosen: IntArray
    margins: FloatArray
    edge_costs: FloatArray


class _Found(NamedTuple):
    """A set of discs that was found, (K,), of which the caller counts those in use.

    `edge_costs` (E,) are left to pay for the edges.
    """

    chosen: IntArray
    edge_costs: FloatArray


class _Set(NamedTuple):
    """A set of discs that grows: `chosen` (K,), of which the caller counts those in use.

    `edge_costs` (E,) are left to pay for the edges, `dark` (1, .) are the pieces that no disc
    darkens and `free` (1, .) the discs that can still be added.  `savings` (K,) is what each would
    have saved when there were `known_at` (K,) discs in the set: at most as much now.
    """

    chosen: IntArray
    edge_costs: FloatArray
    dark: WordArray
    free: WordArray
    savings: FloatArray
    known_at: IntArray


@inlined
def cheapest_explanation(costs: Costs) -> Explanation:
    """Return the cheapest set of discs found.

    Greedy; then, while it helps, one disc is left out, or another one put in, and the set filled up
    again.
    """
    count = len(costs.own)
    discs = _Set(
        np.empty(count, np.intp),
        np.empty(costs.edge_count),
        empty_sets(1, costs.piece_count),
        empty_sets(1, count),
        np.empty(count),
        np.empty(count, np.intp),
    )
    start, without_one, promise = np.empty(count + 1, np.intp), np.empty(count), np.empty(count)
    best = _Found(np.empty(count, np.intp), np.empty(costs.edge_count))
    better = _Found(np.empty(count, np.intp), np.empty(costs.edge_count))
    size, cost = _fill_up(costs, discs, start, 0, NOBODY, costs.same)
    _remember(discs, size, best)
    for step in range(MOST_ROUNDS + 1):
        better_size, better_cost = NOBODY, cost - SMALLEST_SAVING
        for place in range(size):
            _leave_out(best.chosen, size, place, start)
            found, found_cost = _fill_up(
                costs, discs, start, size - 1, best.chosen[place], costs.same
            )
            without_one[place] = found_cost
            if found_cost < better_cost:
                better_size, better_cost = found, found_cost
                _remember(discs, found, better)
        if step == MOST_ROUNDS:
            break
        tries = 0
        if better_size == NOBODY:
            tries = _promising(costs, best.edge_costs, without_one, size, cost, promise)
        for _ in range(tries):
            disc = _take_most_promising(promise)
            if _is_among(best.chosen, size, disc):
                continue
            kept = _put_in(costs.conflicts, best.chosen, size, without_one, cost, disc, start)
            found, found_cost = _fill_up(costs, discs, start, kept, NOBODY, costs.same)
            if found_cost < better_cost:
                better_size, better_cost = found, found_cost
                _remember(discs, found, better)
        if better_size == NOBODY:
            break
        size, cost = better_size, better_cost
        best, better = better, best
    margins = np.empty(size)
    for place in range(size):
        if without_one[place] - cost < LEAST_MARGIN:
            # Another disc may do as well in the same spot: then something is there, be it the one
            # or the other.  Two fingers side by side, of which no camera sees a gap, look like it.
            _leave_out(best.chosen, size, place, start)
            without_one[place] = _fill_up(
                costs, discs, start, size - 1, best.chosen[place], costs.conflicts
            )[1]
        margins[place] = max(without_one[place] - cost, 0.0)
    return Explanation(best.chosen[:size], margins, best.edge_costs)


@borrowing
def _remember(discs: _Set, size: int, found: _Found) -> None:
    for place in range(size):
        found.chosen[place] = discs.chosen[place]
    for edge in range(len(found.edge_costs)):
        found.edge_costs[edge] = discs.edge_costs[edge]


@borrowing
def _leave_out(best: IntArray, size: int, place: int, start: IntArray) -> None:
    """Start with all of the best but one."""
    for other in range(size - 1):
        start[other] = best[other + int(other >= place)]


@borrowing
def _promising(
    costs: Costs,
    edge_costs: FloatArray,
    without_one: FloatArray,
    size: int,
    cost: float,
    promise: FloatArray,
) -> int:
    """Write how much better each disc explains its edges; return how many of them to try."""
    most = 0.0
    for disc in range(len(promise)):
        promise[disc] = saved_by_edges(costs.edges, costs.edge_costs, disc, edge_costs)
        most = max(most, promise[disc])
    for place in range(size):
        if without_one[place] - cost < SURE_MARGIN:
            return min(MOST_PUT_IN, len(promise))
    return min(MOST_PUT_IN, len(promise)) if most >= LEAST_PROMISE else 0


@borrowing
def _take_most_promising(promise: FloatArray) -> int:
    best = 0
    for disc in range(len(promise)):
        if promise[disc] > promise[best]:
            best = disc
    promise[best] = -1.0
    return best


@borrowing
def _is_among(best: IntArray, size: int, disc: int) -> bool:
    found = False
    for place in range(size):
        found |= best[place] == disc
    return found


@borrowing
def _put_in(
    conflicts: WordArray,
    best: IntArray,
    size: int,
    without_one: FloatArray,
    cost: float,
    disc: int,
    start: IntArray,
) -> int:
    """Start with a disc and those of the best that are sure and can be there as well; count them.

    Two fingers side by side need this: a large disc over both is chosen first, stands in the way of
    each, and what it leaves unexplained may even be covered by ghosts.
    """
    start[0] = disc
    count = 1
    for place in range(size):
        if without_one[place] - cost >= SURE_MARGIN and not is_in(conflicts, disc, best[place]):
            start[count] = best[place]
            count += 1
    return count


@borrowing
def _fill_up(
    costs: Costs,
    discs: _Set,
    start: IntArray,
    start_count: int,
    banned: int,
    rivals: WordArray,
) -> tuple[int, float]:
    """Add to the start the disc that saves most, while any saves something.

    None of the `rivals` of the banned disc, itself among them, is added.  Return how many they are
    and what all of it costs.
    """
    own, edges, edge_costs = costs.own, costs.edges, costs.edge_costs
    left, chosen = discs.edge_costs, discs.chosen
    _start_over(costs, discs, banned, rivals)
    count, cost = 0, 0.0
    while True:
        best = start[count] if count < start_count else _most_saving(costs, discs, count)
        if best == NOBODY:
            break
        chosen[count] = best
        count, cost = count + 1, cost + own[best]
        for row in range(edges.shape[1]):
            edge = edges[best, row]
            left[edge] = min(left[edge], edge_costs[best, row])
        take_out(discs.dark, costs.covers, best)
        take_out(discs.free, costs.conflicts, best)
    for edge_cost in left:
        cost += edge_cost
    return count, cost + COST_OF_A_DARK_PIECE * count_common(discs.dark, 0, discs.dark, 0)


@borrowing
def _start_over(costs: Costs, discs: _Set, banned: int, rivals: WordArray) -> None:
    left, savings, known_at = discs.edge_costs, discs.savings, discs.known_at
    at_first = costs.savings
    for edge in range(len(left) - 1):
        left[edge] = COST_OF_AN_EDGE
    left[len(left) - 1] = 0.0
    fill(discs.dark, costs.piece_count)
    fill(discs.free, len(savings))
    if banned != NOBODY:
        take_out(discs.free, rivals, banned)
    for disc in range(len(savings)):
        savings[disc], known_at[disc] = at_first[disc], 0


@borrowing
def _most_saving(costs: Costs, discs: _Set, count: int) -> int:
    """Return the free disc that saves most beside those in the set, if any saves something.

    A disc saves less, never more, when another is added: most need not be asked again.
    """
    own, edges, edge_costs, covers = costs.own, costs.edges, costs.edge_costs, costs.covers
    at_first, by_saving = costs.savings, costs.by_saving
    left, dark, free = discs.edge_costs, discs.dark, discs.free
    savings, known_at = discs.savings, discs.known_at
    best, most = NOBODY, 0.0
    for disc in by_saving:
        if at_first[disc] < most:
            break
        if savings[disc] < most or not is_in(free, 0, disc):
            continue
        if known_at[disc] != count:
            pieces = count_common(covers, disc, dark, 0)
            saved = saved_by_edges(edges, edge_costs, disc, left)
            savings[disc] = saved + COST_OF_A_DARK_PIECE * pieces - own[disc]
            known_at[disc] = count
        # of equal ones the first, whatever the order
        if savings[disc] > most or (savings[disc] == most and disc < best):
            best, most = disc, savings[disc]
    return best
