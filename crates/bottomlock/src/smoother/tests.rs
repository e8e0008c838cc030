//! The backward pass by hand, against a dense batch, and after a filter on a log.

use super::*;
use crate::filter::options::Options;
use crate::layout::DVL_BIAS;
use crate::navigator::METHODS;
use crate::replay::replay;
use crate::replay::tests::steady_turn;
use nalgebra::{Matrix3, SMatrix, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A tape over a sub-state that sits in the first of the twenty.
fn embedded(m: DMatrix<f64>, rows: usize, columns: usize) -> DMatrix<f64> {
    let mut whole = if rows == DIM && columns == DIM {
        DMatrix::identity(DIM, DIM)
    } else {
        DMatrix::zeros(rows, columns)
    };
    whole.view_mut((0, 0), m.shape()).copy_from(&m);
    whole
}

fn update(z: DVector<f64>, s: &DMatrix<f64>, h: DMatrix<f64>, gain: DMatrix<f64>) -> Step {
    let weight = s.clone().try_inverse().unwrap();
    let m = z.len();
    Step::Update {
        weighted: &weight * z,
        weight,
        h: embedded(h, m, DIM),
        gain: embedded(gain, DIM, m),
    }
}

fn sample(x: f64, p: f64) -> Step {
    let mut state = NavState::at_rest(0);
    state.position_t_m.0.x = x;
    let mut covariance = DMatrix::zeros(DIM, DIM);
    covariance[(0, 0)] = p;
    Step::Sample {
        pending: DMatrix::identity(DIM, DIM),
        state: Box::new(state),
        covariance,
    }
}

/// A scalar by hand: x₀ ~ N(0, 1), measured 1 with variance 1; walks with variance 1; measured 2 with variance 1/2.
///
/// Filter: x̂ = 1/2, P = 1/2; P⁻ = 3/2, S = 2, K = 3/4, x̂ = 1/2 + 3/4·3/2 = 13/8, P = 3/8. Batch: of x₀ the second measurement is
/// one of variance 3/2, so x₀ has information 1 + 1 + 2/3 and mean (1 + 2·2/3)/(8/3) = 7/8, variance 3/8.
#[test]
fn scalar_by_hand() {
    let one = |x: f64| DMatrix::from_element(1, 1, x);
    let mut tape = Tape::default();
    tape.push(update(DVector::from_element(1, 1.0), &one(2.0), one(1.0), one(0.5)));
    tape.push(sample(0.5, 0.5));
    tape.push(Step::Carry(DMatrix::identity(DIM, DIM)));
    tape.push(update(DVector::from_element(1, 1.5), &one(2.0), one(1.0), one(0.75)));
    tape.push(sample(13.0 / 8.0, 3.0 / 8.0));
    let [first, last] = &smooth(tape).unwrap()[..] else {
        panic!("two samples")
    };
    assert!((first.state.position_t_m.0.x - 7.0 / 8.0).abs() < 1e-15);
    assert!((first.covariance[(0, 0)] - 3.0 / 8.0).abs() < 1e-15);
    assert_eq!(
        (last.state.position_t_m.0.x, last.covariance[(0, 0)]),
        (13.0 / 8.0, 3.0 / 8.0)
    );
}

/// Three states with random dynamics, noise that repeats the filter's own error (n = D δx + …), and samples off the updates: the
/// same as the joint covariance of the whole history, conditioned on all measurements at once.
#[test]
fn dense_batch_with_correlated_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(20260404);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for _ in 0..20 {
        let steps = 6;
        let mut tape = Tape::default();
        let p0 = Matrix3::identity() * 2.0;
        // History: errors of the nominal state at 0, 1, … before any feedback; the joint covariance of all of them.
        let mut joint = DMatrix::zeros(3 * (steps + 1), 3 * (steps + 1));
        joint.view_mut((0, 0), (3, 3)).copy_from(&p0);
        let mut rows = DMatrix::zeros(2 * steps, 3 * (steps + 1));
        let mut noise = DMatrix::zeros(2 * steps, 2 * steps);
        let mut readings = DVector::zeros(2 * steps);
        let (mut x, mut p) = (Vector3::zeros(), p0);
        let put = |tape: &mut Tape, x: &Vector3<f64>, p: &Matrix3<f64>| {
            let mut state = NavState::at_rest(0);
            state.position_t_m.0 = *x;
            let mut covariance = DMatrix::zeros(DIM, DIM);
            covariance.view_mut((0, 0), (3, 3)).copy_from(p);
            tape.push(Step::Sample {
                pending: DMatrix::identity(DIM, DIM),
                state: Box::new(state),
                covariance,
            });
        };
        put(&mut tape, &x, &p);
        for k in 0..steps {
            let phi = Matrix3::identity() + Matrix3::from_fn(|_, _| 0.3 * normal());
            let root = Matrix3::from_fn(|_, _| 0.2 * normal());
            let q = root * root.transpose();
            let (old, new) = (3 * k, 3 * (k + 1));
            let carried = phi * joint.rows(old, 3);
            joint.view_mut((new, 0), (3, new)).copy_from(&carried.columns(0, new));
            joint
                .view_mut((0, new), (new, 3))
                .copy_from(&carried.columns(0, new).transpose());
            let own = phi * joint.view((old, old), (3, 3)) * phi.transpose() + q;
            joint.view_mut((new, new), (3, 3)).copy_from(&own);

            let h = SMatrix::<f64, 2, 3>::from_fn(|_, _| normal());
            let d = SMatrix::<f64, 2, 3>::from_fn(|_, _| 0.3 * normal());
            let r = SMatrix::<f64, 2, 2>::from_diagonal_element(0.4);
            let y = SMatrix::<f64, 2, 1>::from_fn(|_, _| normal());
            rows.view_mut((2 * k, new), (2, 3)).copy_from(&(h + d));
            noise.view_mut((2 * k, 2 * k), (2, 2)).copy_from(&r);
            readings.rows_mut(2 * k, 2).copy_from(&y);

            // The filter as it knows such noise: C = P Dᵀ, and the independent part in R. The reading repeats x̂ through D too.
            p = phi * p * phi.transpose() + q;
            x = phi * x;
            tape.push(Step::Carry(embedded(
                DMatrix::from_fn(3, 3, |i, j| phi[(i, j)]),
                DIM,
                DIM,
            )));
            let c = p * d.transpose();
            let s = h * p * h.transpose() + h * c + c.transpose() * h.transpose() + d * p * d.transpose() + r;
            let gain = (p * h.transpose() + c) * s.try_inverse().unwrap();
            let z = y - (h + d) * x;
            x += gain * z;
            p -= gain * s * gain.transpose();
            tape.push(update(
                DVector::from_column_slice(z.as_slice()),
                &DMatrix::from_fn(2, 2, |i, j| s[(i, j)]),
                DMatrix::from_fn(2, 3, |i, j| (h + d)[(i, j)]),
                DMatrix::from_fn(3, 2, |i, j| gain[(i, j)]),
            ));
            put(&mut tape, &x, &p);
        }
        let s = &rows * &joint * rows.transpose() + &noise;
        let gain = &joint * rows.transpose() * s.try_inverse().unwrap();
        let mean = &gain * &readings;
        let covariance = &joint - &gain * &rows * &joint;
        for (k, smoothed) in smooth(tape).unwrap().iter().enumerate() {
            for i in 0..3 {
                assert!((smoothed.state.position_t_m.0[i] - mean[3 * k + i]).abs() < 1e-11);
                for j in 0..3 {
                    assert!((smoothed.covariance[(i, j)] - covariance[(3 * k + i, 3 * k + j)]).abs() < 1e-11);
                }
            }
        }
    }
}

fn least_eigenvalue(p: &Covariance) -> f64 {
    // Scaled to what each state may be off by, so that metres do not hide radians per second.
    let scale = [
        1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2, 0.05, 0.05, 0.05, 5e-3, 5e-3, 5e-3, 1e-5, 1e-5, 1e-5, 5e-3, 5e-3, 5e-3, 5e-3,
        7e-3,
    ];
    Covariance::from_fn(|i, j| p[(i, j)] / (scale[i] * scale[j]))
        .symmetric_eigenvalues()
        .min()
}

/// For every method that has a smoother, wherever the samples lie: no larger than the filter's covariance (Loewner), not negative,
/// and the filter's own after the last update; and the forward pass does not feel that it is recorded.
#[test]
fn smoothed_is_no_less_sure_than_filtered() {
    let recording = steady_turn(12);
    for covariance_period_ns in [0, 100_000_000] {
        for estimate_dvl in [true, false] {
            let options = Options {
                covariance_period_ns,
                estimate_dvl,
                ..Options::default()
            };
            let samples: Vec<i64> = (0..=46)
                .map(|k| k * 260_000_000)
                .filter(|&t| t <= 12_000_000_000)
                .chain([12_000_000_000])
                .collect();
            let mut request = recording.replay(&options, &samples);
            request.methods = &METHODS[..12];
            let plain = replay(&request, 1).unwrap();
            request.smooth = true;
            let out = replay(&request, 2).unwrap();
            for ((method, track), before) in METHODS.iter().zip(&out.tracks).zip(&plain.tracks) {
                assert_eq!(track.filtered, before.filtered, "{}", method.name);
                assert_eq!(track.smoothed.states.len(), samples.len());
                for (smoothed, filtered) in track.smoothed.covariances.iter().zip(&track.filtered.covariances) {
                    assert!(least_eigenvalue(&(filtered - smoothed)) > -1e-9, "{}", method.name);
                    assert!(least_eigenvalue(smoothed) > -1e-9, "{}", method.name);
                }
                assert_eq!(
                    track.smoothed.states.last(),
                    track.filtered.states.last(),
                    "{}",
                    method.name
                );
                assert_eq!(
                    track.smoothed.covariances.last(),
                    track.filtered.covariances.last(),
                    "{}",
                    method.name
                );
                let frozen = track.smoothed.sd[0][DVL_BIAS];
                assert_eq!(frozen == 0.0, !estimate_dvl, "{}", method.name);
            }
        }
    }
}

/// TC, the information form and exact VB are one filter, and one smoother.
#[test]
fn three_names_for_one_smoother() {
    let mut recording = steady_turn(12);
    // Readings off by what a beam is off by, so that there is something to correct.
    for (k, ping) in recording.pings.iter_mut().enumerate() {
        (0..4).for_each(|beam| ping.velocity_mps[beam] += 0.02 * ((7 * k + 3 * beam) as f64).sin());
        ping.valid = [0, 1].into_iter().collect();
    }
    let options = Options::default();
    let samples: Vec<i64> = (0..12).map(|k| k * 1_000_000_000).collect();
    let mut request = recording.replay(&options, &samples);
    let methods: Vec<_> = ["tc", "info", "vb_exact"]
        .map(|name| crate::navigator::Method::named(name).unwrap())
        .to_vec();
    request.methods = &methods;
    request.smooth = true;
    let out = replay(&request, 1).unwrap();
    let tc = &out.tracks[0].smoothed;
    for other in &out.tracks[1..] {
        for (a, b) in tc.states.iter().zip(&other.smoothed.states) {
            assert!(a.error_of(b).amax() < 1e-9, "{:?}", a.error_of(b));
        }
        for (a, b) in tc.sd.iter().zip(&other.smoothed.sd) {
            (0..DIM).for_each(|k| assert!((a[k] - b[k]).abs() < 1e-9 * (1.0 + a[k])));
        }
    }
}

/// The selector between filters has none.
#[test]
fn a_choice_is_refused() {
    let recording = steady_turn(2);
    let options = Options::default();
    let mut request = recording.replay(&options, &[0]);
    request.smooth = true;
    let error = replay(&request, 1).unwrap_err().to_string();
    assert!(
        error.starts_with("method consistent: a choice between filters has no smoother"),
        "{error}"
    );
}
