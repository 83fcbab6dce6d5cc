"""Forces of a block of elements on their nodes, in one flat buffer of 12 rows of BLOCK elements.

Component k of the force of element j on its node I stands at k BLOCK + j, on its node O at (6 + k) BLOCK + j. All rows
lie at constant distances, so that the compiler sees that stores do not overlap and handles several elements in one
instruction.
"""

from anctmm.kernels.options import inlined

#: Elements handled at once, and those of them that one instruction handles, at most.
BLOCK, LANES = 64, 8


@inlined
def part(done, count):  # type: ignore[no-untyped-def]
    """First element and number of elements of what a force kernel handles next of a block, after `done` elements.

    First come as many as fill whole vectors. What is left is handled as the last LANES elements, some of them for a
    second time, since single elements take longer than a vector of them.
    """
    if done > 0:
        return count - LANES, LANES
    return 0, count if count < LANES else count - count % LANES


@inlined
def four_rows(q, first):  # type: ignore[no-untyped-def]
    """Components of r and r' of the nodes from `first` on, each a row.

    A loop over elements j reads row[j], not q[k, first + j]: the compiler does not know that first + j is not negative,
    which in Python counts from the end, and would load each number by itself (forces of cables took three times as
    long).
    """
    return q[0, first:], q[1, first:], q[2, first:], q[3, first:]


@inlined
def six_rows(q, first):  # type: ignore[no-untyped-def]
    """The same of nodes of three vectors."""
    return q[0, first:], q[1, first:], q[2, first:], q[3, first:], q[4, first:], q[5, first:]


@inlined
def clear_forces(out, components, count):  # type: ignore[no-untyped-def]
    """Make the forces of a block zero, of so many components of each node."""
    for k in range(components):
        for j in range(count):
            out[k * BLOCK + j] = 0.0
            out[(6 + k) * BLOCK + j] = 0.0


@inlined
def oppose_positions(out, of, to, count):  # type: ignore[no-untyped-def]
    """The forces on r of one node are those of the other one reversed: rows from `to` on, and from `of` on."""
    for k in range(2):
        for j in range(count):
            out[(to + k) * BLOCK + j] = -out[(of + k) * BLOCK + j]
