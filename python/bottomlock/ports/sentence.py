"""Text for what speaks nothing else: NMEA-like sentences with checksum, every number with all its digits.

    $PBLKV,1,time_ns,mode,state,rank,reset,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz*HH
    $PBLKA,1,time_ns,k,rank,ax,ay,az,v,var*HH

PBLKV holds the velocity (m/s, forward-right-down) and the upper triangle of its covariance (m²/s²); a component that is
not determined is an empty field. One PBLKA for each principal axis that the beams determine follows where components
are missing: unit vector, velocity along it and variance; the axes are independent. The first number is the version
of the layout. Lines are longer than the 82 characters of NMEA 0183.
"""

import math

from bottomlock.io.sentences import xor_of
from bottomlock.ports.estimate import Estimate
from bottomlock.ports.port import Port

_VERSION = "1"
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class Sentence(Port):
    """Velocity, covariance, rank and state as text; sent at every rank from 1 on."""

    name = "sentence"

    def _refuses(self, estimate: Estimate) -> str | None:
        if estimate.complete or estimate.rank > 0:
            return None
        return "the beams determine 0 of 3 axes"

    def _message(self, estimate: Estimate) -> bytes:
        covariance = [float(estimate.covariance_m2ps2[place]) for place in _UPPER]
        head = (str(estimate.time_ns), estimate.mode, estimate.state)
        counts = (str(estimate.rank), str(estimate.reset_counter))
        numbers = (_text(value) for value in (*estimate.velocity_p_mps.tolist(), *covariance))
        data = sentence("PBLKV", _VERSION, *head, *counts, *numbers)
        if estimate.complete:
            return data
        axes, along, variance = estimate.observable_axes()
        for k in range(estimate.rank):
            values = (*axes[k].tolist(), float(along[k]), float(variance[k]))
            place = (_VERSION, str(estimate.time_ns), str(k + 1), str(estimate.rank))
            data += sentence("PBLKA", *place, *(_text(value) for value in values))
        return data


def _text(value: float) -> str:
    return repr(value) if math.isfinite(value) else ""


def sentence(*fields: str) -> bytes:
    r"""A sentence with its checksum, the exclusive or of what stands between $ and *.

    >>> sentence("GPGLL", "5300.97914", "N", "00259.98174", "E", "125926", "A")
    b'$GPGLL,5300.97914,N,00259.98174,E,125926,A*28\r\n'
    """
    body = ",".join(fields).encode("ascii")
    return b"$" + body + f"*{xor_of(body):02X}\r\n".encode()
