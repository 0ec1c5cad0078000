"""Products of a symmetric matrix with up to BLOCK rows at a time: one pass over it then does the work of four."""

from .jit import inlined_kernel, kernel, summing_kernel

BLOCK = 4


@kernel
def copy(x, into):
    """Write x (n,) over another array; `into[:] = x` would ask for memory in case they overlap."""
    for i in range(x.size):
        into[i] = x[i]


@summing_kernel
def multiplied(H, n, x, y):
    """y = H[:n, :n] x; four rows at a time, whose sums do not wait for each other."""
    i = 0
    while i + 3 < n:
        a = b = c = d = 0.0
        for k in range(n):
            a += H[i, k] * x[k]
            b += H[i + 1, k] * x[k]
            c += H[i + 2, k] * x[k]
            d += H[i + 3, k] * x[k]
        y[i], y[i + 1], y[i + 2], y[i + 3] = a, b, c, d
        i += 4
    while i < n:
        y[i] = dot(H[i], x, n)
        i += 1


@summing_kernel
def dot(x, y, n):
    """Sum of x[:n] y[:n]."""
    total = 0.0
    for k in range(n):
        total += x[k] * y[k]
    return total


@summing_kernel
def multiplied_rows(H, n, rows, result):
    """result = rows H[:n, :n], both (BLOCK, m)."""
    for i in range(n):
        a = b = c = d = 0.0
        for k in range(n):
            h = H[i, k]
            a += h * rows[0, k]
            b += h * rows[1, k]
            c += h * rows[2, k]
            d += h * rows[3, k]
        result[0, i], result[1, i], result[2, i], result[3, i] = a, b, c, d


@inlined_kernel
def add_outer(H, n, factor, left, right):
    """H[:n, :n] += factor leftᵀ right, both (BLOCK, m)."""
    for i in range(n):
        a, b, c, d = factor * left[0, i], factor * left[1, i], factor * left[2, i], factor * left[3, i]
        for k in range(n):
            H[i, k] += a * right[0, k] + b * right[1, k] + c * right[2, k] + d * right[3, k]


@inlined_kernel
def mix(n, small, rows, mixed):
    """mixed = small rows over n columns; small (BLOCK, BLOCK)."""
    for q in range(BLOCK):
        a, b, c, d = small[q, 0], small[q, 1], small[q, 2], small[q, 3]
        for k in range(n):
            mixed[q, k] = a * rows[0, k] + b * rows[1, k] + c * rows[2, k] + d * rows[3, k]


@kernel
def subtract_rows(H, n, chosen, count, factors, x):
    """x[:n] -= the rows H[chosen[r], :n] times factors[r], r up to `count`."""
    r = 0
    while r + 3 < count:
        i, j, k, l = chosen[r], chosen[r + 1], chosen[r + 2], chosen[r + 3]  # noqa: E741
        a, b, c, d = factors[r], factors[r + 1], factors[r + 2], factors[r + 3]
        for s in range(n):
            x[s] -= a * H[i, s] + b * H[j, s] + c * H[k, s] + d * H[l, s]
        r += 4
    while r < count:
        i, a = chosen[r], factors[r]
        for s in range(n):
            x[s] -= a * H[i, s]
        r += 1


@inlined_kernel
def clear(rows, first, n):
    """Zeros into the rows of a block from `first` on."""
    for q in range(first, BLOCK):
        for k in range(n):
            rows[q, k] = 0.0


@kernel
def invert_small(A, count):
    """Replace A[:count, :count] by its inverse (Gauss-Jordan) and the rest by zeros; False where a pivot is zero."""
    for k in range(count):
        pivot = A[k, k]
        if pivot == 0.0:
            return False
        A[k, k] = 1.0
        for j in range(count):
            A[k, j] /= pivot
        for i in range(count):
            if i != k:
                factor = A[i, k]
                A[i, k] = 0.0
                for j in range(count):
                    A[i, j] -= factor * A[k, j]
    for i in range(BLOCK):
        for j in range(BLOCK):
            if i >= count or j >= count:
                A[i, j] = 0.0
    return True
