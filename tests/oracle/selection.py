"""Selection: of all discs that could be there, the set that explains the shadows most cheaply.

A disc costs something to believe in; an edge costs little when a chosen disc touches it and a fixed
price when none does; so does each piece of shadow that no chosen disc darkens.  The costs are
negative log likelihoods, so what a set would cost more without one of its discs, the disc's margin,
says how sure we are of it.
"""

from dataclasses import dataclass

import numpy as np

from cornertouchd.fusion.costs import (
    COST_OF_A_DARK_PIECE,
    MOST_PIECES_PER_SHADOW,
    PIECE_PX,
    PIECE_TOLERANCE_PX,
    SAME_CONTACT_MM,
    SMALLEST_SHARE_OF_RADII,
)
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.pool import COST_OF_AN_EDGE
from cornertouchd.fusion.selection import (
    LEAST_MARGIN,
    LEAST_PROMISE,
    MOST_PUT_IN,
    MOST_ROUNDS,
    SMALLEST_SAVING,
    SURE_MARGIN,
)
from cornertouchd.geometry import angles_and_distances, half_angles_of_discs
from cornertouchd.model import BoolArray, FloatArray
from oracle.candidates import Candidates, edge_costs
from oracle.edge_rows import EdgeRows


@dataclass(frozen=True, slots=True)
class Costs:
    """What each of K candidates costs and explains.

    `own` (K,) is the price of the disc.  Row k of `edges` (K, M) names the edges of its cell and
    row k of `edge_costs` (K, M) what they cost with it.  `covers` (K, B) marks the pieces of shadow
    that it darkens, `conflicts` (K, K) the discs that cannot be there as well, and `same` (K, K)
    those that are the same contact.
    """

    own: FloatArray
    edges: IntArray
    edge_costs: FloatArray
    covers: BoolArray
    conflicts: BoolArray
    same: BoolArray
    edge_count: int


@dataclass(frozen=True, slots=True)
class Explanation:
    """A set of N candidates (N,), by their numbers.

    `margins` (N,) say for each how much more the cheapest set found without it would cost;
    `unexplained` marks the edges that none of them touches, valid or not, by their numbers.
    """

    chosen: IntArray
    margins: FloatArray
    unexplained: BoolArray


def costs_of(candidates: Candidates, rows: EdgeRows, edge_sigma_px: float) -> Costs:
    """Weigh the candidates; `edge_sigma_px` is the sigma of an edge, which gives the pixels."""
    discs = candidates.discs
    apart_mm = np.hypot(*np.moveaxis(discs[:, None, :2] - discs[None, :, :2], -1, 0))
    return Costs(
        own=candidates.own,
        edges=candidates.rows.edges,
        edge_costs=edge_costs(candidates),
        covers=pieces_covered(discs, rows, edge_sigma_px),
        conflicts=apart_mm < SMALLEST_SHARE_OF_RADII * (discs[:, None, 2] + discs[None, :, 2]),
        same=apart_mm < SAME_CONTACT_MM,
        edge_count=rows.edge_count,
    )


def cheapest_explanation(costs: Costs) -> Explanation:
    """Return the cheapest set of candidates found.

    Greedy; then, while it helps, one disc is left out, or another one put in, and the set filled up
    again.
    """
    best = _filled_up(costs, ())
    without_one = _each_left_out(costs, best)
    for _ in range(MOST_ROUNDS):
        cheapest = _cheapest_of(best, without_one)
        if cheapest is best:
            cheapest = _cheapest_of(best, _each_put_in(costs, best, without_one))
        if cheapest is best:
            break
        best, without_one = cheapest, _each_left_out(costs, cheapest)
    return Explanation(
        chosen=np.array(best.chosen, dtype=np.intp),
        margins=_margins_of_spots(costs, best, _margins(best, without_one)),
        unexplained=best.edge_costs >= COST_OF_AN_EDGE,
    )


@dataclass(frozen=True, slots=True)
class _DiscSet:
    """Candidates in the order in which they were chosen, what is left to pay, and the total."""

    chosen: tuple[int, ...]
    edge_costs: FloatArray
    cost: float


def _cheapest_of(best: _DiscSet, others: list[_DiscSet]) -> _DiscSet:
    """Return the cheapest of the others if it saves anything, else the best."""
    cheapest = min(others, key=lambda other: other.cost, default=best)
    return cheapest if cheapest.cost < best.cost - SMALLEST_SAVING else best


def _margins(best: _DiscSet, without_one: list[_DiscSet]) -> FloatArray:
    return np.array([max(other.cost - best.cost, 0.0) for other in without_one])


def _margins_of_spots(costs: Costs, best: _DiscSet, margins: FloatArray) -> FloatArray:
    """Where another disc does as well in the same spot, say how dear it is without all of them."""
    without_spot = _each_left_out(costs, best, costs.conflicts)
    return np.where(margins < LEAST_MARGIN, _margins(best, without_spot), margins)


def _each_left_out(
    costs: Costs, discs: _DiscSet, rivals: BoolArray | None = None
) -> list[_DiscSet]:
    """Return for each chosen disc the set without it and its rivals, filled up with others."""
    chosen = discs.chosen
    rivals = costs.same if rivals is None else rivals
    return [
        _filled_up(costs, chosen[:place] + chosen[place + 1 :], banned=rivals[disc])
        for place, disc in enumerate(chosen)
    ]


def _each_put_in(costs: Costs, best: _DiscSet, without_one: list[_DiscSet]) -> list[_DiscSet]:
    """Return for each of the other discs the set that it makes with those that are sure.

    Two fingers side by side need this: a large disc over both is chosen first, stands in the way of
    each, and what it leaves unexplained may even be covered by ghosts.
    """
    sure = np.array(best.chosen, dtype=np.intp)[_margins(best, without_one) >= SURE_MARGIN]
    promise = _saved_by_edges(costs, best.edge_costs)
    if len(sure) == len(best.chosen) and promise.max(initial=0.0) < LEAST_PROMISE:
        return []
    promising = np.argsort(-promise, kind="stable")[:MOST_PUT_IN].tolist()
    return [
        _filled_up(costs, (disc, *sure[~costs.conflicts[disc, sure]].tolist()))
        for disc in promising
        if disc not in best.chosen
    ]


def _filled_up(costs: Costs, chosen: tuple[int, ...], banned: BoolArray | None = None) -> _DiscSet:
    """Add the disc that saves most, while any saves something, but none of the banned."""
    all_chosen = list(chosen)
    edge_costs = np.full(costs.edge_count, COST_OF_AN_EDGE)
    for disc in all_chosen:
        _explain_edges(edge_costs, costs, disc)
    dark: BoolArray = ~np.any(costs.covers[all_chosen], axis=0)
    free: BoolArray = ~np.any(costs.conflicts[all_chosen], axis=0)
    if banned is not None:
        free &= ~banned
    while np.any(free):
        savings = np.where(free, _savings(costs, edge_costs, dark), -np.inf)
        disc = int(np.argmax(savings))
        if savings[disc] <= 0.0:
            break
        all_chosen.append(disc)
        _explain_edges(edge_costs, costs, disc)
        dark &= ~costs.covers[disc]
        free &= ~costs.conflicts[disc]
    own = costs.own[all_chosen].sum()
    cost = own + edge_costs.sum() + COST_OF_A_DARK_PIECE * np.count_nonzero(dark)
    return _DiscSet(tuple(all_chosen), edge_costs, float(cost))


def _explain_edges(edge_costs: FloatArray, costs: Costs, disc: int) -> None:
    """Lower the costs of the edges that the disc touches."""
    edges = costs.edges[disc]
    edge_costs[edges] = np.minimum(edge_costs[edges], costs.edge_costs[disc])


def _savings(costs: Costs, edge_costs: FloatArray, dark: BoolArray) -> FloatArray:
    """Return by how much each disc would lower the cost, (K,)."""
    by_pieces = COST_OF_A_DARK_PIECE * np.count_nonzero(costs.covers & dark, axis=1)
    savings: FloatArray = _saved_by_edges(costs, edge_costs) + by_pieces - costs.own
    return savings


def _saved_by_edges(costs: Costs, edge_costs: FloatArray) -> FloatArray:
    saved: FloatArray = np.maximum(edge_costs[costs.edges] - costs.edge_costs, 0.0).sum(axis=1)
    return saved


def shadows_of_pieces(rows: EdgeRows, edge_sigma_px: float) -> IntArray:
    """Cut the shadows into pieces of `PIECE_PX`; return the shadow of each, (B,).

    A shadow without a valid edge fills all that its camera can see of some place: it says that
    something is there, but its pieces are no measure of how much.
    """
    rad_per_px = rows.sigma_rad / edge_sigma_px
    widths = rows.bounds_rad[:, 1] - rows.bounds_rad[:, 0]
    pieces = np.clip(
        (widths / (PIECE_PX * rad_per_px)).astype(np.intp) - 1, 1, MOST_PIECES_PER_SHADOW
    )
    pieces[~rows.valid.any(axis=1)] = 0
    return np.repeat(np.arange(len(pieces)), pieces)


def pieces_covered(discs: FloatArray, rows: EdgeRows, edge_sigma_px: float) -> BoolArray:
    """Tell which disc darkens which piece, (K, B)."""
    rad_per_px = rows.sigma_rad / edge_sigma_px
    shadow = shadows_of_pieces(rows, edge_sigma_px)
    pieces = np.bincount(shadow, minlength=len(rad_per_px))
    number = np.arange(len(shadow)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    widths = (rows.bounds_rad[:, 1] - rows.bounds_rad[:, 0]) / np.maximum(pieces, 1)
    middles = rows.bounds_rad[shadow, 0] + (number + 0.5) * widths[shadow]
    camera = rows.camera_of_shadow[shadow]
    angles, distances = angles_and_distances(discs[:, :2], rows.positions_mm)
    half_angles = half_angles_of_discs(discs[:, 2:], distances)
    reach = half_angles[:, camera] + PIECE_TOLERANCE_PX * rad_per_px[shadow]
    covered: BoolArray = np.abs(rows.unwrap(angles)[:, camera] - middles) <= reach
    return covered
