"""The product's partial-beam methods against the paper's closed forms for beams 1 and 2, to 1e-12."""

from typing import Any, NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import bottomlock
from bottomlock.kernel import FixMethod
from tests.oracle import beams, selector
from tests.oracle import partial_closed_forms as paper
from tests.oracle.rotations import Array
from tests.property import strategies as sea

tilts = st.floats(np.deg2rad(15), np.deg2rad(35))
sds = st.floats(0.01, 0.1)
readings = st.floats(-3, 3)
VALID = np.array([[True, True, False, False]])


class Ping(NamedTuple):
    """Tilt of the Janus, and readings and deviations of beams 1 and 2."""

    tilt: float
    y1: float
    y2: float
    sd1: float
    sd2: float

    def solved(self, method: FixMethod, **more: Any) -> tuple[bottomlock.VelocityFixes, Array]:  # noqa: ANN401
        """The fix, a lost beam carrying NaN, and the directions of the beams."""
        janus, sd = bottomlock.BeamGeometry.janus(self.tilt), np.array([self.sd1, self.sd2, 0.042, 0.042])
        y = np.array([[self.y1, self.y2, np.nan, np.nan]])
        fix = bottomlock.solve_velocity(janus, y, VALID, method=method, beam_sd_mps=sd, **more)
        return fix, beams.x_janus(self.tilt)


PINGS = st.builds(Ping, tilts, readings, readings, sds, sds)
EPSILONS = st.floats(1e-4, 1e-1)


def prior_of(velocity: Array, cov: Array) -> dict[str, Any]:
    return {"prior_velocity_p_mps": velocity[None], "prior_cov_m2ps2": cov[None]}


def close(got: Array | float, expected: Array | float) -> None:
    """To 1e-12 of the largest number in play."""
    scale = max(1.0, float(np.abs(np.asarray(expected)).max()))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * scale)


@given(PINGS, sea.velocities, sea.covariances(0.05), st.floats(1, 10))
def test_virtual_beam(ping: Ping, prior: Array, cov: Array, n_f: float) -> None:
    """Eqs. 25 and 30, with the whole prior covariance in Eq. 28 (erratum E6)."""
    fix, b = ping.solved("virtual_beam", virtual_beam_factor=n_f, **prior_of(prior, cov))
    _, y1, y2, sd1, sd2 = ping
    close(fix.velocity_p_mps[0], paper.virtual_beam_velocity(b, y1, y2, prior))
    sd3 = paper.third_beam_sd_corrected(b, cov, n_f)
    close(fix.cov_m2ps2[0], paper.virtual_beam_covariance_by_propagation(b, sd1, sd2, sd3))
    assert fix.status[0] == 0


@given(PINGS, EPSILONS)
def test_nullified_sway(ping: Ping, epsilon: float) -> None:
    """Eqs. 33 and 35: R₀ as printed for surge; for heave plus what the sway's ε leaks into it."""
    fix, b = ping.solved("nullified_sway", nullified_sway_var_m2ps2=epsilon)
    _, y1, y2, sd1, sd2 = ping
    close(fix.velocity_p_mps[0], paper.nullified_sway_velocity(b, y1, y2))
    cov, R_0 = fix.cov_m2ps2[0], paper.nullified_sway_r0(b, sd1, sd2)
    close(cov, paper.nullified_sway_covariance_corrected(b, sd1, sd2, epsilon))
    close(cov[0, 0], R_0[0, 0])
    close(cov[0, 2], R_0[0, 1])
    close(cov[2, 2] - epsilon * (b[0, 1] / b[0, 2]) ** 2, R_0[1, 1])


@given(PINGS)
def test_partial_loose(ping: Ping) -> None:
    """Eqs. 40 and 41; sway and heave are absent rather than infinitely uncertain (Eq. 43)."""
    fix, b = ping.solved("partial_loose")
    _, y1, y2, sd1, sd2 = ping
    close(fix.velocity_p_mps[0, 0], paper.partial_loose_surge(b, y1, y2))
    close(fix.cov_m2ps2[0, 0, 0], paper.partial_loose_surge_variance(b, sd1, sd2))
    assert np.isnan(fix.velocity_p_mps[0, 1:]).all()
    assert fix.component[0].tolist() == [0, 2, 2]


@given(PINGS, sea.velocities, sea.covariances(0.05))
def test_virtual_heave(ping: Ping, prior: Array, cov: Array) -> None:
    """Eqs. 40, 45 and 46 with the plus sign of erratum E1, never the printed minus; heave is not handed back."""
    fix, b = ping.solved("virtual_heave", **prior_of(prior, cov))
    (_, y1, y2, sd1, sd2), heave_sd = ping, float(np.sqrt(cov[2, 2]))
    got = fix.cov_m2ps2[0]
    close(fix.velocity_p_mps[0, 0], paper.partial_loose_surge(b, y1, y2))
    close(fix.velocity_p_mps[0, 1], paper.virtual_heave_sway(b, y1, y2, prior[2]))
    close(got[0, 0], paper.partial_loose_surge_variance(b, sd1, sd2))
    close(got[1, 1], paper.virtual_heave_sway_variance_corrected(b, sd1, sd2, heave_sd))
    close(got[0, 1], paper.virtual_heave_cross_covariance(b, sd1, sd2))
    assert got[1, 1] > paper.virtual_heave_sway_variance_as_printed(b, sd1, sd2, heave_sd)
    assert np.isnan(fix.velocity_p_mps[0, 2])


@given(PINGS, sea.velocities, sea.covariances(0.05), EPSILONS)
def test_selector(ping: Ping, prior: Array, cov: Array, epsilon: float) -> None:
    """Eqs. 48 and 49: per axis the least of the four variances, diagonal, each with its own method's velocity."""
    fix, b = ping.solved("selector", nullified_sway_var_m2ps2=epsilon, **prior_of(prior, cov))
    _, y1, y2, sd1, sd2 = ping
    surge = paper.partial_loose_surge_variance(b, sd1, sd2)
    sway = paper.virtual_heave_sway_variance_corrected(b, sd1, sd2, float(np.sqrt(cov[2, 2])))
    sd3 = paper.third_beam_sd_corrected(b, cov, 1.0)
    variances = {
        "VB": np.diag(paper.virtual_beam_covariance_by_propagation(b, sd1, sd2, sd3)),
        "NSV": np.diag(paper.nullified_sway_covariance_corrected(b, sd1, sd2, epsilon)),
        "PLCF": np.array([surge, np.inf, np.inf]),
        "VHV": np.array([surge, sway, np.inf]),
    }
    values = {
        "VB": paper.virtual_beam_velocity(b, y1, y2, prior),
        "NSV": paper.nullified_sway_velocity(b, y1, y2),
        "PLCF": np.array([paper.partial_loose_surge(b, y1, y2), np.nan, np.nan]),
        "VHV": np.array(
            [paper.partial_loose_surge(b, y1, y2), paper.virtual_heave_sway(b, y1, y2, prior[2]), np.nan]
        ),
    }
    codes = {2: "VB", 3: "NSV", 4: "PLCF", 5: "VHV"}
    names, R = selector.select(variances)
    got = fix.cov_m2ps2[0]
    for axis in range(3):
        close(got[axis, axis], R[axis, axis])
        name = codes[int(fix.source[0, axis])]
        close(fix.velocity_p_mps[0, axis], values[name][axis])
        # Another name than the oracle's only where both claim the same variance.
        close(variances[name][axis], variances[names[axis]][axis])
    assert np.abs(got - np.diag(np.diag(got))).max() == 0
