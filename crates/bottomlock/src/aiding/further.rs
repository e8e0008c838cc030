//! The states beside the 20 of the error state: their blocks, what each is a process of, and the rows that a sensor fills for them.
//!
//! A state beside the 20 is a parameter of a sensor or of the vehicle: its error belongs to the noise of the measurements that
//! contain it, n = D_f δf + white noise. A sensor states D_f, and its model which processes the states are; what follows from both
//! is the filter's (`filter/further_states.rs`).

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use crate::aiding::MAX_ROWS;
use crate::aiding::calibration::CALIBRATION;
use crate::aiding::current_layers::LAYER_STATES;
use crate::aiding::thrust::THRUST;
use crate::aiding::water::WATER;
use crate::layout::{BIASED_BEAMS, MAX_BEAMS};

/// Number of states of the error of an attitude reference: offset of roll, pitch and yaw, then their first-order walks.
pub const ATTITUDE_ERROR: usize = 6;
/// Number of states of the error of a heading sensor: offset, then first-order walk.
pub const HEADING_ERROR: usize = 2;
/// Number of states of the deviation of a compass: its coefficients by cos ψ, sin ψ, cos 2ψ and sin 2ψ.
pub const DEVIATION: usize = 4;
/// Number of states of the motion of the vehicle.
pub const MOTION: usize = 6;
/// Number of states of the waves in a depth: what they add now, and the same a quarter of their period ago.
pub const DEPTH_WAVE: usize = 2;
/// Number of states of the considered errors of the inertial sensors.
pub const CONSIDERED: usize = block::MOTION.first - block::GYRO_MATRIX.first;

/// A further state: a constant, a random walk or a first-order Gauss–Markov process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process {
    /// Value at the start and, but for constants, in the long run.
    pub mean: f64,
    /// Variance at the start and in the long run.
    pub variance: f64,
    /// Correlation time, s; infinite for a constant.
    pub time_s: f64,
    /// What a random walk adds to the variance, per s.
    pub walk: f64,
}

impl Process {
    /// A constant with a standard deviation.
    #[must_use]
    pub const fn constant(sd: f64) -> Self {
        Self::lasting(sd, f64::INFINITY)
    }

    /// A process of zero mean with a standard deviation and a correlation time, s.
    #[must_use]
    pub const fn lasting(sd: f64, time_s: f64) -> Self {
        Self {
            mean: 0.0,
            variance: sd * sd,
            time_s,
            walk: 0.0,
        }
    }

    /// Fraction of an error that is left after `duration_s`.
    #[must_use]
    pub fn left(&self, duration_s: f64) -> f64 {
        if self.time_s == f64::INFINITY {
            return 1.0;
        }
        (-duration_s / self.time_s).exp()
    }
}

/// The states of a block, in order.
pub type Processes = (Block, Vec<Process>);

/// States that belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    /// Its name.
    pub name: &'static str,
    /// Its first state.
    pub first: usize,
    /// Number of its states.
    pub count: usize,
}

impl Block {
    /// The block behind this one.
    const fn then(self, name: &'static str, count: usize) -> Self {
        Self {
            name,
            first: self.end(),
            count,
        }
    }

    const fn end(self) -> usize {
        self.first + self.count
    }

    /// Its states.
    #[must_use]
    pub const fn range(self) -> Range<usize> {
        self.first..self.end()
    }
}

/// The blocks.
pub mod block {
    use super::{
        ATTITUDE_ERROR as ATTITUDE, BIASED_BEAMS, Block, CALIBRATION as OF_DVL, DEPTH_WAVE as WAVE, DEVIATION,
        HEADING_ERROR as HEADING, LAYER_STATES, MAX_BEAMS, MOTION as OF_VEHICLE, THRUST as OF_DRIVES,
        WATER as THROUGH_WATER,
    };

    /// Bias of the depth sensor, m.
    pub const DEPTH_BIAS: Block = Block {
        name: "depth_bias_m",
        first: 0,
        count: 1,
    };
    /// Waves in a depth, m ([`crate::aiding::depth`]).
    pub const DEPTH_WAVE: Block = DEPTH_BIAS.then("depth_wave_m", WAVE);
    /// Mounting and clock of the DVL ([`crate::aiding::calibration`]).
    pub const CALIBRATION: Block = DEPTH_WAVE.then("dvl_mounting_and_clock", OF_DVL);
    /// Biases of the beams beyond those of the 20 states, m/s (`filter/beam_biases.rs`).
    pub const BEAM_BIAS: Block = CALIBRATION.then("beam_bias_mps", MAX_BEAMS - BIASED_BEAMS);
    /// Error of the attitude reference, rad ([`crate::aiding::attitude`]).
    pub const ATTITUDE_ERROR: Block = BEAM_BIAS.then("attitude_error_rad", ATTITUDE);
    /// Deviation of the attitude reference's yaw, rad (`aiding/deviation.rs`).
    pub const ATTITUDE_DEVIATION: Block = ATTITUDE_ERROR.then("attitude_deviation_rad", DEVIATION);
    /// Error of the heading sensor, rad ([`crate::aiding::heading`]).
    pub const HEADING_ERROR: Block = ATTITUDE_DEVIATION.then("heading_error_rad", HEADING);
    /// Deviation of the heading sensor, rad.
    pub const HEADING_DEVIATION: Block = HEADING_ERROR.then("heading_deviation_rad", DEVIATION);
    /// The gyros' scale factors and misalignments, a matrix by rows (`filter/imu_matrix.rs`).
    pub const GYRO_MATRIX: Block = HEADING_DEVIATION.then("gyro_matrix", 9);
    /// What the gyros see of forces, rad/s per m/s², a matrix by rows.
    pub const GYRO_BY_FORCE: Block = GYRO_MATRIX.then("gyro_by_force", 9);
    /// The accelerometers' scale factors.
    pub const ACCEL_SCALE: Block = GYRO_BY_FORCE.then("accel_scale", 3);
    /// The motion of the vehicle: mean of surge, sway and heave, then their changes, m/s ([`crate::aiding::motion_prior`]).
    pub const MOTION: Block = ACCEL_SCALE.then("motion_p_mps", OF_VEHICLE);
    /// What the drives make of the speed: scale, then slip, m/s, along surge, sway and heave ([`crate::aiding::thrust`]).
    pub const THRUST: Block = MOTION.then("thrust", OF_DRIVES);
    /// The motion through the water ([`crate::aiding::water`]); it and its layers are last, since a filter may begin or end them
    /// while it runs, and the states of a smoother's tape then keep their places.
    pub const WATER: Block = THRUST.then("water", THROUGH_WATER);
    /// The current's layers ([`crate::aiding::current_layers`]), north and east of each place, m/s.
    pub const LAYERS: Block = WATER.then("current_layers_mps", LAYER_STATES);

    /// All of them, in order.
    pub const ALL: [Block; 15] = [
        DEPTH_BIAS,
        DEPTH_WAVE,
        CALIBRATION,
        BEAM_BIAS,
        ATTITUDE_ERROR,
        ATTITUDE_DEVIATION,
        HEADING_ERROR,
        HEADING_DEVIATION,
        GYRO_MATRIX,
        GYRO_BY_FORCE,
        ACCEL_SCALE,
        MOTION,
        THRUST,
        WATER,
        LAYERS,
    ];
    /// Slow errors of sensors, the motion, and what the drives make of the speed.
    pub const SLOW: [Block; 8] = [
        DEPTH_BIAS,
        DEPTH_WAVE,
        ATTITUDE_ERROR,
        ATTITUDE_DEVIATION,
        HEADING_ERROR,
        HEADING_DEVIATION,
        MOTION,
        THRUST,
    ];
}

/// Number of further states.
pub const FURTHER: usize = block::LAYERS.end();

/// One number for each further state.
pub type FurtherVector = SVector<f64, FURTHER>;
/// Jacobian of up to [`MAX_ROWS`] rows with respect to the further states.
pub type FurtherRows = SMatrix<f64, MAX_ROWS, FURTHER>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    /// The blocks cover the further states without gap or overlap, each under a name of its own.
    #[test]
    fn blocks_tile_the_further_states() {
        let mut next = 0;
        for block in block::ALL {
            assert_eq!(block.first, next);
            next = block.range().end;
            assert_eq!(block::ALL.iter().filter(|other| other.name == block.name).count(), 1);
        }
        assert_eq!(next, FURTHER);
    }

    /// After its correlation time 1/e of an error is left, of a constant all of it.
    #[test]
    fn a_process_forgets() {
        assert!((Process::lasting(2.0, 5.0).left(5.0) - (-1.0_f64).exp()).abs() < 1e-15);
        assert_eq!(
            (Process::constant(3.0).left(1e9), Process::constant(3.0).variance),
            (1.0, 9.0)
        );
    }

    /// Every model by hand: its states with their correlation times, and nothing of an axis without slip.
    #[test]
    fn models_name_their_processes() {
        let (lasting, constant) = (Process::lasting, Process::constant);
        let depth = DepthModel {
            bias_sd_m: 0.3,
            bias_time_s: TimeConstant(100.0),
            wave_sd_m: SlowSd(0.5),
            wave_period_s: WavePeriod(7.0),
            ..DepthModel::default()
        };
        let expected = [
            (block::DEPTH_BIAS, vec![lasting(0.3, 100.0)]),
            (block::DEPTH_WAVE, vec![lasting(0.5, 7.0); 2]),
        ];
        assert_eq!(depth.processes(), expected);
        let attitude = MagnetometerModel {
            yaw_offset_sd_rad: SlowSd(0.1),
            roll_pitch_offset_sd_rad: SlowSd(0.2),
            yaw_walk_sd_rad: SlowSd(0.3),
            roll_pitch_walk_sd_rad: SlowSd(0.4),
            walk_time_s: WalkTime(50.0),
            yaw_semicircular_sd_rad: SlowSd(0.5),
            yaw_quadrantal_sd_rad: SlowSd(0.6),
            ..MagnetometerModel::default()
        };
        let walk = |sd| lasting(sd, 50.0);
        let errors = [0.2, 0.2, 0.1].map(constant).into_iter();
        let expected = [
            (block::ATTITUDE_ERROR, errors.chain([0.4, 0.4, 0.3].map(walk)).collect()),
            (block::ATTITUDE_DEVIATION, [0.5, 0.5, 0.6, 0.6].map(constant).to_vec()),
        ];
        assert_eq!(attitude.processes(), expected);
        let heading = HeadingModel {
            offset_sd_rad: SlowSd(0.1),
            walk_sd_rad: SlowSd(0.3),
            walk_time_s: WalkTime(50.0),
            semicircular_sd_rad: SlowSd(0.5),
            quadrantal_sd_rad: SlowSd(0.6),
            ..HeadingModel::default()
        };
        let expected = [
            (block::HEADING_ERROR, vec![constant(0.1), walk(0.3)]),
            (block::HEADING_DEVIATION, [0.5, 0.5, 0.6, 0.6].map(constant).to_vec()),
        ];
        assert_eq!(heading.processes(), expected);
        let thrust = ThrustModel {
            scale_sd: [0.1, 0.2, 0.3],
            slip_sd_mps: [0.02, 0.0, 0.04],
            slip_time_s: TimeConstant(5.0),
            ..ThrustModel::default()
        };
        let scale = |sd| Process {
            mean: 1.0,
            ..constant(sd)
        };
        let slip = |sd| lasting(sd, 5.0);
        let expected = vec![
            scale(0.1),
            constant(0.0),
            scale(0.3),
            slip(0.02),
            constant(0.0),
            slip(0.04),
        ];
        assert_eq!(thrust.processes(), (block::THRUST, expected));
        let motion = MotionPrior {
            mean_sd_mps: [1.0, 2.0, 3.0],
            mean_time_s: 70.0,
            change_sd_mps: [4.0, 5.0, 6.0],
            change_time_s: [7.0, 8.0, 9.0],
        };
        let mean = [1.0, 2.0, 3.0].map(|sd| lasting(sd, 70.0)).into_iter();
        let change = [(4.0, 7.0), (5.0, 8.0), (6.0, 9.0)].map(|(sd, time_s)| lasting(sd, time_s));
        assert_eq!(motion.processes(), (block::MOTION, mean.chain(change).collect()));
        let calibration = CalibrationPrior {
            mounting_sd_rad: [0.1, 0.2, 0.3],
            clock_sd_s: 0.4,
        };
        let expected = [0.1, 0.2, 0.3, 0.4].map(constant).to_vec();
        assert_eq!(calibration.processes(), (block::CALIBRATION, expected));
    }
}
