//! The current by depth: what all depths have in common, and layers whose own part is forgotten with time and way.
//!
//! At depth z between layers j and j + 1, which lie h apart, with w = z/h − j,
//!
//! ```text
//! c(z) = c + (1 − w) δ_j + w δ_{j+1}
//! ```
//!
//! δ are Gauss–Markov processes with the correlation exp(−t/τ − s/L) after a time t and a way s over ground, so that what was
//! measured at a depth counts when the vehicle returns to it, and the less the longer ago and the farther away. c has the time
//! constant of tide and wind. Of the layers as many are states as a dive needs at a time: where it leaves their depths, the
//! farthest one begins anew at another depth.
//!
//! The layers that enclosed the vehicle at the first measurement are independent, with the variance σ². Beyond them the current
//! departs as a random walk with depth: the layer n places beyond has the variance σ² (1 + 2 n), so that neighbours differ by
//! 2 σ² everywhere. One that begins anew follows from its neighbour, from m outwards to n
//!
//! ```text
//! δ_n = δ_m + ε, ε² = V_n − V_m,      and inwards      δ_n = (V_n/V_m) δ_m + ε, ε² = V_n − V_n²/V_m
//! ```
//!
//! Errors are expressed along the estimated north, as those of the current ([`crate::aiding::water`]).

use nalgebra::{SVector, Vector2, Vector3};

use crate::aiding::further::{FurtherRows, Process, block};
use crate::aiding::water::{CURRENT, WaterVector, turn};
use crate::aiding::{Motion, RowJacobian};
use crate::error::{NavError, require_magnitude, require_non_negative, require_positive};
use crate::layout::{ATTITUDE, POSITION};

/// Number of layers.
pub const LAYERS: usize = 4;
/// Number of their states: north and east of each.
pub const LAYER_STATES: usize = 2 * LAYERS;

/// One number for each state of the layers.
pub type LayerVector = SVector<f64, LAYER_STATES>;

/// Largest depth, m, over the distance between layers: the number of a layer is then exact.
const DEEPEST: f64 = 1e9;

/// What is known of the layers beforehand; 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayersPrior {
    /// Part of the current that a layer has to itself, along north and along east, m/s; 0 for no layers.
    pub sd_mps: f64,
    /// Its correlation time, s.
    pub time_s: f64,
    /// Its correlation length along the way, m.
    pub way_m: f64,
    /// Distance between two layers, m.
    pub spacing_m: f64,
    /// Correlation time of what all depths have in common, s.
    pub mean_time_s: f64,
}

impl Default for LayersPrior {
    /// Coastal water; where each number comes from stands in `docs/methods/without_bottom.md`.
    fn default() -> Self {
        Self {
            sd_mps: 0.04,
            time_s: 1800.0,
            way_m: 5000.0,
            spacing_m: 10.0,
            mean_time_s: 259_200.0,
        }
    }
}

impl LayersPrior {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        require_non_negative("options.current_layers.sd_mps", self.sd_mps)?;
        require_magnitude(
            "options.current_layers.sd_mps",
            &[self.sd_mps],
            1e7,
            "less than 1e7 m/s",
        )?;
        require_positive("options.current_layers.time_s", self.time_s)?;
        require_positive("options.current_layers.way_m", self.way_m)?;
        require_positive("options.current_layers.spacing_m", self.spacing_m)?;
        require_positive("options.current_layers.mean_time_s", self.mean_time_s)
    }
}

/// The layers that are states.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Layers {
    prior: LayersPrior,
    /// Number of the uppermost one; layer j lies at the depth j h, and its states are those of the place j modulo [`LAYERS`].
    first: i64,
    /// The same at the first measurement.
    reference: Option<i64>,
    /// Time since each place was measured last, s; infinite where it was not.
    age_s: [f64; LAYERS],
}

/// The current at a depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurrentAt {
    /// The water states, of which the current is that of the depth.
    pub water: WaterVector,
    /// Weight of each place's layer in it.
    weights: [f64; LAYERS],
    /// Its change with depth, north and east, 1/s.
    slope_n_per_s: Vector2<f64>,
}

/// The water states as they are estimated, with the current by depth.
#[derive(Debug, Clone, Copy)]
pub struct Water<'a> {
    /// Their estimate.
    pub estimate: WaterVector,
    /// The layers, where there are any.
    pub layers: Option<&'a Layers>,
    /// Estimate of their states, m/s.
    pub by_layer: LayerVector,
}

impl<'a> Water<'a> {
    /// Without layers.
    #[must_use]
    pub fn common(estimate: &WaterVector) -> Self {
        Self {
            estimate: *estimate,
            layers: None,
            by_layer: LayerVector::zeros(),
        }
    }

    /// The same with layers.
    #[must_use]
    pub fn with(self, layers: &'a Layers, by_layer: &LayerVector) -> Self {
        Self {
            layers: Some(layers),
            by_layer: *by_layer,
            ..self
        }
    }

    /// Adds an error to the estimates: a current turns with the yaw that is corrected.
    pub fn inject(&mut self, yaw_rad: f64, error: &WaterVector, of_layers: &LayerVector) {
        turn(&mut self.estimate.as_mut_slice()[CURRENT..CURRENT + 2], yaw_rad);
        let layers = self.by_layer.as_mut_slice().chunks_exact_mut(2);
        layers.for_each(|own| turn(own, yaw_rad));
        self.estimate += error;
        self.by_layer += of_layers;
    }

    /// The water states with the current at a depth.
    #[must_use]
    pub fn at(&self, depth_m: f64) -> CurrentAt {
        self.layers.map_or_else(
            || CurrentAt {
                water: self.estimate,
                weights: [0.0; LAYERS],
                slope_n_per_s: Vector2::zeros(),
            },
            |layers| layers.at(&self.estimate, &self.by_layer, depth_m),
        )
    }
}

/// A place that begins anew: `factor` times the layer at the place `neighbour`, and an independent part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Anew {
    pub place: usize,
    pub neighbour: usize,
    pub factor: f64,
    /// Of the independent part, (m/s)².
    pub variance: f64,
}

/// A layer as estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// Depth, m.
    pub depth_m: f64,
    /// Time since it was measured last, s; infinite where it was not.
    pub age_s: f64,
}

impl Layers {
    /// At their prior; `None` where that has none.
    #[must_use]
    pub fn new(prior: &LayersPrior) -> Option<Self> {
        (prior.sd_mps > 0.0).then_some(Self {
            prior: *prior,
            first: 0,
            reference: None,
            age_s: [f64::INFINITY; LAYERS],
        })
    }

    /// What was known beforehand.
    #[must_use]
    pub fn prior(&self) -> &LayersPrior {
        &self.prior
    }

    /// The states of the places, for a vehicle at a speed over ground, m/s.
    #[must_use]
    pub fn processes(&self, speed_mps: f64) -> [Process; LAYER_STATES] {
        let time_s = 1.0 / (1.0 / self.prior.time_s + speed_mps / self.prior.way_m);
        let mut processes = [Process::constant(0.0); LAYER_STATES];
        for number in (self.first..).take(LAYERS) {
            let process = Process {
                variance: self.variance_of(number),
                time_s,
                ..Process::constant(0.0)
            };
            processes[2 * place_of(number)..][..2].fill(process);
        }
        processes
    }

    /// The variance of a layer, (m/s)².
    fn variance_of(&self, number: i64) -> f64 {
        let beyond = self.reference.map_or(0, |reference| {
            let last = reference + LAYERS as i64 - 1;
            (reference - number).max(number - last).max(0)
        });
        self.prior.sd_mps * self.prior.sd_mps * (1.0 + 2.0 * beyond as f64)
    }

    /// The layers, the uppermost first.
    pub fn each(&self) -> impl Iterator<Item = Layer> + '_ {
        (self.first..).take(LAYERS).map(|number| Layer {
            depth_m: number as f64 * self.prior.spacing_m,
            age_s: self.age_s[place_of(number)],
        })
    }

    /// Depth over the distance between layers; an estimate above the surface is taken for the surface.
    fn scaled(&self, depth_m: f64) -> f64 {
        (depth_m / self.prior.spacing_m).clamp(0.0, DEEPEST)
    }

    /// Moves the layers so that they enclose two depths, the upper one where there is no room for both; returns those that begin
    /// anew, in the order in which they follow from each other.
    pub(crate) fn enclose(&mut self, upper_m: f64, lower_m: f64) -> Vec<Anew> {
        let last = LAYERS as i64 - 1;
        let (upper, lower) = (
            self.scaled(upper_m).floor() as i64,
            self.scaled(lower_m).floor() as i64 + 1,
        );
        let before = self.first;
        self.first = before.max(lower - last).min(upper);
        let is_kept = |number: i64| (before..=before + last).contains(&number);
        let mut new: Vec<i64> = (self.first..=self.first + last)
            .filter(|&number| !is_kept(number))
            .collect();
        let outwards = if self.first < before { -1 } else { 1 };
        if outwards < 0 {
            new.reverse();
        }
        let is_apart = new.len() == LAYERS;
        let each = new.into_iter().enumerate().map(|(step, number)| {
            let has_neighbour = step > 0 || !is_apart;
            self.begin(number, has_neighbour.then_some(number - outwards))
        });
        each.collect()
    }

    /// Begins a layer anew, beside a neighbour that there is.
    fn begin(&mut self, number: i64, neighbour: Option<i64>) -> Anew {
        let place = place_of(number);
        let own = self.variance_of(number);
        let apart = Anew {
            place,
            neighbour: place,
            factor: 0.0,
            variance: own,
        };
        let anew = neighbour.map_or(apart, |neighbour| {
            let its = self.variance_of(neighbour);
            // Neighbours of the same variance are independent.
            let factor = if own == its { 0.0 } else { (own / its).min(1.0) };
            Anew {
                neighbour: place_of(neighbour),
                factor,
                variance: own - factor * factor * its,
                ..apart
            }
        });
        self.age_s[place] = f64::INFINITY;
        anew
    }

    /// Adds to the water states what the layers have at a depth; beyond them as at the nearest one.
    fn at(&self, water: &WaterVector, estimate: &LayerVector, depth_m: f64) -> CurrentAt {
        let scaled = self.scaled(depth_m) - self.first as f64;
        let upper = scaled.floor().clamp(0.0, (LAYERS - 2) as f64);
        let w = (scaled - upper).clamp(0.0, 1.0);
        let places = [0, 1].map(|step| place_of(self.first + upper as i64 + step));
        let mut weights = [0.0; LAYERS];
        (weights[places[0]], weights[places[1]]) = (1.0 - w, w);
        let [above, below] = places.map(|place| estimate.fixed_rows::<2>(2 * place).into_owned());
        let own = above * (1.0 - w) + below * w;
        let is_between = scaled - upper == w && depth_m >= 0.0;
        let slope = if is_between { 1.0 / self.prior.spacing_m } else { 0.0 };
        let mut water = *water;
        water[CURRENT] += own.x;
        water[CURRENT + 1] += own.y;
        CurrentAt {
            water,
            weights,
            slope_n_per_s: (below - above) * slope,
        }
    }

    /// Takes note that the current was measured.
    pub(crate) fn note(&mut self, at: &CurrentAt) {
        self.reference.get_or_insert(self.first);
        for (age_s, weight) in self.age_s.iter_mut().zip(at.weights) {
            if weight > 0.0 {
                *age_s = 0.0;
            }
        }
    }

    /// Time has passed.
    pub(crate) fn wait(&mut self, duration_s: f64) {
        self.age_s.iter_mut().for_each(|age_s| *age_s += duration_s);
    }

    /// Checks layers that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.prior.validate()?;
        let is_sound = self.age_s.iter().all(|age_s| *age_s >= 0.0)
            && self.first.unsigned_abs() <= 2 * DEEPEST as u64
            && self
                .reference
                .is_none_or(|reference| reference.unsigned_abs() <= 2 * DEEPEST as u64);
        if is_sound {
            return Ok(());
        }
        Err(NavError::OutOfRange {
            field: "age or number of a layer of current",
            value: self.first as f64,
            expected: "ages of 0 s or more, and a layer that there can be",
        })
    }
}

impl CurrentAt {
    /// The further states whose sum it is, north's of each, with their weights.
    pub(crate) fn parts(&self) -> Vec<(usize, f64)> {
        let layers = self.weights.iter().enumerate();
        let layers = layers.map(|(place, weight)| (block::LAYERS.first + 2 * place, *weight));
        let common = std::iter::once((block::WATER.first + CURRENT, 1.0));
        common.chain(layers.filter(|(_, weight)| *weight != 0.0)).collect()
    }

    /// Completes a row that has the columns of the current: those of the layers, and those by which the depth at which it is taken
    /// changes; `place_t_m` leads from the vehicle there, tangent frame, m.
    pub(crate) fn complete(
        &self,
        motion: &Motion<'_>,
        place_t_m: &Vector3<f64>,
        row: usize,
        jacobian: &mut RowJacobian,
        further: &mut FurtherRows,
    ) {
        let by_current = [0, 1].map(|axis| further[(row, block::WATER.first + CURRENT + axis)]);
        for (place, weight) in self.weights.iter().enumerate() {
            for (axis, by_current) in by_current.iter().enumerate() {
                further[(row, block::LAYERS.first + 2 * place + axis)] = weight * by_current;
            }
        }
        let by_depth = by_current[0] * self.slope_n_per_s.x + by_current[1] * self.slope_n_per_s.y;
        let down_t = motion.level.down_t();
        // R l turns with ρ: D · (ρ × R l) = ρ · (R l × D).
        let by_misalignment = place_t_m.cross(&down_t);
        for k in 0..3 {
            jacobian[(row, POSITION + k)] += by_depth * down_t[k];
            jacobian[(row, ATTITUDE + k)] += by_depth * by_misalignment[k];
        }
    }
}

/// Place of a layer among the states.
fn place_of(number: i64) -> usize {
    number.rem_euclid(LAYERS as i64) as usize
}

#[cfg(test)]
#[path = "current_layers_tests.rs"]
mod tests;
