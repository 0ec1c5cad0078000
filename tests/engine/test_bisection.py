"""Newest-vertex bisection: what every refined mesh keeps, whichever triangles are asked to be smaller."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.bisection import refined
from engine.mesh import SIDES, signed_areas

NEAR = 1e-12  # middles of middles of coordinates up to ten


def grid(columns: int, rows: int, seed: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and triangles of unequal cells, each triangle starting with its cell's diagonal; diagonals mirrored, or by chance."""
    x, y = np.cumsum(np.r_[0.0, 1 + 0.3 * np.arange(columns) % 0.7]), np.cumsum(np.r_[0.0, 1 + 0.2 * np.arange(rows)])
    nodes = np.column_stack([np.tile(x, rows + 1), np.repeat(y, columns + 1)])
    row, column = (index.ravel() for index in np.mgrid[:rows, :columns])
    sw = row * (columns + 1) + column
    se, nw, ne = sw + 1, sw + columns + 1, sw + columns + 2
    falling = 2 * column >= columns if seed is None else np.random.default_rng(seed).integers(0, 2, len(sw)).astype(bool)
    first = np.where(falling[:, None], np.column_stack([se, nw, sw]), np.column_stack([ne, sw, se]))
    second = np.where(falling[:, None], np.column_stack([nw, se, ne]), np.column_stack([sw, ne, nw]))
    return nodes, np.concatenate([first, second])


def longest_side(at: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2).max(axis=1)


def near(place: tuple[float, float], size: float, growth: float = 0.5):
    """Rule: sides grow from `size` at a place by `growth` of the distance from it."""

    def too_large(at: np.ndarray, origin: np.ndarray) -> np.ndarray:
        return longest_side(at) > size + growth * np.linalg.norm(at - place, axis=2).min(axis=1)

    return too_large


def sides_of(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sides (n, 2) once each, and how many triangles have them."""
    return np.unique(np.sort(triangles[:, SIDES], axis=2).reshape(-1, 2), axis=0, return_counts=True)


def assert_conforming(nodes: np.ndarray, triangles: np.ndarray, outline: float) -> None:
    """Every side has two triangles, or one on the outline: what has one is as long as the outline, so nothing hangs."""
    sides, uses = sides_of(triangles)
    assert uses.max() <= 2
    assert np.linalg.norm(np.diff(nodes[sides[uses == 1]], axis=1), axis=2).sum() == pytest.approx(outline, rel=1e-12)
    assert len(np.unique(np.round(nodes, 9), axis=0)) == len(nodes)  # no place twice
    np.testing.assert_array_equal(np.unique(triangles), np.arange(len(nodes)))


def assert_sound(before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    (nodes, triangles), (fine, parts, origin) = before, after
    np.testing.assert_array_equal(fine[: len(nodes)], nodes)
    assert_conforming(fine, parts, 2 * np.ptp(nodes, axis=0).sum())
    areas, own = signed_areas(nodes, triangles), signed_areas(fine, parts)
    assert (own > 0).all()
    np.testing.assert_allclose(np.bincount(origin, own, len(triangles)), areas, rtol=1e-12)  # sums of tens
    inside = signed_areas(np.concatenate([nodes, fine[parts].mean(axis=1)]), _in_origin(triangles, origin, len(nodes)))
    assert (inside > 0).all()


def _in_origin(triangles: np.ndarray, origin: np.ndarray, n: int) -> np.ndarray:
    """Triangles from a part's centroid to each side of the triangle that it came from: counter-clockwise where it lies inside."""
    centroid = np.repeat(n + np.arange(len(origin)), 3)
    return np.column_stack([triangles[origin][:, SIDES].reshape(-1, 2), centroid])


# Any marking


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    shape=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    seed=st.integers(0, 1000),
    rounds=st.integers(1, 4),
    share=st.floats(0.02, 0.6),
)
def test_any_triangles_may_be_cut(shape, seed, rounds, share):
    """Marked by chance, some rounds: conforming, oriented, of the same area in every triangle of the old mesh."""
    before, rng, left = grid(*shape, seed), np.random.default_rng(seed), [rounds]

    def by_chance(at: np.ndarray, origin: np.ndarray) -> np.ndarray:
        left[0] -= 1
        return (rng.uniform(size=len(at)) < share) & (left[0] >= 0)

    assert_sound(before, refined(*before, by_chance))


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.0, 1.0), (2.2, 1.7), (2.3, 0.0)])
@pytest.mark.parametrize("size", [0.5, 0.05, 0.005])
def test_rule_of_sizes_is_met_and_ends(place, size):
    before = grid(4, 3)
    rule = near(place, size)
    found = refined(*before, rule)
    assert_sound(before, found)
    assert not rule(found[0][found[1]], found[2]).any()
    # sizes halve towards the place, each ring of a few triangles: their number grows with the logarithm of the size alone
    assert len(found[1]) < 24 + 200 * np.log2(4 / size)


def test_nothing_too_large_changes_nothing():
    nodes, triangles = grid(3, 2)
    fine, parts, origin = refined(nodes, triangles, lambda at, origin: np.zeros(len(at), dtype=bool))
    np.testing.assert_array_equal(fine, nodes)
    np.testing.assert_array_equal(parts, triangles)
    np.testing.assert_array_equal(origin, np.arange(len(triangles)))


def test_one_cut_halves_the_two_triangles_of_a_cell():
    """The diagonal is cut: four triangles round its middle, each starting with the side that is cut next."""
    nodes, triangles = grid(1, 1)
    asked = [0]

    def once(at: np.ndarray, origin: np.ndarray) -> np.ndarray:
        asked[0] += 1
        return np.full(len(at), asked[0] == 1) & (np.arange(len(at)) == 0)

    fine, parts, origin = refined(nodes, triangles, once)
    assert len(parts) == 4
    np.testing.assert_array_equal(fine[4], nodes.mean(axis=0))
    np.testing.assert_array_equal(parts[:, 2], 4)  # the newest comes last: cut next is the side across from it
    np.testing.assert_array_equal(np.sort(origin), [0, 0, 1, 1])


def test_rule_is_told_what_each_triangle_came_from():
    """Triangles of one half are cut to a size, those of the other as far as conformity asks alone."""
    nodes, triangles = grid(4, 2)
    chosen = nodes[triangles].mean(axis=1)[:, 0] < nodes[:, 0].mean()
    fine, parts, origin = refined(nodes, triangles, lambda at, origin: chosen[origin] & (longest_side(at) > 0.2))
    size = longest_side(fine[parts])
    assert size[chosen[origin]].max() <= 0.2
    assert size[~chosen[origin]].max() > 1.0


# Symmetry and shapes


@pytest.mark.parametrize("size", [0.4, 0.1, 0.02])
def test_symmetric_marking_of_a_symmetric_mesh_stays_symmetric(size):
    """Diagonals mirrored, a rule that is a mirror of itself: every triangle has its mirror image."""
    nodes, triangles = grid(4, 3)
    x = nodes[:5, 0]
    nodes[:, 0] = np.tile([-x[2], -x[1], 0.0, x[1], x[2]], 4)
    left, right = near((-x[1], 1.0), size), near((x[1], 1.0), size)
    fine, parts, _ = refined(nodes, triangles, lambda at, origin: left(at, origin) | right(at, origin))

    def as_set(xy: np.ndarray) -> set:
        return {frozenset(map(tuple, corners)) for corners in (np.round(xy, 9) + 0.0).tolist()}  # no negative zeros

    assert len(parts) > 50
    assert as_set(fine[parts]) == as_set(fine[parts] * [-1.0, 1.0])


@pytest.mark.parametrize("levels", range(1, 9))
def test_shapes_stay_those_of_the_first_cuts(levels):
    """Halves of a square are cut into halves of squares again: the smallest angle stays 45 degrees however fine the mesh is."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    triangles = np.array([[3, 0, 1], [0, 3, 2]])
    size = np.sqrt(2) / 2**levels
    fine, parts, _ = refined(nodes, triangles, near((0.0, 0.0), size * (1 + 1e-9), 0.7))
    ways = np.roll(fine[parts], -1, axis=1) - fine[parts]
    ways /= np.linalg.norm(ways, axis=2)[:, :, None]
    angles = np.arccos(np.clip(-(ways * np.roll(ways, 1, axis=1)).sum(axis=2), -1, 1))
    np.testing.assert_allclose(
        np.sort(angles, axis=1), np.tile(np.pi * np.array([1, 1, 2]) / 4, (len(parts), 1)), atol=1e-12
    )  # angles of order one
    at_corner = (np.abs(fine[parts]).max(axis=2) < NEAR).any(axis=1)
    assert longest_side(fine[parts])[at_corner].max() <= size * (1 + 1e-9)
