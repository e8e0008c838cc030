//! Inertial readings integrated along a segment from its own beginning: no attitude is needed.
//!
//! In the axes b₀ of the platform at the beginning, with C the rotation from the platform to b₀, C(t) v(t) − ∫ C f dt = v₀ + g t is a
//! straight line, whatever the attitude. Here are C and the integrals that such a line is fitted with, by the trapezoidal rule.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::error::{NavError, require_finite};

/// Integrals at a reading of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentIntegrals {
    /// C, from the platform to its axes at the segment's beginning.
    pub rotation: Matrix3<f64>,
    /// ∫ C f dt, m/s.
    pub force_mps: Vector3<f64>,
    /// ∫ C dt, s.
    pub rotation_s: Matrix3<f64>,
    /// Column j: ∫ (∫ C dt eⱼ) × C f dt, the effect of a gyro bias along axis j on the velocity, m.
    pub bias: Matrix3<f64>,
}

/// The integrals at every reading of a segment.
///
/// # Errors
/// [`NavError::NotFinite`] for a reading that is not, with its time.
pub fn integrate_segment(
    time_ns: &[i64],
    force_p_mps2: &[[f64; 3]],
    omega_p_radps: &[[f64; 3]],
) -> Result<Vec<SegmentIntegrals>, NavError> {
    let mut now = SegmentIntegrals {
        rotation: Matrix3::identity(),
        force_mps: Vector3::zeros(),
        rotation_s: Matrix3::zeros(),
        bias: Matrix3::zeros(),
    };
    let (mut felt, mut pushed) = (Vector3::zeros(), Matrix3::zeros());
    let mut integrals = Vec::with_capacity(time_ns.len());
    for (k, ((&at_ns, force), rate)) in time_ns.iter().zip(force_p_mps2).zip(omega_p_radps).enumerate() {
        require_finite("force_p_mps2", at_ns, force)?;
        require_finite("omega_p_radps", at_ns, rate)?;
        let (rotation_before, felt_before, pushed_before) = (now.rotation, felt, pushed);
        let mut half_s = 0.0;
        if k > 0 {
            half_s = 0.5 * (at_ns - time_ns[k - 1]) as f64 * 1e-9;
            let turn = (Vector3::from(omega_p_radps[k - 1]) + Vector3::from(*rate)) * half_s;
            now.rotation *= Rotation3::new(turn).matrix();
        }
        felt = now.rotation * Vector3::from(*force);
        now.force_mps += (felt_before + felt) * half_s;
        now.rotation_s += (rotation_before + now.rotation) * half_s;
        pushed = Matrix3::from_columns(&[0, 1, 2].map(|j| now.rotation_s.column(j).cross(&felt)));
        now.bias += (pushed_before + pushed) * half_s;
        integrals.push(now);
    }
    Ok(integrals)
}

/// The integrals of segments of `readings` readings each, one segment after the other.
///
/// # Errors
/// As [`integrate_segment`]; [`NavError::Setting`] for readings that do not divide into segments.
pub fn integrate_segments(
    time_ns: &[i64],
    force_p_mps2: &[[f64; 3]],
    omega_p_radps: &[[f64; 3]],
    readings: usize,
) -> Result<Vec<SegmentIntegrals>, NavError> {
    if readings == 0 || !time_ns.len().is_multiple_of(readings) {
        let expected = format!("a number by which the {} readings divide into segments", time_ns.len());
        return Err(NavError::setting("readings", format!("is {readings}"), expected));
    }
    let motions = force_p_mps2.chunks(readings).zip(omega_p_radps.chunks(readings));
    let mut integrals = Vec::with_capacity(time_ns.len());
    for (times, (forces, rates)) in time_ns.chunks(readings).zip(motions) {
        integrals.extend(integrate_segment(times, forces, rates)?);
    }
    Ok(integrals)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HZ: f64 = 50.0;

    fn times(count: usize) -> Vec<i64> {
        (0..count).map(|k| (k as f64 / HZ * 1e9).round() as i64).collect()
    }

    /// About one axis at a constant rate: C is the turn by ω t, ∫C dt has sin ωt/ω, and a force along the axis is felt unchanged.
    #[test]
    fn a_constant_turn() {
        let (rate, force) = (0.3, 9.8);
        let integrals = integrate_segment(&times(201), &[[0.0, 0.0, -force]; 201], &[[0.0, 0.0, rate]; 201]).unwrap();
        let (last, t) = (integrals[200], 4.0);
        let (s, c) = (rate * t).sin_cos();
        assert!((last.rotation - Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)).amax() < 1e-12);
        assert!((last.force_mps - Vector3::new(0.0, 0.0, -force * t)).amax() < 1e-12);
        let swept = Matrix3::new(s, c - 1.0, 0.0, 1.0 - c, s, 0.0, 0.0, 0.0, rate * t) / rate;
        assert!((last.rotation_s - swept).amax() < 1e-4);
        // A bias about the level axis tilts the force: ∫ (sin ωt/ω)(−f) across.
        assert!((last.bias[(1, 0)] - force * (1.0 - c) / rate.powi(2)).abs() < 1e-3);
    }

    /// The effect of a gyro bias is the derivative of ∫ C f dt by it.
    #[test]
    fn the_effect_of_a_bias_is_a_derivative() {
        let count = 300;
        let at = |k: usize, j: usize| ((k * (j + 2)) as f64 * 0.013).sin();
        let force: Vec<[f64; 3]> = (0..count).map(|k| [at(k, 0), at(k, 1), -9.8 + at(k, 2)]).collect();
        let omega: Vec<[f64; 3]> = (0..count).map(|k| [0.2, 0.5, 0.3].map(|w| w * at(k, 3))).collect();
        let along = |j: usize, size: f64| {
            let mut biased = omega.clone();
            biased.iter_mut().for_each(|rate| rate[j] += size);
            integrate_segment(&times(count), &force, &biased).unwrap()[count - 1].force_mps
        };
        let own = integrate_segment(&times(count), &force, &omega).unwrap()[count - 1];
        for j in 0..3 {
            let numerical = (along(j, 1e-5) - along(j, -1e-5)) / 2e-5;
            assert!((numerical - own.bias.column(j)).amax() < 2e-3 * own.bias.amax(), "{j}");
        }
    }

    #[test]
    fn a_reading_that_is_no_number_is_named() {
        let error = integrate_segment(&[0, 20], &[[0.0; 3], [f64::NAN, 0.0, 0.0]], &[[0.0; 3]; 2]).unwrap_err();
        assert!(error.to_string().contains("force_p_mps2"), "{error}");
    }
}
