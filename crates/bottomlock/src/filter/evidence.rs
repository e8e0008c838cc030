//! The rule of evidence: what readings that are rejected one after another show to be wrong, and what becomes uncertain by it.
//!
//! Correct readings are rejected rarely and one at a time: at 99.73 % five in a row occur once in 10¹². But where an error exceeds
//! its covariance, NIS stays as large as it is and every reading of a mission is rejected. After `inflate_after_rejections` rejected
//! readings of a sensor that agree with each other, the covariance grows until NIS is what it is expected to be, and the reading
//! is tested again. Derived in docs/equations.md:
//!
//! - A slow error of the sensor lasts, so that its readings agree with each other whatever is wrong: over its correlation time
//!   they are one piece of evidence, against which the slow error has the variance of the long run. Where five sigma of it explain them,
//!   all of it is charged to the sensor's own slow states. Else it is divided as by one reading, by variances: those of the
//!   slow states in the long run, and that part of the inertial states' which they do not share with them, P − X C⁻¹ Xᵀ.
//! - What was accepted before has become wrong by what changes: of an offset and a walk of one angle the walk is charged.
//! - Only axes that are contradicted are charged: the vertical or the horizontal ones where either explains the reading, and where both do
//!   those that have to be less wrong for it.
//! - Of the inertial states an angle, a depth, and a position beside an accepted velocity charge those that they measure; a velocity,
//!   and a position else, all of them, since a wrong velocity most often comes from a wrong tilt. A position whose difference moves
//!   faster than the velocity's covariance allows shows a wrong velocity, whatever beams were accepted: one or two measure but a
//!   part of it. What goes beyond five sigma is no error of the tilt and goes to the measured states alone.
//! - An error that lasts below every gate is evidence by the mean of what was accepted (`lasting.rs`).
//! - No evidence: beams that contradict each other whatever the covariance; readings that do not agree from one to the next;
//!   assumptions.
//!
//! # Doubt
//! A velocity that its sensor confirmed a moment ago can have become wrong by five sigma. Beyond that, either the filter was thrown
//! off or the readings are those of fish or of a vessel that passes, and both look alike, until such readings end. Solved
//! velocities therefore make the velocity as uncertain as their difference d, P + d dᵀ, which holds whichever is right: readings on
//! the side of d are not used, one on the side of the filter is and ends the doubt. Beams leave the covariance as it is, since
//! some of them may be right. Either is used after [`LONGEST_DOUBT_NS`], or once it has lasted as long as those accepted before: the
//! first ping after a start counts for less than the two that follow.
//!
//! An angle does not jump, since the gyros would show it, nor does a position beside accepted velocities. Where readings of them do,
//! these are wrong (a compass near iron, fixes by an echo) or those accepted before were. They are used once they have lasted as
//! long as those before, after [`LONGEST_DOUBT_OF_A_JUMP_NS`] at most; the covariance stays as it is. An angle is doubted beyond five
//! sigma, a fix at any size unless its difference moves, which shows a wrong velocity.

use nalgebra::Vector3;

use super::Eskf;
use super::charge::{Charge, Rows, UNINFORMATIVE_FACTOR, by_further, matching_factor, measured_block, norm_squared};
use crate::aiding::{Innovation, TangentRows};
use crate::error::{NavError, require_finite};
use crate::filter::gate::{FIVE_SIGMA_FACTOR, LONGEST_DOUBT_NS};
use crate::filter::report::Sensor;
use crate::layout::{ATTITUDE, POSITION, VELOCITY};
use crate::state::Covariance;

/// Time from the first reading after a jump to the use of such readings, however long those before it had lasted.
const LONGEST_DOUBT_OF_A_JUMP_NS: i64 = 300_000_000_000;

/// Rejected velocities that are evidence where they have lasted as long as those accepted before, as after a start whose first ping
/// was wrong. Set on starts with an autopilot's inertial sensors; tested on fish, lock-outs and recordings.
const FEWEST: u32 = 2;

/// Part of the variance of a doubted difference that is left where nothing has shown which is right.
const STILL_HELD: f64 = 0.25;

/// The runs of rejected readings, by sensor.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Evidence(Box<[Run; Sensor::COUNT]>);

/// Consecutive rejected readings of one sensor that agree.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct Run {
    /// Time of the first.
    since_ns: i64,
    /// Those that an admissible error explains, and those that only a larger one does.
    explained: u32,
    doubtful: u32,
    /// Sum of the logarithms of their factors.
    log_factor: f64,
    /// What the first and the last showed of the measured quantity's error.
    first: Vector3<f64>,
    correction: Vector3<f64>,
    /// Whether the last reading did not agree.
    has_strayed: bool,
    /// Whether the covariance of the velocity holds the correction.
    is_held: bool,
    /// Times of the first and the last of the readings that were accepted since a run was believed.
    accepted_ns: Option<[i64; 2]>,
}

impl Evidence {
    /// Checks runs that were read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.0.iter().try_for_each(|run| {
            require_finite("rejections", time_ns, &[run.log_factor])?;
            require_finite("rejections", time_ns, run.first.as_slice())?;
            require_finite("rejections", time_ns, run.correction.as_slice())
        })
    }
}

impl Run {
    /// Counts a reading. One that does not agree begins the run anew, but for a single one once `needed` are doubtful: an outlier does
    /// not end half a minute of doubt.
    fn push(&mut self, is_doubtful: bool, factor: f64, correction: Vector3<f64>, time_ns: i64, needed: u32) {
        let agrees = agree(&self.correction, &correction);
        if !agrees && self.doubtful >= needed && !self.has_strayed {
            self.has_strayed = true;
            return;
        }
        if self.is_empty() || !agrees {
            *self = Self {
                since_ns: time_ns,
                first: correction,
                ..self.ended()
            };
        }
        self.has_strayed = false;
        self.correction = correction;
        self.log_factor += factor.ln();
        if is_doubtful {
            self.doubtful += 1;
        } else {
            self.explained += 1;
        }
    }

    /// The run once it has ended: what was accepted before it.
    fn ended(&self) -> Self {
        Self {
            accepted_ns: self.accepted_ns,
            ..Self::default()
        }
    }

    /// The run after a reading that was accepted.
    fn accepted(&self, time_ns: i64) -> Self {
        Self {
            accepted_ns: Some([self.accepted_ns.map_or(time_ns, |[first_ns, _]| first_ns), time_ns]),
            ..Self::default()
        }
    }

    /// Time of the first, that of a reading now where there is none.
    fn began_ns(&self, time_ns: i64) -> i64 {
        if self.is_empty() { time_ns } else { self.since_ns }
    }

    /// Time from the first to the last of the readings that were accepted before, `None` without any.
    fn accepted_for_ns(&self) -> Option<i64> {
        self.accepted_ns
            .map(|[first_ns, last_ns]| last_ns.saturating_sub(first_ns))
    }

    /// Time for which a jump of readings is doubted: that for which they had been accepted, `None` where as much had passed
    /// without any when it began.
    fn doubt_of_a_jump_ns(&self, time_ns: i64) -> Option<i64> {
        let ([_, last_ns], lasted_ns) = self.accepted_ns.zip(self.accepted_for_ns())?;
        let is_confirmed = self.began_ns(time_ns).saturating_sub(last_ns) < lasted_ns;
        is_confirmed.then_some(lasted_ns.min(LONGEST_DOUBT_OF_A_JUMP_NS))
    }

    /// Time for which a velocity beyond five sigma is doubted: that for which readings had been accepted, half a minute at most.
    fn doubt_of_a_velocity_ns(&self) -> i64 {
        self.accepted_for_ns().unwrap_or(LONGEST_DOUBT_NS).min(LONGEST_DOUBT_NS)
    }

    /// Whether the run, with a reading now, has lasted as long as what was accepted before it.
    fn has_outlasted(&self, time_ns: i64) -> bool {
        let lasted_ns = time_ns.saturating_sub(self.began_ns(time_ns));
        self.accepted_for_ns()
            .is_some_and(|accepted_ns| lasted_ns >= accepted_ns)
    }

    const fn is_empty(&self) -> bool {
        self.explained + self.doubtful == 0
    }

    /// Geometric mean of the factors.
    fn factor(&self) -> f64 {
        (self.log_factor / f64::from(self.explained + self.doubtful)).exp()
    }
}

/// Returns true if two errors differ by less than half their root sum of squares, as two of an error that grows
/// in proportion to time do.
fn agree(one: &Vector3<f64>, other: &Vector3<f64>) -> bool {
    (other - one).norm_squared() <= 0.25 * (one.norm_squared() + other.norm_squared())
}

impl Eskf {
    /// Number of consecutive rejections that are evidence; 0 for never.
    pub(crate) fn rejections_allowed(&self) -> u32 {
        self.inflate_after_rejections
    }

    /// Whether a velocity of the platform was accepted.
    pub(crate) fn has_velocity(&self) -> bool {
        self.measured.velocity_ns.is_some()
    }

    /// Notes that a reading passed its gate.
    pub(crate) fn note_accepted(&mut self, sensor: Sensor) {
        let time_ns = self.state.time_ns;
        let run = self.run_mut(sensor);
        *run = run.accepted(time_ns);
    }

    fn run(&self, sensor: Sensor) -> &Run {
        &self.evidence.0[sensor as usize]
    }

    /// Time of the first of a run of rejections, now where there is none.
    pub(super) fn rejected_since_ns(&self, sensor: Sensor) -> i64 {
        self.run(sensor).began_ns(self.state.time_ns)
    }

    /// Whether what a run of positions shows moves by more than the velocity's covariance and the noise of two readings allow.
    pub(super) fn is_moving(&self, innovation: &Innovation, sensor: Sensor) -> bool {
        let run = self.run(sensor);
        if run.is_empty() {
            return false;
        }
        let since_s = (self.state.time_ns - run.since_ns) as f64 * 1e-9;
        let rotation = self.rotation();
        let velocity = rotation * self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY) * rotation.transpose();
        let allowed = velocity * since_s.powi(2) + innovation.noise.fixed_view::<3, 3>(0, 0) * 2.0;
        let moved = solved(innovation, POSITION) - run.first;
        let factor = allowed.cholesky();
        factor.is_some_and(|factor| moved.dot(&factor.solve(&moved)) > self.plausible.threshold(3))
    }

    fn run_mut(&mut self, sensor: Sensor) -> &mut Run {
        &mut self.evidence.0[sensor as usize]
    }

    /// Counts a rejected reading with this innovation; returns what has become uncertain by the run that it completes.
    ///
    /// `is_confirmed`: of a velocity, whether what it shows beyond five sigma is doubted; an angle or a fix is confirmed by what was
    /// accepted of it before.
    ///
    /// # Errors
    /// [`NavError::NotFinite`] for an innovation that is not finite.
    pub(crate) fn note_rejected(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
        is_confirmed: bool,
    ) -> Result<Option<Charge>, NavError> {
        if self.inflate_after_rejections == 0 || innovation.rows == 0 {
            return Ok(None);
        }
        self.propagate_covariance();
        require_finite("innovation", self.state.time_ns, innovation.residual.as_slice())?;
        let (time_ns, needed) = (self.state.time_ns, self.inflate_after_rejections);
        if self.is_doubted(innovation, sensor) {
            let run = self.run_mut(sensor);
            run.correction = solved(innovation, VELOCITY);
            let is_over = time_ns - run.since_ns >= run.doubt_of_a_velocity_ns();
            return Ok(is_over.then(|| Charge {
                is_of_all: true,
                ..Charge::none(Some(std::mem::take(run).factor()))
            }));
        }
        if self.is_in_doubt(sensor) {
            return Ok(None);
        }
        if self.run(sensor).is_held {
            let run = self.run_mut(sensor);
            *run = run.ended();
        }
        let with_further_noise = self.with_further_noise(innovation);
        let mut innovation = with_further_noise.as_deref().unwrap_or(innovation).clone();
        self.linearise(&mut innovation);
        innovation.noise[(0, 0)] += self.left_out_variance(&innovation);
        let innovation = &innovation;
        let whole = self.whole_covariance(innovation);
        let limit = self.plausible.threshold(innovation.degrees);
        let explains = |own: &Rows, factor: f64| norm_squared(innovation, &(whole + own * (factor - 1.0))) <= limit;
        if explains(&Rows::zeros(), 1.0) {
            self.note_accepted(sensor);
            return Ok(None);
        }
        let charged = self.charged_states(innovation, sensor, &whole);
        let by_own = by_further(innovation, &charged.own);
        let alone = matching_factor(innovation, &whole, &by_own);
        let unshared = if alone <= FIVE_SIGMA_FACTOR && explains(&by_own, alone) {
            Covariance::zeros()
        } else {
            self.unshared(&charged)
        };
        let by_inertial = innovation.jacobian * unshared * innovation.jacobian.transpose();
        let both = by_inertial + by_own;
        if !explains(&both, UNINFORMATIVE_FACTOR) {
            return Ok(None);
        }
        let block = measured_block(sensor);
        let is_fix = block == POSITION && innovation.rows == 3 && charged.are_measured();
        let doubt_ns = if is_fix || block == ATTITUDE {
            self.run(sensor).doubt_of_a_jump_ns(time_ns)
        } else {
            is_confirmed.then(|| self.run(sensor).doubt_of_a_velocity_ns())
        };
        let is_doubtful = doubt_ns.is_some() && (is_fix || !explains(&both, FIVE_SIGMA_FACTOR));
        let factor = matching_factor(innovation, &whole, &both);
        let run = self.run_mut(sensor);
        let needed = if block == VELOCITY && run.has_outlasted(time_ns) {
            needed.min(FEWEST)
        } else {
            needed
        };
        run.push(is_doubtful, factor, solved(innovation, block), time_ns, needed);
        let is_complete = run.explained >= needed;
        let is_over = doubt_ns.is_some_and(|doubt_ns| time_ns - run.since_ns >= doubt_ns);
        let is_believed = run.doubtful >= needed && is_over;
        if is_complete || is_believed {
            let factor = std::mem::take(run).factor();
            return Ok(self.charge_with(factor, &charged, &unshared, &[by_inertial, by_own], innovation));
        }
        if run.doubtful >= needed && block == VELOCITY && sensor != Sensor::Beams {
            run.is_held = true;
            let mut charge = Charge::none(None);
            let mut velocity = charge.inertial.fixed_view_mut::<3, 3>(VELOCITY, VELOCITY);
            velocity.copy_from(&(run.correction * run.correction.transpose()));
            self.charge(&charge);
            return Ok(Some(charge));
        }
        Ok(None)
    }

    /// Whether the covariance of the velocity still holds the difference that is doubted: other sensors may have shown since which
    /// of the two is right.
    fn is_in_doubt(&self, sensor: Sensor) -> bool {
        let run = self.run(sensor);
        let difference = run.correction;
        run.is_held && {
            let velocity = self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY);
            difference.dot(&(velocity * difference)) >= STILL_HELD * difference.norm_squared().powi(2)
        }
    }

    /// Whether a reading is one of those that are doubted: nearer to what they show than to the filter.
    pub(super) fn is_doubted(&self, innovation: &Innovation, sensor: Sensor) -> bool {
        if innovation.tangent_rows != TangentRows::None || !self.is_in_doubt(sensor) {
            return false;
        }
        let shown = innovation.jacobian.fixed_columns::<3>(VELOCITY) * self.run(sensor).correction;
        2.0 * innovation.residual.dot(&shown) > shown.norm_squared()
    }
}

/// The error of a block of three states that the rows show, of minimum norm where they leave a direction open.
fn solved(innovation: &Innovation, block: usize) -> Vector3<f64> {
    let rows = innovation.jacobian.view((0, block), (innovation.rows, 3)).into_owned();
    let z = innovation.residual.rows(0, innovation.rows);
    rows.pseudo_inverse(1e-6).map_or_else(
        |_| Vector3::zeros(),
        |inverse| {
            let solution = inverse * z;
            Vector3::new(solution[0], solution[1], solution[2])
        },
    )
}

#[cfg(test)]
#[path = "doubt_tests.rs"]
mod doubt_tests;
#[cfg(test)]
#[path = "evidence_tests.rs"]
mod tests;
