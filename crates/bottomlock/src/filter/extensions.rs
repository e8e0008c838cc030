//! Optional parts of a filter: further states and the tape for a smoother.

use nalgebra::{DMatrix, SMatrix, Vector3};

use super::calibration::CalibrationBlock;
use super::further_states::{FurtherStates, NONE, Update};
use super::gauss_markov::GaussMarkovStates;
use super::gyro_matrix::{GyroMatrix, MATRIX, Turned};
use super::options::Options;
use super::tape::{Step, Tape, transition};
use super::warm_up::WarmUp;
use super::water_block::WaterBlock;
use crate::aiding::calibration::CALIBRATION;
use crate::aiding::current_layers::LAYER_STATES;
use crate::aiding::further::{
    FIRST_ATTITUDE_ERROR, FIRST_CALIBRATION, FIRST_LAYERS, FIRST_WATER, FURTHER, FurtherVector,
};
use crate::aiding::water::{HEAVE, SWAY, WATER};
use crate::aiding::{CorrectedPath, Innovation};
use crate::error_model::Interval;
use crate::layout::{ATTITUDE, DIM, POSITION};
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::model::Model;
use crate::state::Covariance;

/// Optional parts of a filter.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Extensions {
    /// Covariances of all states beside the 20, where there are any.
    pub(super) further: Option<Box<FurtherStates>>,
    /// Slow errors of sensors, and the motion.
    pub(super) processes: Box<GaussMarkovStates>,
    /// Mounting and clock of the DVL.
    pub(super) calibration: Option<Box<CalibrationBlock>>,
    /// Scale factors and misalignments of the gyros, where they are unknown.
    pub(super) gyros: Option<Box<GyroMatrix>>,
    /// Warm-up of the inertial sensors.
    pub(super) warm_up: Option<WarmUp>,
    /// What both add to the covariance of the error state over the interval that is being propagated.
    #[serde(skip)]
    pub(super) added: Option<Box<Covariance>>,
    /// States of the motion through the water.
    pub(super) water: Option<Box<WaterBlock>>,
    /// Tape for a smoother; a saved filter has none.
    #[serde(skip)]
    pub(super) tape: Option<Box<Tape>>,
}

impl Extensions {
    /// Slow errors of the sensors, the motion, and mounting and clock of the DVL, at their priors.
    pub(super) fn new(model: &Model, options: &Options, kinematics: &Kinematics<f64>) -> Self {
        let models = &model.sensors;
        let calibration = CalibrationBlock::new(&options.calibration, kinematics);
        let mut extensions = Self {
            further: None,
            processes: Box::new(GaussMarkovStates::new(models, options)),
            calibration: calibration.map(Box::new),
            gyros: GyroMatrix::new(&model.imu, kinematics).map(Box::new),
            warm_up: WarmUp::new(&model.imu),
            added: None,
            water: None,
            tape: None,
        };
        extensions.begin();
        extensions
    }

    /// Begins all but the water states at their priors.
    fn begin(&mut self) {
        for block in self.processes.unknown() {
            let variance = &self.processes.variance().as_slice()[block.clone()];
            begun(&mut self.further).begin(block, variance);
        }
        if let Some(calibration) = &self.calibration {
            let variance = calibration.prior_variance();
            begun(&mut self.further).begin(FIRST_CALIBRATION..FIRST_ATTITUDE_ERROR, variance.as_slice());
        }
        if let Some(gyros) = &self.gyros {
            begun(&mut self.further).begin(MATRIX, gyros.variance().as_slice());
        }
    }

    /// Begins all but the water states anew, at a state.
    pub(super) fn restart(&mut self, kinematics: &Kinematics<f64>) {
        self.processes.restart();
        if let Some(calibration) = self.calibration.as_deref() {
            self.calibration = calibration.restarted(kinematics).map(Box::new);
        }
        if let Some(gyros) = &mut self.gyros {
            gyros.begin_interval(kinematics);
        }
        self.begin();
    }

    /// Begins the water states at their prior, or ends them.
    pub(super) fn set_water(&mut self, water: Option<WaterBlock>) {
        if let Some(further) = &mut self.further {
            further.end(&(FIRST_WATER..FIRST_LAYERS));
            further.end(&(FIRST_LAYERS..FURTHER));
        }
        if let Some(water) = &water {
            let further = begun(&mut self.further);
            further.begin(FIRST_WATER..FIRST_LAYERS, water.variance().as_slice());
            if let Some(layers) = water.layers() {
                further.begin(FIRST_LAYERS..FURTHER, layers.variance().as_slice());
            }
        }
        self.water = water.map(Box::new);
    }

    /// Replaces the water states; the slips begin at their prior, the others keep their covariance.
    pub(super) fn set_slips(&mut self, water: WaterBlock) {
        for slip in [SWAY, HEAVE] {
            begun(&mut self.further).renew(FIRST_WATER + slip, water.variance()[slip]);
        }
        self.water = Some(Box::new(water));
    }

    /// Moves the current's layers to enclose two depths, as far as there is room; those that come to other depths begin anew.
    pub(super) fn enclose_depths(&mut self, upper_m: f64, lower_m: f64) {
        let states = self.states();
        let Some(layers) = self.water.as_deref_mut().and_then(WaterBlock::layers_mut) else {
            return;
        };
        let anew = layers.enclose(upper_m, lower_m);
        if anew.is_empty() {
            return;
        }
        let first = states - LAYER_STATES;
        let mut moves = DMatrix::identity(states, states);
        for (one, axis) in anew.iter().flat_map(|one| [(one, 0), (one, 1)]) {
            let (state, from) = (2 * one.place + axis, 2 * one.neighbour + axis);
            begun(&mut self.further).follow(FIRST_LAYERS + state, FIRST_LAYERS + from, one.factor, one.variance);
            let followed = moves.row(first + from) * one.factor;
            moves.set_row(first + state, &followed);
        }
        if let Some(tape) = &mut self.tape {
            tape.push(Step::Transition(moves));
        }
    }

    /// Covariances of all states beside the 20.
    pub(super) fn further(&self) -> &FurtherStates {
        self.further.as_deref().unwrap_or(&NONE)
    }

    /// Number of states of a tape.
    pub(super) fn states(&self) -> usize {
        DIM + self.further().states().count()
    }

    /// The state has been corrected.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        if let Some(calibration) = &mut self.calibration {
            calibration.begin_interval(kinematics);
        }
        if let Some(gyros) = &mut self.gyros {
            gyros.begin_interval(kinematics);
        }
    }

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        let states = self.states();
        if let Some(further) = &mut self.further {
            further.move_to_corrected_path(path);
        }
        if let Some(tape) = &mut self.tape {
            let mut move_of_states = DMatrix::identity(states, states);
            move_of_states
                .fixed_view_mut::<3, 3>(POSITION, ATTITUDE)
                .copy_from(&path.by_misalignment);
            if let Some(by_position) = &path.by_position {
                move_of_states
                    .fixed_view_mut::<3, 3>(POSITION, POSITION)
                    .copy_from(by_position);
            }
            tape.push(Step::Transition(move_of_states));
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.further().is_empty() && self.tape.is_none() && self.warm_up.is_none()
    }

    /// Fraction of the error of each further state that is left after `duration_s` at the velocity of `end`.
    pub(super) fn left(&self, duration_s: f64, end: &Kinematics<f64>) -> FurtherVector {
        let mut left = self.processes.left(duration_s);
        if let Some(water) = &self.water {
            left.fixed_rows_mut::<WATER>(FIRST_WATER)
                .copy_from(&water.decay(duration_s));
            if let Some(layers) = water.layers() {
                let speed_mps = Vector3::from(end.velocity_p_mps).norm();
                left.fixed_rows_mut::<LAYER_STATES>(FIRST_LAYERS)
                    .copy_from(&layers.left(duration_s, speed_mps * duration_s));
            }
        }
        left
    }

    /// Variance of each further state in the long run; zero for a constant of the DVL's mounting and for a state that is none.
    pub(super) fn steady(&self) -> FurtherVector {
        let mut steady = *self.processes.variance();
        if let Some(water) = &self.water {
            steady.fixed_rows_mut::<WATER>(FIRST_WATER).copy_from(water.variance());
            if let Some(layers) = water.layers() {
                steady
                    .fixed_rows_mut::<LAYER_STATES>(FIRST_LAYERS)
                    .copy_from(&layers.variance());
            }
        }
        steady
    }

    /// What the gyros' scale factors and misalignments add over an interval that ends at `end`.
    pub(super) fn turned(&self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) -> Option<Turned> {
        let gyros = self.gyros.as_deref().filter(|_| interval.duration_s() > 0.0)?;
        Some(gyros.turned(interval, end, earth))
    }

    /// Records and propagates an interval of the error state that ends at `end`.
    pub(super) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) {
        if self.tape.is_some() {
            let whole = transition(interval, end, earth, self);
            if let Some(tape) = &mut self.tape {
                tape.push(Step::Transition(whole));
            }
        }
        let duration_s = interval.duration_s();
        self.added = None;
        if let Some(warm_up) = &mut self.warm_up {
            self.added = warm_up.added(duration_s).map(Box::new);
            warm_up.advance(duration_s);
        }
        if self.further.is_none() {
            return;
        }
        let turned = self.turned(interval, end, earth);
        let left = self.left(duration_s, end);
        let (steady, wave_turn) = (self.steady(), self.processes.wave_turn(duration_s));
        self.processes.propagate(duration_s, &left);
        if let Some(calibration) = &mut self.calibration {
            calibration.extend(duration_s, end);
        }
        if let Some(water) = &mut self.water {
            water.propagate(duration_s, &left.fixed_rows::<WATER>(FIRST_WATER).into_owned());
            if let Some(layers) = water.layers_mut() {
                layers.propagate(duration_s, &left.fixed_rows::<LAYER_STATES>(FIRST_LAYERS).into_owned());
            }
        }
        if let Some(further) = &mut self.further {
            further.propagate(interval, end, earth, &left, &steady, wave_turn.as_ref());
            if let Some(turned) = turned {
                **self.added.get_or_insert_default() += further.consider(&turned);
            }
        }
        if let Some(gyros) = &mut self.gyros {
            gyros.begin_interval(end);
        }
    }

    /// Updates the further states with an update of the error state that corrects the yaw by `yaw_rad`; returns the gain,
    /// transposed.
    pub(super) fn update<const M: usize>(
        &mut self,
        update: &Update<'_, M>,
        innovation: &Innovation,
        yaw_rad: f64,
    ) -> SMatrix<f64, M, FURTHER> {
        let Some(further) = &mut self.further else {
            return SMatrix::zeros();
        };
        let gain = further.update(update, innovation);
        self.inject(yaw_rad, &(gain.transpose() * update.z));
        gain
    }

    /// Adds an error of the further states to their estimates, with the yaw that is corrected.
    fn inject(&mut self, yaw_rad: f64, error: &FurtherVector) {
        self.processes.inject(error);
        if let Some(calibration) = &mut self.calibration {
            calibration.inject(&error.fixed_rows::<CALIBRATION>(FIRST_CALIBRATION).into_owned());
        }
        if let Some(water) = &mut self.water {
            water.inject(yaw_rad, &error.fixed_rows::<WATER>(FIRST_WATER).into_owned());
            if let Some(layers) = water.layers_mut() {
                layers.inject(yaw_rad, &error.fixed_rows::<LAYER_STATES>(FIRST_LAYERS).into_owned());
            }
        }
    }

    /// Covariance of a block of further states.
    pub(super) fn covariance_of<const N: usize>(&self, first: usize) -> SMatrix<f64, N, N> {
        self.further()
            .covariance()
            .fixed_view::<N, N>(first, first)
            .into_owned()
    }
}

/// The further states, of which the first is to begin where there is none.
fn begun(further: &mut Option<Box<FurtherStates>>) -> &mut FurtherStates {
    further.get_or_insert_with(|| Box::new(FurtherStates::none()))
}
