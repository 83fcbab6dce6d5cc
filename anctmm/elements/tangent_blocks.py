"""Second derivatives in 2 × 2 blocks: summed up by few vectors, then placed in the triangle of an element's tangent.

A buffer has rows of TANGENT_BLOCK elements. First comes the result, the lower triangle by the components of the nodal
vectors: entry (k, m ≤ k) in row k (k + 1)/2 + m. From row SUMS on lie the sums over the quadrature points: three rows,
xx, yx, yy, where a block is symmetric, else four, row by row. All rows lie in one array at constant distances, so that
the compiler sees that they do not overlap.
"""

from anctmm.compiling import inlined

#: Elements whose tangents are found at once.
TANGENT_BLOCK = 16
#: Rows of the result for a shear element, the larger one, and rows of its sums.
SUMS, ROWS = 78, 52
TANGENT_BUFFER = (SUMS + ROWS) * TANGENT_BLOCK


@inlined
def clear_sums(out, rows):  # type: ignore[no-untyped-def]
    """Make so many rows of sums zero."""
    for k in range(SUMS * TANGENT_BLOCK, (SUMS + rows) * TANGENT_BLOCK):
        out[k] = 0.0


@inlined
def add_symmetric(out, row, j, n, S):  # type: ignore[no-untyped-def]
    """Add n S, S = (xx, xy, yy), to the sums from `row` on."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    out[at] += n * S[0]
    out[at + TANGENT_BLOCK] += n * S[1]
    out[at + 2 * TANGENT_BLOCK] += n * S[2]


@inlined
def add_full(out, row, j, n, B):  # type: ignore[no-untyped-def]
    """Add n B, B = (xx, xy, yx, yy), to the sums from `row` on."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    out[at] += n * B[0]
    out[at + TANGENT_BLOCK] += n * B[1]
    out[at + 2 * TANGENT_BLOCK] += n * B[2]
    out[at + 3 * TANGENT_BLOCK] += n * B[3]


@inlined
def place_symmetric(out, j, k, m, row, f):  # type: ignore[no-untyped-def]
    """Make the block of nodal vectors k ≥ m f times a symmetric sum."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    xx, yx, yy = f * out[at], f * out[at + TANGENT_BLOCK], f * out[at + 2 * TANGENT_BLOCK]
    out[lower(2 * k, 2 * m) + j] = xx
    out[lower(2 * k + 1, 2 * m) + j] = yx
    out[lower(2 * k + 1, 2 * m + 1) + j] = yy
    if k != m:
        out[lower(2 * k, 2 * m + 1) + j] = yx


@inlined
def place_full(out, j, k, m, row, f):  # type: ignore[no-untyped-def]
    """Make the block of nodal vectors k > m f times a sum."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    out[lower(2 * k, 2 * m) + j] = f * out[at]
    out[lower(2 * k, 2 * m + 1) + j] = f * out[at + TANGENT_BLOCK]
    out[lower(2 * k + 1, 2 * m) + j] = f * out[at + 2 * TANGENT_BLOCK]
    out[lower(2 * k + 1, 2 * m + 1) + j] = f * out[at + 3 * TANGENT_BLOCK]


@inlined
def place_transposed(out, j, k, m, row, f):  # type: ignore[no-untyped-def]
    """Make the block of nodal vectors k > m f times the transpose of a sum."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    out[lower(2 * k, 2 * m) + j] = f * out[at]
    out[lower(2 * k, 2 * m + 1) + j] = f * out[at + 2 * TANGENT_BLOCK]
    out[lower(2 * k + 1, 2 * m) + j] = f * out[at + TANGENT_BLOCK]
    out[lower(2 * k + 1, 2 * m + 1) + j] = f * out[at + 3 * TANGENT_BLOCK]


@inlined
def lower(k, m):  # type: ignore[no-untyped-def]
    """Where row k, column m ≤ k of the result begins."""
    return (k * (k + 1) // 2 + m) * TANGENT_BLOCK
