//! The backward pass by hand, against a dense batch solution, and after a replay.

use super::*;
use crate::testing::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A matrix over the first states, embedded in one over all 20.
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
        weighted_innovation: &weight * z,
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

/// A scalar by hand: x₀ ~ N(0, 1), measured as 1 with variance 1; random walk of variance 1; measured as 2 with
/// variance 1/2.
///
/// Filter: x̂ = 1/2, P = 1/2; P⁻ = 3/2, S = 2, K = 3/4, x̂ = 1/2 + 3/4·3/2 = 13/8, P = 3/8. Batch: for x₀ the second
/// measurement has variance 3/2, so x₀ has information 1 + 1 + 2/3 and mean (1 + 2·2/3)/(8/3) = 7/8, variance 3/8.
#[test]
fn scalar_by_hand() {
    let one = |x: f64| DMatrix::from_element(1, 1, x);
    let mut tape = Tape::default();
    tape.push(update(DVector::from_element(1, 1.0), &one(2.0), one(1.0), one(0.5)));
    tape.push(sample(0.5, 0.5));
    tape.push(Step::Transition(DMatrix::identity(DIM, DIM)));
    tape.push(update(DVector::from_element(1, 1.5), &one(2.0), one(1.0), one(0.75)));
    tape.push(sample(13.0 / 8.0, 3.0 / 8.0));
    let [first, last] = &smooth(tape, &Stop::new()).unwrap()[..] else {
        panic!("two samples")
    };
    assert!((first.state.position_t_m.0.x - 7.0 / 8.0).abs() < 1e-15);
    assert!((first.covariance[(0, 0)] - 3.0 / 8.0).abs() < 1e-15);
    assert_eq!(
        (last.state.position_t_m.0.x, last.covariance[(0, 0)]),
        (13.0 / 8.0, 3.0 / 8.0)
    );
}

/// The joint distribution of the errors of three states at all steps, before any feedback, and the measurements of
/// them.
struct History {
    joint: DMatrix<f64>,
    rows: DMatrix<f64>,
    noise: DMatrix<f64>,
    readings: DVector<f64>,
}

impl History {
    fn new(steps: usize, p0: &Matrix3<f64>) -> Self {
        let states = 3 * (steps + 1);
        let mut joint = DMatrix::zeros(states, states);
        joint.view_mut((0, 0), (3, 3)).copy_from(p0);
        Self {
            joint,
            rows: DMatrix::zeros(2 * steps, states),
            noise: DMatrix::zeros(2 * steps, 2 * steps),
            readings: DVector::zeros(2 * steps),
        }
    }

    fn propagate(&mut self, k: usize, phi: &Matrix3<f64>, q: &Matrix3<f64>) {
        let (old, new) = (3 * k, 3 * (k + 1));
        let cross = phi * self.joint.rows(old, 3);
        self.joint
            .view_mut((new, 0), (3, new))
            .copy_from(&cross.columns(0, new));
        self.joint
            .view_mut((0, new), (new, 3))
            .copy_from(&cross.columns(0, new).transpose());
        let covariance = phi * self.joint.view((old, old), (3, 3)) * phi.transpose() + q;
        self.joint.view_mut((new, new), (3, 3)).copy_from(&covariance);
    }

    fn measure(&mut self, k: usize, h: &SMatrix<f64, 2, 3>, r: &SMatrix<f64, 2, 2>, y: &SMatrix<f64, 2, 1>) {
        self.rows.view_mut((2 * k, 3 * (k + 1)), (2, 3)).copy_from(h);
        self.noise.view_mut((2 * k, 2 * k), (2, 2)).copy_from(r);
        self.readings.rows_mut(2 * k, 2).copy_from(y);
    }

    /// Mean and covariance conditioned on all measurements.
    fn conditioned(&self) -> (DVector<f64>, DMatrix<f64>) {
        let s = &self.rows * &self.joint * self.rows.transpose() + &self.noise;
        let gain = &self.joint * self.rows.transpose() * s.try_inverse().unwrap();
        (&gain * &self.readings, &self.joint - &gain * &self.rows * &self.joint)
    }
}

fn sample_of_three(x: &Vector3<f64>, p: &Matrix3<f64>) -> Step {
    let mut state = NavState::at_rest(0);
    state.position_t_m.0 = *x;
    let mut covariance = DMatrix::zeros(DIM, DIM);
    covariance.view_mut((0, 0), (3, 3)).copy_from(p);
    Step::Sample {
        pending: DMatrix::identity(DIM, DIM),
        state: Box::new(state),
        covariance,
    }
}

/// Three states with random dynamics and noise that depends on the error state (n = D δx + …): smoothed samples are the
/// joint distribution of the whole history, conditioned on all measurements at once.
#[test]
fn dense_batch_with_correlated_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(20260404);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for _ in 0..20 {
        let steps = 6;
        let mut tape = Tape::default();
        let p0 = Matrix3::identity() * 2.0;
        let mut history = History::new(steps, &p0);
        let (mut x, mut p) = (Vector3::zeros(), p0);
        tape.push(sample_of_three(&x, &p));
        for k in 0..steps {
            let phi = Matrix3::identity() + Matrix3::from_fn(|_, _| 0.3 * normal());
            let root = Matrix3::from_fn(|_, _| 0.2 * normal());
            let q = root * root.transpose();
            history.propagate(k, &phi, &q);
            let h = SMatrix::<f64, 2, 3>::from_fn(|_, _| normal());
            let d = SMatrix::<f64, 2, 3>::from_fn(|_, _| 0.3 * normal());
            let r = SMatrix::<f64, 2, 2>::from_diagonal_element(0.4);
            let y = SMatrix::<f64, 2, 1>::from_fn(|_, _| normal());
            history.measure(k, &(h + d), &r, &y);

            // The filter with such noise: C = P Dᵀ, and the independent noise in R. The reading depends on x̂ through D
            // too.
            p = phi * p * phi.transpose() + q;
            x = phi * x;
            tape.push(Step::Transition(embedded(
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
            tape.push(sample_of_three(&x, &p));
        }
        let (mean, covariance) = history.conditioned();
        for (k, smoothed) in smooth(tape, &Stop::new()).unwrap().iter().enumerate() {
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
    // Scaled by the size of each state, so that states of different units are comparable.
    let scale = [
        1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2, 0.05, 0.05, 0.05, 5e-3, 5e-3, 5e-3, 1e-5, 1e-5, 1e-5, 5e-3, 5e-3, 5e-3, 5e-3,
        7e-3,
    ];
    Covariance::from_fn(|i, j| p[(i, j)] / (scale[i] * scale[j]))
        .symmetric_eigenvalues()
        .min()
}

/// For every method with a smoother the smoothed covariance is at most that of the filter (Loewner order), positive,
/// and equal after the last update; recording does not change the filter.
#[test]
fn smoothed_covariance_is_at_most_the_filtered_one() {
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

/// TC, the information form and exact VB have the same smoothed estimates.
#[test]
fn equivalent_methods_have_equal_smoothers() {
    let mut recording = steady_turn(12);
    // Beam errors of a realistic size, so that updates correct something.
    for (k, ping) in recording.pings.iter_mut().enumerate() {
        (0..4).for_each(|beam| ping.velocity_mps[beam] += 0.02 * ((7 * k + 3 * beam) as f64).sin());
        ping.valid = [0, 1].into_iter().collect();
    }
    let mut options = Options::default();
    options.assumptions.exact_virtual_beams = true;
    let samples: Vec<i64> = (0..12).map(|k| k * 1_000_000_000).collect();
    let mut request = recording.replay(&options, &samples);
    let methods: Vec<_> = ["tc", "info", "vb"]
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
