"""The product's beams against Eqs. 13-16 under random instruments and motions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import bottomlock
from tests.oracle import beams as oracle
from tests.oracle.rotations import Array, matrix_from_euler
from tests.property import strategies as sea


@given(tilt=st.floats(0.05, 1.5))
def test_x_janus_is_equations_13_and_14(tilt: float) -> None:
    """The named instrument is the paper's, for any tilt."""
    geometry = bottomlock.BeamGeometry.janus(tilt)
    np.testing.assert_allclose(geometry.directions_p, oracle.x_janus(tilt), atol=1e-15)


@given(tilt=sea.numbers(0.05, 1.5, 5), azimuth=sea.numbers(-6, 6, 5))
def test_beams_from_angles_are_equation_13(tilt: Array, azimuth: Array) -> None:
    """Each beam has its own two angles, for any number of beams."""
    geometry = bottomlock.BeamGeometry.from_angles(tilt, azimuth)
    expected = [oracle.direction(t, a) for t, a in zip(tilt, azimuth, strict=True)]
    np.testing.assert_allclose(geometry.directions_p, expected, atol=1e-15)


@given(
    instrument=sea.instruments(least=1, most=8),
    velocity=sea.velocities,
    rate=sea.rates,
    scale=st.floats(-0.05, 0.05),
    sound=st.floats(0.95, 1.05),
    data=st.data(),
)
def test_readings_are_equation_15(
    instrument: sea.Instrument, velocity: Array, rate: Array, scale: float, sound: float, data: st.DataObject
) -> None:
    """Every term of Eq. 15 at once; a wrong sound speed multiplies the whole reading (Eq. 12)."""
    bias = data.draw(sea.numbers(-0.1, 0.1, instrument.beams))
    geometry = bottomlock.BeamGeometry(
        instrument.directions, lever_arms_p_m=instrument.levers, sound_speed_scale=sound
    )
    got = geometry.beam_velocities(
        velocity[None], omega_tp_p_radps=rate[None], beam_bias_mps=bias, scale_factor=scale
    )
    expected = [
        sound * oracle.beam_velocity(b, velocity, rate, lever, offset, scale)
        for b, lever, offset in zip(instrument.directions, instrument.levers, bias, strict=True)
    ]
    np.testing.assert_allclose(got[0], expected, atol=1e-13)


@given(instrument=sea.instruments(), angles=sea.angles)
def test_mounting_turns_the_directions(
    instrument: sea.Instrument, angles: tuple[float, float, float]
) -> None:
    """Mounting angles map the DVL frame to the platform, roll, pitch, yaw as for attitude; lever arms stay."""
    mounted = bottomlock.BeamGeometry(
        instrument.directions, lever_arms_p_m=instrument.levers, mounting_rpy_rad=np.array(angles)
    )
    turned = instrument.directions @ matrix_from_euler(*angles).T
    np.testing.assert_allclose(mounted.directions_p, turned, atol=1e-14)
    np.testing.assert_array_equal(mounted.lever_arms_p_m, instrument.levers)
