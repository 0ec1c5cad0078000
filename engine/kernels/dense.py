"""LU with partial pivoting of one small dense matrix, in a fixed order of sums."""

from .jit import inlined_kernel, kernel, summing_kernel
from .vector import load, plus_product, store, zeros

PANEL = 4
"""Columns that are eliminated together: one pass over what is left of the matrix then does the work of four."""


@kernel
def factorise(A, n, pivot):
    """Overwrite A[:n, :n] by its LU factors, row exchanges in pivot (n,); False where the matrix is singular."""
    for start in range(0, n, PANEL):
        end = min(start + PANEL, n)
        for k in range(start, end):
            if not _pivoted(A, n, k, pivot):
                return False
            _eliminate(A, k, k + 1, n, k + 1, end)
        for k in range(start, end):
            _eliminate(A, k, k + 1, end, end, n)
        for i in range(end, n):
            a, b, c, d = A[i, start], A[i, start + 1], A[i, start + 2], A[i, start + 3]
            for j in range(end, n):
                A[i, j] -= a * A[start, j] + b * A[start + 1, j] + c * A[start + 2, j] + d * A[start + 3, j]
    return True


@inlined_kernel
def _pivoted(A, n, k, pivot):
    """Bring the largest entry of column k onto the diagonal and divide what is below by it; False where all are zero."""
    best = k
    for i in range(k + 1, n):
        if abs(A[i, k]) > abs(A[best, k]):
            best = i
    pivot[k] = best
    if A[best, k] == 0.0:
        return False
    if best != k:
        for j in range(n):
            A[k, j], A[best, j] = A[best, j], A[k, j]
    for i in range(k + 1, n):
        A[i, k] /= A[k, k]
    return True


@kernel
def _eliminate(A, k, first_row, last_row, first, last):
    """Take row k times column k off a block of the matrix."""
    for i in range(first_row, last_row):
        factor = A[i, k]
        for j in range(first, last):
            A[i, j] -= factor * A[k, j]


@summing_kernel
def solve(A, n, pivot, x):
    """Solve in place with the factors of `factorise`: x (n,)."""
    for k in range(n):
        if pivot[k] != k:
            x[k], x[pivot[k]] = x[pivot[k]], x[k]
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= A[i, j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, n):
            total -= A[i, j] * x[j]
        x[i] = total / A[i, i]


@kernel
def solve_lanes(A, n, pivot, x):
    """`solve` for all lanes at once: x (n, LANES)."""
    for k in range(n):
        if pivot[k] != k:
            row = load(x, k)
            store(x, k, load(x, pivot[k]))
            store(x, pivot[k], row)
    i = 0
    while i + 1 < n:
        a, b = load(x, i), load(x, i + 1)
        for j in range(i):
            row = load(x, j)
            a, b = plus_product(a, -A[i, j], row), plus_product(b, -A[i + 1, j], row)
        store(x, i, a)
        store(x, i + 1, plus_product(b, -A[i + 1, i], a))
        i += 2
    if i < n:
        _finish(A, i, 0, i, x)
    i = n - 1
    while i > 0:
        a, b = load(x, i), load(x, i - 1)
        for j in range(i + 1, n):
            row = load(x, j)
            a, b = plus_product(a, -A[i, j], row), plus_product(b, -A[i - 1, j], row)
        a = plus_product(zeros(), 1.0 / A[i, i], a)
        store(x, i, a)
        b = plus_product(b, -A[i - 1, i], a)
        store(x, i - 1, plus_product(zeros(), 1.0 / A[i - 1, i - 1], b))
        i -= 2
    if i == 0:
        _finish(A, 0, 1, n, x)
        store(x, 0, plus_product(zeros(), 1.0 / A[0, 0], load(x, 0)))


@kernel
def _finish(A, i, first, last, x):
    """Take the products of row i with the unknowns first to last off unknown i."""
    total = load(x, i)
    for j in range(first, last):
        total = plus_product(total, -A[i, j], load(x, j))
    store(x, i, total)
