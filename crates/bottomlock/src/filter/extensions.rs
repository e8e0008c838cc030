//! Optional parts of a filter: further states and the tape for a smoother.

use nalgebra::{DMatrix, SMatrix, Vector3};

use super::further_states::{FurtherStates, NONE};
use super::further_update::Update;
use super::imu_matrix::{ImuMatrix, Turned};
use super::mean_change::MeanChange;
use super::options::Options;
use super::tape::{Step, Tape, transition};
use super::warm_up::WarmUp;
use super::water_block::WaterBlock;
use crate::aiding::current_layers::LAYER_STATES;
use crate::aiding::further::{FURTHER, Processes, block};
use crate::aiding::thrust::ThrustUse;
use crate::aiding::water::{HEAVE, SWAY};
use crate::aiding::{CorrectedPath, Innovation};
use crate::error_model::Interval;
use crate::layout::{ATTITUDE, DIM, POSITION};
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::model::Model;
use crate::state::Covariance;

/// Optional parts of a filter.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Extensions {
    /// All states beside the 20, where there are any.
    pub(super) further: Option<Box<FurtherStates>>,
    /// Mean acceleration, where the clock of the DVL is unknown.
    pub(super) change: Option<Box<MeanChange>>,
    /// Considered errors of the inertial sensors, where there are any.
    pub(super) inertial: Option<Box<ImuMatrix>>,
    /// Warm-up of the inertial sensors.
    pub(super) warm_up: Option<WarmUp>,
    /// What both add to the covariance of the error state over the interval that is being propagated.
    #[serde(skip)]
    pub(super) added: Option<Box<Covariance>>,
    /// What is known of the motion through the water, where it has states.
    pub(super) water: Option<Box<WaterBlock>>,
    /// Tape for a smoother; a saved filter has none.
    #[serde(skip)]
    pub(super) tape: Option<Box<Tape>>,
}

impl Extensions {
    /// All but the water states, at their priors.
    pub(super) fn new(model: &Model, options: &Options, kinematics: &Kinematics<f64>) -> Self {
        let mut extensions = Self {
            further: None,
            change: None,
            inertial: ImuMatrix::new(&model.imu, kinematics).map(Box::new),
            warm_up: WarmUp::new(&model.imu),
            added: None,
            water: None,
            tape: None,
        };
        let mut blocks = model.sensors.processes();
        blocks.push(options.motion.processes());
        blocks.push(options.calibration.processes());
        blocks.extend(extensions.inertial.iter().flat_map(|inertial| inertial.processes()));
        if options.thrust != ThrustUse::Off {
            blocks.push(model.sensors.thrust.processes());
        }
        blocks.iter().for_each(|block| extensions.begin(block));
        if !options.calibration.is_off() {
            let change = MeanChange::new(options.calibration.clock_sd_s, kinematics);
            extensions.change = Some(Box::new(change));
        }
        extensions
    }

    /// Begins a block of which something is unknown.
    pub(super) fn begin(&mut self, block: &Processes) {
        if block.1.iter().any(|process| process.variance + process.walk > 0.0) {
            begun(&mut self.further).begin(block);
        }
    }

    /// Begins all but the water states anew, at a state.
    pub(super) fn restart(&mut self, kinematics: &Kinematics<f64>) {
        if let Some(further) = &mut self.further {
            further.restart();
        }
        if let Some(change) = &mut self.change {
            **change = change.restarted(kinematics);
        }
        if let Some(inertial) = &mut self.inertial {
            inertial.begin_interval(kinematics);
        }
    }

    /// Begins the water states at their prior, or ends them.
    pub(super) fn set_water(&mut self, water: Option<WaterBlock>) {
        if let Some(further) = &mut self.further {
            further.end(block::WATER);
            further.end(block::LAYERS);
        }
        if let Some(water) = &water {
            let further = begun(&mut self.further);
            further.begin(&(block::WATER, water.processes().to_vec()));
            if let Some(layers) = water.layers() {
                further.begin(&(block::LAYERS, layers.processes(0.0).to_vec()));
            }
        }
        self.water = water.map(Box::new);
    }

    /// Replaces what is known of the motion through the water but for the current's layers; the slips begin at their prior, the
    /// other states stay.
    pub(super) fn set_slips(&mut self, water: WaterBlock) {
        let water = match &self.water {
            Some(before) => water.with_layers_of(before),
            None => water,
        };
        self.water = Some(Box::new(water));
        self.note_water();
        for slip in [SWAY, HEAVE] {
            begun(&mut self.further).renew(block::WATER.first + slip);
        }
    }

    /// Takes note of what the tests show of slips and current.
    pub(super) fn note_water(&mut self) {
        if let (Some(water), Some(further)) = (&self.water, &mut self.further) {
            further.set(block::WATER, &water.processes());
        }
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
        let processes = layers.processes(0.0);
        begun(&mut self.further).set(block::LAYERS, &processes);
        let first = states - LAYER_STATES;
        let mut moves = DMatrix::identity(states, states);
        for (one, axis) in anew.iter().flat_map(|one| [(one, 0), (one, 1)]) {
            let (state, from) = (2 * one.place + axis, 2 * one.neighbour + axis);
            begun(&mut self.further).follow(
                block::LAYERS.first + state,
                block::LAYERS.first + from,
                one.factor,
                one.variance,
            );
            let followed = moves.row(first + from) * one.factor;
            moves.set_row(first + state, &followed);
        }
        if let Some(tape) = &mut self.tape {
            tape.push(Step::Transition(moves));
        }
    }

    /// The states beside the 20.
    pub(super) fn further(&self) -> &FurtherStates {
        self.further.as_deref().unwrap_or(&NONE)
    }

    /// Number of states of a tape.
    pub(super) fn states(&self) -> usize {
        DIM + self.further().states().count()
    }

    /// The state has been corrected.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        if let Some(change) = &mut self.change {
            change.begin(kinematics);
        }
        if let Some(inertial) = &mut self.inertial {
            inertial.begin_interval(kinematics);
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

    /// Takes note of how fast the states change over an interval that ends at `end`.
    fn note_processes(&mut self, end: &Kinematics<f64>) {
        self.note_water();
        let layers = self.water.as_ref().and_then(|water| water.layers());
        if let (Some(layers), Some(further)) = (layers, &mut self.further) {
            let speed_mps = Vector3::from(end.velocity_p_mps).norm();
            further.set(block::LAYERS, &layers.processes(speed_mps));
        }
    }

    /// What the considered errors of the inertial sensors add over an interval that ends at `end`.
    pub(super) fn turned(&self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) -> Option<Turned> {
        let inertial = self.inertial.as_deref().filter(|_| interval.duration_s() > 0.0)?;
        Some(inertial.turned(interval, end, earth))
    }

    /// Records and propagates an interval of the error state that ends at `end`.
    pub(super) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) {
        self.note_processes(end);
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
        if let Some(change) = &mut self.change {
            change.extend(duration_s, end);
        }
        if let Some(water) = &mut self.water {
            water.wait(duration_s);
        }
        if let Some(further) = &mut self.further {
            further.propagate(interval, end, earth);
            if let Some(turned) = turned {
                **self.added.get_or_insert_default() += further.consider(&turned);
            }
        }
        if let Some(inertial) = &mut self.inertial {
            inertial.begin_interval(end);
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
        further.inject(yaw_rad, &(gain.transpose() * update.z));
        gain
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
