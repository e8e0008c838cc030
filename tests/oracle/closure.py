"""Closure of four beams, written out: signed minors instead of a decomposition."""

import numpy as np

from tests.oracle.rotations import Array


def minor(rows: Array, left_out: int) -> float:
    """Determinant of the three rows that remain, by the rule of Sarrus."""
    a, b, c = (rows[k] for k in range(4) if k != left_out)
    return float(
        a[0] * (b[1] * c[2] - b[2] * c[1])
        - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def combination(rows: Array) -> Array:
    """(4,) the combination of four readings that no velocity moves: minors with alternating signs, largest 1."""
    weights = np.array([(-1.0) ** k * minor(rows, k) for k in range(4)])
    return np.asarray(weights / weights[np.argmax(np.abs(weights) > 0.99 * np.abs(weights).max())])


def readings(rows: Array, velocity: Array) -> Array:
    """(n, beams) what the beams read, a product at a time."""
    return np.array([[sum(b[k] * v[k] for k in range(3)) for b in rows] for v in velocity])
