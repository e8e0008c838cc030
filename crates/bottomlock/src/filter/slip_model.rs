//! Variance and time constant of a slip through the water, estimated from pings that determine the whole velocity.
//!
//! The sway of such a ping, without what the current, the sway gain or the trim account for, is the slip and the noise of the
//! beams. For each of a grid of variances and time constants a small Kalman filter (three constants of the motion and the slip)
//! gives the likelihood of what was measured so far. The prior weighs as a number of pseudo-observations that the prior's own
//! slip would give; the likelihood fades, so that the estimate follows a vehicle that changes, up and down.

use nalgebra::{SMatrix, SVector};

use super::slip_test::Alarm;
use crate::error::{NavError, require_finite, require_positive};

/// States of a small filter: three constants and the slip.
const STATES: usize = 4;
const SLIP: usize = 3;
/// Standard deviations of the grid over that of the centre, in octaves.
const OCTAVES: [i32; 9] = [-3, -2, -1, 0, 1, 2, 3, 4, 5];
/// Time constants of the grid over that of the centre.
const TIMES: [f64; 4] = [0.25, 1.0, 4.0, 16.0];
/// Time in which the likelihood of what was measured fades, s.
const MEMORY_S: f64 = 600.0;
/// 1 sigma of the time constant, as a factor: one-step predictions hardly tell a slip from one that is larger and lasts longer.
const FACTOR_OF_TIME: f64 = 4.0;
/// Interval of the prior's pseudo-observations over its time constant.
const PSEUDO_STEP: f64 = 0.2;
/// A ping that no slip of the grid explains within so many standard deviations is an outlier.
const OUTLIER: f64 = 5.0;
/// Slip of a vehicle of which nothing is known, m/s and s: that of one that is moved sideways for minutes by thrusters (the preset
/// `hovering`). The first alarm widens at least to it.
const UNKNOWN_MPS: f64 = 0.3;
const UNKNOWN_S: f64 = 60.0;
/// An alarm multiplies the standard deviation and, for a slip that lasts, the time constant.
const LARGER: f64 = 2.0;
const LONGER: f64 = 4.0;
/// Bounds that alarms do not exceed, m/s and s: beyond them an assumption has no weight.
const LARGEST_MPS: f64 = 10.0;
const LONGEST_S: f64 = 3600.0;

type State = SVector<f64, STATES>;

/// A small filter with its slip's standard deviation and time constant.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
struct Node {
    variance: f64,
    time_s: f64,
    estimate: State,
    covariance: SMatrix<f64, STATES, STATES>,
    /// Logarithm of prior and of likelihood, without constants.
    log_prior: f64,
    log_likelihood: f64,
}

/// A measured slip: `measured` = Σ by · constants + slip + n.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeasuredSlip {
    pub(super) measured_mps: f64,
    pub(super) by: [f64; SLIP],
    pub(super) variance: f64,
}

/// Variance and time constant of a slip.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct SlipModel {
    /// Of the slip, (m/s)² and s.
    variance: f64,
    time_s: f64,
    /// The centre of the grid: the prior, moved by alarms.
    centre: (f64, f64),
    /// Pseudo-observations of the prior.
    weight: f64,
    /// Variances of the three constants.
    constants: [f64; SLIP],
    /// Time since the slip was last measured, s.
    since_s: f64,
    /// Empty until something was measured.
    nodes: Vec<Node>,
}

impl SlipModel {
    /// The prior: standard deviation squared and time constant of the slip, its weight in pseudo-observations, and the variances
    /// of the three constants.
    pub(super) fn new(variance: f64, time_s: f64, weight: f64, constants: [f64; SLIP]) -> Self {
        Self {
            variance,
            time_s,
            centre: (variance, time_s),
            weight,
            constants,
            since_s: 0.0,
            nodes: Vec::new(),
        }
    }

    pub(super) fn variance(&self) -> f64 {
        self.variance
    }

    pub(super) fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Widens the slip after an alarm, which shows that the vehicle is not the one assumed, and begins to measure it anew.
    pub(super) fn widen(&mut self, alarm: Alarm) {
        let time_s = self.time_s;
        let is_lasting = matches!(alarm, Alarm::Lasting(window_s) if window_s > time_s);
        let longer_s = if is_lasting { time_s * LONGER } else { time_s };
        let sd_mps = (self.variance.sqrt() * LARGER).clamp(UNKNOWN_MPS, LARGEST_MPS);
        self.variance = self.variance.max(sd_mps * sd_mps);
        self.time_s = time_s.max(longer_s.clamp(UNKNOWN_S, LONGEST_S));
        self.centre = (self.variance, self.time_s);
        self.nodes.clear();
    }

    /// Lets time pass.
    pub(super) fn wait(&mut self, duration_s: f64) {
        self.since_s += duration_s;
    }

    /// Takes a measured slip.
    pub(super) fn learn(&mut self, slip: &MeasuredSlip) {
        if self.nodes.is_empty() {
            self.begin();
        }
        let since_s = std::mem::replace(&mut self.since_s, 0.0);
        let fading = (-since_s / MEMORY_S).exp();
        self.nodes.iter_mut().for_each(|node| node.predict(since_s, fading));
        let expected: Vec<(f64, f64)> = self.nodes.iter().map(|node| node.innovation(slip)).collect();
        if expected.iter().all(|(z, s)| z * z > OUTLIER * OUTLIER * s) {
            return;
        }
        for (node, (z, s)) in self.nodes.iter_mut().zip(expected) {
            node.update(slip, z, s);
        }
        self.summarise();
    }

    /// The grid about its centre.
    fn begin(&mut self) {
        let (centre_variance, centre_s) = self.centre;
        let step = (-PSEUDO_STEP).exp();
        for octave in OCTAVES {
            for longer in TIMES {
                let (variance, time_s) = (centre_variance * 4_f64.powi(octave), centre_s * longer);
                // Expected log-likelihood of a pseudo-observation of the centre's slip by this node's one-step prediction.
                let left = (-PSEUDO_STEP / longer).exp();
                let own = variance * (1.0 - left * left);
                let seen = centre_variance * (1.0 - 2.0 * step * left + left * left);
                let mut initial = State::zeros();
                initial[SLIP] = variance;
                self.constants
                    .iter()
                    .enumerate()
                    .for_each(|(k, &value)| initial[k] = value);
                self.nodes.push(Node {
                    variance,
                    time_s,
                    estimate: State::zeros(),
                    covariance: SMatrix::from_diagonal(&initial),
                    log_prior: -0.5
                        * (self.weight * (own.ln() + seen / own) + (longer.ln() / FACTOR_OF_TIME.ln()).powi(2)),
                    log_likelihood: 0.0,
                });
            }
        }
    }

    /// The means of variance and, by its logarithm, of time constant over the grid.
    fn summarise(&mut self) {
        let weight = |node: &Node| node.log_prior + node.log_likelihood;
        let most = self.nodes.iter().map(weight).fold(f64::NEG_INFINITY, f64::max);
        let (mut total, mut variance, mut log_time) = (0.0, 0.0, 0.0);
        for node in &self.nodes {
            let share = (weight(node) - most).exp();
            total += share;
            variance += share * node.variance;
            log_time += share * node.time_s.ln();
        }
        self.variance = variance / total;
        self.time_s = (log_time / total).exp();
    }

    /// Checks a model that was read from bytes.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        require_positive("slip variance", self.variance)?;
        require_positive("slip time", self.time_s)?;
        require_positive("slip variance", self.centre.0)?;
        require_positive("slip time", self.centre.1)?;
        require_finite("time since the slip was measured", time_ns, &[self.since_s])?;
        require_positive("weight of the slip's prior", self.weight)?;
        require_finite("variances of the slip's constants", time_ns, &self.constants)?;
        self.nodes.iter().try_for_each(|node| {
            require_positive("slip variance", node.variance)?;
            require_positive("slip time", node.time_s)?;
            require_finite("slip states", time_ns, node.estimate.as_slice())?;
            require_finite("slip states", time_ns, node.covariance.as_slice())?;
            require_finite("slip likelihood", time_ns, &[node.log_prior, node.log_likelihood])
        })
    }
}

impl Node {
    fn predict(&mut self, since_s: f64, fading: f64) {
        let left = (-since_s / self.time_s).exp();
        self.estimate[SLIP] *= left;
        for k in 0..SLIP {
            self.covariance[(k, SLIP)] *= left;
            self.covariance[(SLIP, k)] *= left;
        }
        let own = self.covariance[(SLIP, SLIP)];
        self.covariance[(SLIP, SLIP)] = left * left * own + (1.0 - left * left) * self.variance;
        self.log_likelihood *= fading;
    }

    /// Innovation and its variance.
    fn innovation(&self, slip: &MeasuredSlip) -> (f64, f64) {
        let row = row(slip);
        (
            slip.measured_mps - row.dot(&self.estimate),
            row.dot(&(self.covariance * row)) + slip.variance,
        )
    }

    fn update(&mut self, slip: &MeasuredSlip, z: f64, s: f64) {
        let gain = self.covariance * row(slip) / s;
        self.estimate += gain * z;
        self.covariance -= gain * s * gain.transpose();
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        self.log_likelihood -= 0.5 * (s.ln() + z * z / s);
    }
}

fn row(slip: &MeasuredSlip) -> State {
    let [a, b, c] = slip.by;
    State::new(a, b, c, 1.0)
}

#[cfg(test)]
#[path = "slip_model_tests.rs"]
mod tests;
