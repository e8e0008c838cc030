//! A measurement in the form that the filter processes, for any sensor.

use std::ops::Range;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::RowJacobian;
use crate::aiding::MAX_ROWS;
use crate::aiding::further::{FURTHER, FurtherRows, block};
use crate::layout::{DIM, POSITION, VELOCITY};

/// A measurement in the form that the filter processes: z = H δx + n.
#[derive(Debug, Clone, PartialEq)]
pub struct Innovation {
    /// Number of rows in use.
    pub rows: usize,
    /// Degrees of freedom for the gate (rows that carry information).
    pub degrees: usize,
    /// Measured minus expected.
    pub residual: SVector<f64, MAX_ROWS>,
    /// H, one row per measurement row.
    pub jacobian: RowJacobian,
    /// Covariance of n.
    pub noise: SMatrix<f64, MAX_ROWS, MAX_ROWS>,
    /// E[δx nᵀ] where the noise is correlated with the state error (Eq. 26).
    pub cross: Option<Box<SMatrix<f64, DIM, MAX_ROWS>>>,
    /// Cause of the correlation, for the smoother.
    pub correlated_noise: Option<Box<CorrelatedNoise>>,
    /// Jacobian by the further states, whose errors the filter has yet to add to the noise.
    pub by_further: Option<Box<FurtherRows>>,
    /// What the rows measure in the tangent frame.
    pub tangent_rows: TangentRows,
    /// The states that the rows correct.
    pub corrects: Corrects,
    /// Where given, an update moves the error state to it.
    pub corrected_path: Option<Box<CorrectedPath>>,
}

/// The path that a position corrects, by the error state of the linear model: δr ← A δr + B ρ + c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrectedPath {
    /// A; `None` for the identity.
    pub by_position: Option<Matrix3<f64>>,
    /// B, m.
    pub by_misalignment: Matrix3<f64>,
    /// c, which the residual is without.
    pub offset_t_m: Vector3<f64>,
}

/// The states that rows correct; of the others they change covariances only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Corrects {
    /// All.
    #[default]
    All,
    /// A depth its own axis of the position alone, and no further state.
    Depth,
    /// The velocity alone, and of the further states those of motion, thrust and water.
    Velocity,
    /// No state of the error state, and of the further states those of thrust and water.
    ThroughWater,
}

impl Corrects {
    /// The corrected states of the error state.
    #[must_use]
    pub const fn states(self) -> Range<usize> {
        match self {
            Self::All => 0..DIM,
            Self::Depth => POSITION + 2..POSITION + 3,
            Self::Velocity => VELOCITY..VELOCITY + 3,
            Self::ThroughWater => 0..0,
        }
    }

    /// The corrected further states.
    #[must_use]
    pub const fn further_states(self) -> Range<usize> {
        match self {
            Self::All => 0..FURTHER,
            Self::Depth => 0..0,
            Self::Velocity => block::MOTION.first..FURTHER,
            Self::ThroughWater => block::THRUST.first..FURTHER,
        }
    }
}

/// What rows measure in the tangent frame, where the linear model leaves a product of errors out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TangentRows {
    /// Nothing: rows in the platform frame, or a rotation.
    #[default]
    None,
    /// The velocity, north, east and down.
    Velocity,
    /// The position, north, east and down.
    Position,
    /// The third axis of the position alone.
    Depth,
    /// The yaw, whose Jacobian grows without bound towards the vertical; no row on end.
    Yaw,
}

/// Noise that contains errors of the state: n = D δx + D_f δf + independent.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelatedNoise {
    /// D.
    pub by_state: RowJacobian,
    /// D_f, by the states of [`crate::aiding::further`].
    pub by_further: FurtherRows,
}

impl Default for CorrelatedNoise {
    /// None.
    fn default() -> Self {
        Self {
            by_state: RowJacobian::zeros(),
            by_further: FurtherRows::zeros(),
        }
    }
}

impl CorrelatedNoise {
    /// The same of rows that are `axes` times these.
    pub(crate) fn turned(&self, axes: &SMatrix<f64, MAX_ROWS, MAX_ROWS>) -> Box<Self> {
        Box::new(Self {
            by_state: axes * self.by_state,
            by_further: axes * self.by_further,
        })
    }
}

impl Innovation {
    pub(crate) fn empty() -> Self {
        Self {
            rows: 0,
            degrees: 0,
            residual: SVector::zeros(),
            jacobian: RowJacobian::zeros(),
            noise: SMatrix::zeros(),
            cross: None,
            correlated_noise: None,
            by_further: None,
            tangent_rows: TangentRows::None,
            corrects: Corrects::default(),
            corrected_path: None,
        }
    }

    pub(super) fn vector(residual: Vector3<f64>, noise: &Matrix3<f64>) -> Self {
        let mut innovation = Self {
            rows: 3,
            degrees: 3,
            ..Self::empty()
        };
        innovation.residual.fixed_rows_mut::<3>(0).copy_from(&residual);
        innovation.noise.fixed_view_mut::<3, 3>(0, 0).copy_from(noise);
        innovation
    }

    pub(super) fn put(&mut self, column: usize, block: &Matrix3<f64>) {
        self.jacobian.fixed_view_mut::<3, 3>(0, column).copy_from(block);
    }

    /// Those of up to [`MAX_ROWS`] rows that are named, which carry information each.
    pub(super) fn picked(
        (residual, jacobian, noise): (&SVector<f64, MAX_ROWS>, &RowJacobian, &SMatrix<f64, MAX_ROWS, MAX_ROWS>),
        rows: impl Iterator<Item = usize> + Clone,
    ) -> Self {
        let mut out = Self::empty();
        for (to, from) in rows.clone().enumerate() {
            out.rows += 1;
            out.residual[to] = residual[from];
            out.jacobian.set_row(to, &jacobian.row(from));
            for (column, other) in rows.clone().enumerate() {
                out.noise[(to, column)] = noise[(from, other)];
            }
        }
        out.degrees = out.rows;
        out
    }

    /// The rows for which `keep` holds.
    #[must_use]
    pub(crate) fn select(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept = (0..self.rows).filter(|&row| keep(row));
        let mut out = Self::picked((&self.residual, &self.jacobian, &self.noise), kept.clone());
        out.cross = self.cross.as_ref().map(|cross| {
            let mut kept_cross = SMatrix::<f64, DIM, MAX_ROWS>::zeros();
            for (to, from) in kept.clone().enumerate() {
                kept_cross.set_column(to, &cross.column(from));
            }
            Box::new(kept_cross)
        });
        out.corrects = self.corrects;
        out.corrected_path.clone_from(&self.corrected_path);
        let selection = || {
            let mut selection = SMatrix::<f64, MAX_ROWS, MAX_ROWS>::zeros();
            kept.clone()
                .enumerate()
                .for_each(|(to, from)| selection[(to, from)] = 1.0);
            selection
        };
        let by_further = self.by_further.as_deref();
        out.by_further = by_further.map(|rows| Box::new(selection() * rows));
        out.correlated_noise = self.correlated_noise.as_ref().map(|noise| {
            let selection = selection();
            Box::new(CorrelatedNoise {
                by_state: selection * noise.by_state,
                by_further: selection * noise.by_further,
            })
        });
        out
    }
}
