"""Beams of a Teledyne from the velocities and the error velocity that it has made of four of them.

An instrument in instrument, ship or earth coordinates has combined its beams, and a combination of four is invertible:

    X = a (b1 - b2),  Y = a (b4 - b3),  Z = c (b1 + b2 + b3 + b4),  E = d (b1 + b2 - b3 - b4)

with a = 1/(2 sin t), c = 1/(4 cos t), d = a/√2 and t the beams' angle; X and Y have the other sign for a concave
transducer. Ship and earth axes are turned by the recorded roll, pitch and heading. A solution of three beams has no
error velocity, and does not tell which three: its beams are lost.

Source: Teledyne RD Instruments, "ADCP Coordinate Transformation".
"""

import numpy as np

from bottomlock.io.beam_table import Flags, Floats, Integers
from bottomlock.libraries import transform

BEAM, INSTRUMENT, SHIP, EARTH = range(4)
"""Coordinates by their code in the fixed leader."""


def beams_of_axes(
    velocity: Floats, frame: Integers, tilted: Flags, convex: Flags, tilt_rad: float, hpr_rad: Floats
) -> Floats:
    """(n, 4) beams of velocities; those in beam coordinates as they stand, NaN where a component is missing.

    Args:
        velocity: (n, 4) to starboard (beam 2), forward (beam 3) and up, or east, north and up, and the error velocity;
            of bottom or water relative to the instrument, positive towards a transducer in beams.
        frame: (n,) coordinates by their code.
        tilted: (n,) the instrument has used its tilts for ship and earth coordinates.
        convex: (n,) the transducer's shape.
        tilt_rad: of the beams from the instrument's axis.
        hpr_rad: (n, 3) recorded heading, clockwise from north, pitch, beam 3 up, and roll, beam 2 down.

    Examples:
        One metre per second forward, no error: beams 3 and 4 alone see it.

        >>> ahead = beams_of_axes(
        ...     np.array([[0.0, 1.0, 0.0, 0.0]]), np.array([1]), np.array([True]), np.array([True]),
        ...     np.radians(30.0), np.zeros((1, 3)),
        ... )
        >>> np.round(ahead, 6).tolist()
        [[0.0, 0.0, -0.5, 0.5]]
    """
    heading, pitch, roll = hpr_rad.T
    level = np.where(tilted, 1.0, 0.0)
    # The pitch sensor swings with the roll.
    pitch = np.arctan(np.tan(pitch) * np.cos(roll)) * level
    turn = transform.Rotation.from_euler(
        "ZXY", np.stack([np.where(frame == EARTH, -heading, 0.0), pitch, roll * level], axis=1)
    )
    axes = np.where((frame >= SHIP)[:, None], turn.inv().apply(velocity[:, :3]), velocity[:, :3])
    x, y = (np.where(convex, 1.0, -1.0) * 2.0 * np.sin(tilt_rad) * axes[:, k] for k in (0, 1))
    both = 4.0 * np.cos(tilt_rad) * axes[:, 2]
    apart = 2.0 * np.sqrt(2.0) * np.sin(tilt_rad) * velocity[:, 3]
    across, along = 0.5 * (both + apart), 0.5 * (both - apart)
    beams = 0.5 * np.stack([across + x, across - x, along - y, along + y], axis=1)
    return np.asarray(np.where((frame == BEAM)[:, None], velocity, beams))
