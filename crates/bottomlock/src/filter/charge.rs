//! What evidence makes uncertain, and by how much: the arithmetic of the rule in [`super::evidence`].

use std::ops::Range;

use nalgebra::SMatrix;

use super::Eskf;
use crate::aiding::further::{Block, FURTHER, FurtherVector, block};
use crate::aiding::sensor::Quantity;
use crate::aiding::{Innovation, MAX_ROWS};
use crate::filter::gate::FIVE_SIGMA_FACTOR;
use crate::filter::report::{Sensor, UpdateReport};
use crate::layout::{ATTITUDE, DIM, DVL_BIAS, POSITION, VELOCITY};
use crate::state::Covariance;

/// Factor on variances with which every error passes the gate.
pub(super) const UNINFORMATIVE_FACTOR: f64 = 1e6;
/// Halvings of the logarithm of a factor: four digits.
const BISECTIONS: usize = 20;
/// Largest sigma of an angle that evidence leads to, rad.
const MAX_ATTITUDE_SD_RAD: f64 = 1.0;
/// Largest sigma of a position that evidence leads to, m.
const MAX_POSITION_SD_M: f64 = 1e6;
/// Part of a variance that is rounding.
const ROUNDING: f64 = 1e-12;

pub(super) type Rows = SMatrix<f64, MAX_ROWS, MAX_ROWS>;

/// What a run of rejected readings makes uncertain.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Charge {
    /// Factor on the charged variances; `None` where the readings are not to be used yet.
    pub(crate) factor: Option<f64>,
    /// Part of what the readings show that is charged to the sensor's own slow states.
    pub(crate) to_sensor: f64,
    /// Whether all inertial states are charged.
    pub(crate) is_of_all: bool,
    /// Added to the covariance of the error state.
    pub(super) inertial: Box<Covariance>,
    /// Added to the variances of the further states.
    pub(super) further: FurtherVector,
}

/// The states that readings charge.
pub(super) struct Charged {
    /// Inertial states that they measure, and all that are charged.
    measured: [bool; DIM],
    inertial: [bool; DIM],
    /// Long-run variances of the sensor's own slow states, and of those that are charged; zero for all others.
    slow: FurtherVector,
    pub(super) own: FurtherVector,
}

impl Charged {
    /// Whether no inertial states are charged but those that the readings measure.
    pub(super) fn are_measured(&self) -> bool {
        self.inertial == self.measured
    }
}

impl Charge {
    pub(super) fn none(factor: Option<f64>) -> Self {
        Self {
            factor,
            to_sensor: 0.0,
            is_of_all: false,
            inertial: Box::new(Covariance::zeros()),
            further: FurtherVector::zeros(),
        }
    }

    /// Notes in the report of an update what was charged.
    pub(crate) fn note_in(&self, report: &mut UpdateReport) {
        report.inflation = self.factor;
        report.charged_to_sensor = self.to_sensor;
    }
}

impl Eskf {
    /// Adds what a run of rejected readings makes uncertain.
    pub(crate) fn charge(&mut self, charge: &Charge) {
        self.covariance += *charge.inertial;
        if let Some(further) = &mut self.extensions.further {
            let added = (0..FURTHER).filter(|&k| charge.further[k] > 0.0);
            added.for_each(|k| further.add_variance(k, charge.further[k]));
        }
    }

    /// Charges the states with a factor; `None` where they have reached their bounds.
    pub(super) fn charge_with(
        &mut self,
        factor: f64,
        charged: &Charged,
        unshared: &Covariance,
        [by_inertial, by_own]: &[Rows; 2],
        innovation: &Innovation,
    ) -> Option<Charge> {
        let indirect = factor
            .min(FIVE_SIGMA_FACTOR)
            .min(self.largest_factor(&charged.inertial))
            .max(1.0);
        let direct = (factor / indirect)
            .min(self.largest_factor(&charged.measured) / indirect)
            .max(1.0);
        let mut charge = Charge::none(None);
        for i in 0..DIM {
            for j in 0..DIM {
                let is_measured = charged.measured[i] && charged.measured[j];
                let grown = if is_measured { indirect * direct } else { indirect };
                charge.inertial[(i, j)] = unshared[(i, j)] * (grown - 1.0);
            }
        }
        let present = self.extensions.further().covariance().diagonal();
        for k in (0..FURTHER).filter(|&k| charged.own[k] > 0.0) {
            let most = if charged.measured[ATTITUDE..ATTITUDE + 3].contains(&true) {
                MAX_ATTITUDE_SD_RAD.powi(2)
            } else {
                UNINFORMATIVE_FACTOR * charged.own[k]
            };
            charge.further[k] = (charged.own[k] * (factor - 1.0)).min(most - present[k]).max(0.0);
        }
        let z = &innovation.residual;
        let [inertial, own] = [by_inertial, by_own].map(|part| z.dot(&(part * z)));
        charge.to_sensor = if own > 0.0 { own / (own + inertial) } else { 0.0 };
        charge.is_of_all = !charged.are_measured();
        charge.factor = Some(if own > 0.0 { factor } else { indirect * direct });
        self.charge(&charge);
        (charge.factor > Some(1.0)).then_some(charge)
    }

    /// The states that readings charge, of the contradicted axes alone.
    pub(super) fn charged_states(&self, innovation: &Innovation, sensor: Sensor, whole: &Rows) -> Charged {
        let none = [false; DIM];
        let inertial = states(0..DVL_BIAS);
        if sensor.quantity() == Some(Quantity::Velocity) {
            return Charged {
                measured: states(VELOCITY..VELOCITY + 3),
                inertial,
                slow: FurtherVector::zeros(),
                own: FurtherVector::zeros(),
            };
        }
        let slow = self.slow_variances(innovation);
        let own = self.changing(innovation, &slow);
        let Some(quantity) = sensor.quantity() else {
            return Charged {
                measured: none,
                inertial: none,
                slow,
                own,
            };
        };
        let block = measured_block(sensor);
        let measured = observed(innovation, block);
        let since_ns = self.rejected_since_ns(sensor);
        let has_velocity = self.measured.velocity_ns.is_some_and(|time_ns| time_ns >= since_ns);
        let is_velocity_open = || !has_velocity || self.is_beyond_linear_range() || self.is_moving(innovation, sensor);
        if quantity == Quantity::Position && innovation.rows == 3 && is_velocity_open() {
            return Charged {
                measured,
                inertial,
                slow,
                own,
            };
        }
        let of_axes = |axes: Range<usize>| {
            let axes = states(block + axes.start..block + axes.end);
            let measured = std::array::from_fn(|k| measured[k] && axes[k]);
            let own = FurtherVector::from_fn(|k, _| {
                if own[k] > 0.0 && axes[axis_of(innovation, block, k)] {
                    own[k]
                } else {
                    0.0
                }
            });
            Charged {
                measured,
                inertial: measured,
                slow,
                own,
            }
        };
        let limit = self.plausible.threshold(innovation.degrees);
        let alone = [2..3, 0..2].map(|axes| {
            let charged = of_axes(axes);
            let h = innovation.jacobian;
            let freed = h * self.unshared(&charged) * h.transpose() + by_further(innovation, &charged.own);
            let factor = matching_factor(innovation, whole, &freed);
            let is_enough = norm_squared(innovation, &(whole + freed * (factor - 1.0))) <= limit;
            is_enough.then_some((charged, factor))
        });
        let [vertical, horizontal] = alone;
        let least = match (vertical, horizontal) {
            (Some(vertical), Some(horizontal)) if horizontal.1 < vertical.1 => Some(horizontal),
            (vertical, horizontal) => vertical.or(horizontal),
        };
        least.map_or_else(|| of_axes(0..3), |(charged, _)| charged)
    }

    /// Long-run variances of the sensor's own slow states: those that its rows have; zero for all others.
    fn slow_variances(&self, innovation: &Innovation) -> FurtherVector {
        let steady = self.extensions.further().variance();
        let rows = innovation.correlated_noise.as_ref().map(|noise| &noise.by_further);
        FurtherVector::from_fn(|k, _| {
            let is_own = rows.is_some_and(|rows| rows.column(k).amax() > 0.0);
            if is_own { steady[k] } else { 0.0 }
        })
    }

    /// Without states that another one of their block has the same column as, and changes faster: of an offset and a walk the
    /// walk. A deviation is not charged where the sensor has an offset or a walk.
    fn changing(&self, innovation: &Innovation, slow: &FurtherVector) -> FurtherVector {
        let times_s = self.extensions.further().time_s();
        let rows = innovation.correlated_noise.as_ref().map(|noise| &noise.by_further);
        let is_of_one = |j: usize, k: usize| {
            let mut blocks = block::ALL.into_iter().map(Block::range);
            blocks.any(|states| states.contains(&j) && states.contains(&k))
        };
        let is_like = |j: usize, k: usize| is_of_one(j, k) && rows.is_some_and(|rows| rows.column(j) == rows.column(k));
        let errors_of_deviations = [
            (block::ATTITUDE_DEVIATION, block::ATTITUDE_ERROR),
            (block::HEADING_DEVIATION, block::HEADING_ERROR),
        ];
        let has_others = |k: usize| {
            let mut pairs = errors_of_deviations.into_iter();
            pairs.any(|(deviation, errors)| {
                deviation.range().contains(&k) && slow.rows_range(errors.range()).amax() > 0.0
            })
        };
        FurtherVector::from_fn(|k, _| {
            let is_slower = (0..FURTHER).any(|j| slow[j] > 0.0 && times_s[j] < times_s[k] && is_like(j, k));
            if is_slower || has_others(k) { 0.0 } else { slow[k] }
        })
    }

    /// The covariance of charged inertial states that they do not share with the sensor's own slow states; zero for all others.
    pub(super) fn unshared(&self, charged: &Charged) -> Covariance {
        let further = self.extensions.further();
        let (mut p, mut cross, mut c) = (self.covariance, *further.cross(), *further.covariance());
        // One own state after another; what rounding leaves of one that the others determine is no variance.
        for k in (0..FURTHER).filter(|&k| charged.slow[k] > 0.0) {
            let (with_state, with_own, variance) = (cross.column(k).into_owned(), c.column(k).into_owned(), c[(k, k)]);
            if variance <= ROUNDING * charged.slow[k] {
                continue;
            }
            p -= with_state * with_state.transpose() / variance;
            cross -= with_state * with_own.transpose() / variance;
            c -= with_own * with_own.transpose() / variance;
        }
        Covariance::from_fn(|i, j| {
            if charged.inertial[i] && charged.inertial[j] {
                p[(i, j)]
            } else {
                0.0
            }
        })
    }

    /// S of an innovation whose further states count as noise.
    pub(super) fn whole_covariance(&self, innovation: &Innovation) -> Rows {
        let h = innovation.jacobian;
        let mut whole = h * self.covariance * h.transpose() + innovation.noise;
        if let Some(cross) = &innovation.cross {
            let half = h * **cross;
            whole += half + half.transpose();
        }
        whole
    }

    /// Factor that keeps the sigmas of attitude and position below their limits.
    ///
    /// A method with a wrong assumption is rejected again and again, and must not inflate its covariance without bound.
    pub(super) fn largest_factor(&self, charged: &[bool; DIM]) -> f64 {
        let largest = |block: usize| {
            (block..block + 3)
                .filter(|&k| charged[k])
                .fold(0.0_f64, |most, k| most.max(self.covariance[(k, k)]))
        };
        let factor = |sd: f64, variance: f64| sd * sd / variance;
        factor(MAX_ATTITUDE_SD_RAD, largest(ATTITUDE)).min(factor(MAX_POSITION_SD_M, largest(POSITION)))
    }
}

/// The first state of the quantity that a sensor measures.
pub(super) fn measured_block(sensor: Sensor) -> usize {
    match sensor.quantity() {
        Some(Quantity::Position) => POSITION,
        Some(Quantity::Angle) => ATTITUDE,
        Some(Quantity::Velocity) | None => VELOCITY,
    }
}

/// The states of a range.
pub(super) fn states(range: Range<usize>) -> [bool; DIM] {
    std::array::from_fn(|k| range.contains(&k))
}

/// The states of a block of three that the rows measure: those whose column has at least half the largest entry.
pub(super) fn observed(innovation: &Innovation, block: usize) -> [bool; DIM] {
    let weight: [f64; 3] = std::array::from_fn(|k| innovation.jacobian.column(block + k).amax());
    let largest = weight.iter().fold(0.0_f64, |most, &one| most.max(one));
    std::array::from_fn(|k| (block..block + 3).contains(&k) && weight[k - block] >= 0.5 * largest)
}

/// The state of a block of three that the rows confuse most with a further state.
fn axis_of(innovation: &Innovation, block: usize, further: usize) -> usize {
    let rows = innovation.correlated_noise.as_ref().map(|noise| &noise.by_further);
    let along = |axis: usize| {
        let column = innovation.jacobian.column(block + axis);
        rows.map_or(0.0, |rows| column.dot(&rows.column(further)).abs())
    };
    block + (0..3).fold(0, |best, axis| if along(axis) > along(best) { axis } else { best })
}

/// D V Dᵀ of further states with these variances.
pub(super) fn by_further(innovation: &Innovation, variance: &FurtherVector) -> Rows {
    let mut covariance = Rows::zeros();
    if let Some(noise) = &innovation.correlated_noise {
        for k in (0..FURTHER).filter(|&k| variance[k] > 0.0) {
            let column = noise.by_further.column(k);
            covariance += column * column.transpose() * variance[k];
        }
    }
    covariance
}

/// zᵀS⁻¹z; infinite where S is not positive definite.
pub(super) fn norm_squared(innovation: &Innovation, s: &Rows) -> f64 {
    let m = innovation.rows;
    let z = innovation.residual.rows(0, m);
    let factor = s.view((0, 0), (m, m)).into_owned().cholesky();
    factor.map_or(f64::INFINITY, |factor| z.dot(&factor.solve(&z)))
}

/// The factor on the part `own` of S with which NIS is what it is expected to be, its degrees of freedom and what no
/// factor explains; 1 where it is less already.
pub(super) fn matching_factor(innovation: &Innovation, s: &Rows, own: &Rows) -> f64 {
    let nis = |factor: f64| norm_squared(innovation, &(s + own * (factor - 1.0)));
    let expected = innovation.degrees as f64 + nis(UNINFORMATIVE_FACTOR);
    let (mut low, mut high) = (0.0, UNINFORMATIVE_FACTOR.ln());
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if nis(middle.exp()) > expected {
            low = middle;
        } else {
            high = middle;
        }
    }
    high.exp()
}

#[cfg(test)]
#[path = "charge_tests.rs"]
mod tests;
