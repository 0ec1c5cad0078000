"""LU with partial pivoting of one small dense matrix, in a fixed order of sums."""

from .jit import kernel


@kernel
def factorise(A, n, pivot):
    """Overwrite A[:n, :n] by its LU factors, row exchanges in pivot (n,); False where the matrix is singular."""
    for k in range(n):
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
            factor = A[i, k] / A[k, k]
            A[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
    return True


@kernel
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
