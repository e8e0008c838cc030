//! Aiding methods from outside the kernel: anything that turns a ping into rows flies in every loop under its own name.
//!
//! The kernel propagates, gates and updates; the method says what a ping measures. The built-in methods do not pass here.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::RwLock;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::aiding::velocity::velocity;
use crate::aiding::{BeamTerms, Innovation, MAX_ROWS, RowJacobian};
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error::{NavError, require_finite, require_finite_squares};
use crate::frames::Vec3;
use crate::layout::DIM;
use crate::navigator::event_loop::BeamAiding;
use crate::navigator::methods::{METHODS, Method};
use crate::state::{Covariance, NavState};

/// A method that says what a ping measures.
///
/// The outcome is a function of the arguments alone: the same method serves all runs, on any thread, and may be asked about a
/// ping again (after an inflation of the covariance, or where late data replay it).
pub trait BeamMethod: Send + Sync {
    /// What the valid beams of a ping measure.
    ///
    /// # Errors
    /// A line that says what went wrong; it ends the run, which names method and time.
    fn ping(&self, beams: &PingBeams<'_>, prior: &PingPrior<'_>) -> Result<Measured, String>;

    /// What it is called in messages, beside its name: its type.
    fn label(&self) -> &str {
        std::any::type_name::<Self>()
    }
}

/// The beams of a ping, as the filter sees them before the update.
#[derive(Debug, Clone, Copy)]
pub struct PingBeams<'a> {
    /// Time of validity, readings and valid beams, after the rejection of outliers where that is on.
    pub ping: &'a BeamSample,
    /// Directions, lever arms, sound speed.
    pub geometry: &'a BeamGeometry,
    /// Residual, Jacobian and noise of each valid beam, indexed by beam: the rows of tight coupling.
    pub terms: &'a BeamTerms,
}

/// The estimate before the ping.
#[derive(Debug, Clone, Copy)]
pub struct PingPrior<'a> {
    /// The state.
    pub state: &'a NavState,
    /// Its covariance, in the order of [`crate::layout`].
    pub covariance: &'a Covariance,
    /// Angular rate ω_tp, platform frame, rad/s.
    pub omega_tp_p_radps: Vector3<f64>,
}

/// What a method makes of a ping.
// One is made and taken at each ping; on the heap it would cost more.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, PartialEq)]
pub enum Measured {
    /// Nothing: the filter goes on without the ping.
    Nothing,
    /// A velocity over ground, with its covariance; its scale factor is that of the DVL, its other errors are white.
    Fix {
        /// Platform frame, m/s.
        velocity_p_mps: Vector3<f64>,
        /// (m/s)², positive definite.
        cov_m2ps2: Matrix3<f64>,
    },
    /// Rows z = H δx + n, up to [`MAX_ROWS`].
    Rows(MeasuredRows),
}

/// Rows of a measurement; what lies beyond `rows` is not read.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredRows {
    /// Their number.
    pub rows: usize,
    /// Measured minus expected.
    pub residual: SVector<f64, MAX_ROWS>,
    /// H, by the error states (true minus estimate) of [`crate::layout`].
    pub jacobian: RowJacobian,
    /// Covariance of n, positive definite.
    pub noise: SMatrix<f64, MAX_ROWS, MAX_ROWS>,
}

impl MeasuredRows {
    /// Rows of slices, row by row; of more than the filter takes the number alone is kept, which it refuses.
    #[must_use]
    pub fn of(residual: &[f64], jacobian: &[f64], noise: &[f64]) -> Self {
        let rows = residual.len();
        let entry = |values: &[f64], row: usize, column: usize, width: usize| match row < rows && column < width {
            true => values[row * width + column],
            false => 0.0,
        };
        Self {
            rows,
            residual: SVector::from_fn(|row, _| entry(residual, row, 0, 1)),
            jacobian: RowJacobian::from_fn(|row, state| entry(jacobian, row, state, DIM)),
            noise: SMatrix::from_fn(|row, column| entry(noise, row, column, rows)),
        }
    }
}

impl Measured {
    /// As the filter takes it.
    ///
    /// # Errors
    /// [`NavError`] for numbers that are not finite, a covariance that is not positive definite, and too many rows.
    pub(super) fn innovation(&self, state: &NavState) -> Result<Innovation, NavError> {
        let time_ns = state.time_ns;
        match self {
            Self::Nothing => Ok(Innovation::empty()),
            Self::Fix {
                velocity_p_mps,
                cov_m2ps2,
            } => {
                require_finite("velocity_p_mps", time_ns, velocity_p_mps.as_slice())?;
                require_covariance("cov_m2ps2", time_ns, cov_m2ps2)?;
                Ok(velocity(state, &Vec3::from(*velocity_p_mps), cov_m2ps2))
            }
            Self::Rows(given) => given.innovation(time_ns),
        }
    }
}

impl MeasuredRows {
    fn innovation(&self, time_ns: i64) -> Result<Innovation, NavError> {
        let count = self.rows;
        if count > MAX_ROWS {
            return Err(NavError::WrongCount {
                field: "rows",
                got: count,
                expected: format!("at most {MAX_ROWS}"),
            });
        }
        let mut innovation = Innovation::empty();
        (innovation.rows, innovation.degrees) = (count, count);
        let mut noise = SMatrix::<f64, MAX_ROWS, MAX_ROWS>::identity();
        for row in 0..count {
            innovation.residual[row] = self.residual[row];
            innovation.jacobian.set_row(row, &self.jacobian.row(row));
            for other in 0..count {
                noise[(row, other)] = self.noise[(row, other)];
                innovation.noise[(row, other)] = self.noise[(row, other)];
            }
        }
        require_finite("residual", time_ns, innovation.residual.as_slice())?;
        require_finite("jacobian", time_ns, innovation.jacobian.as_slice())?;
        require_covariance("noise", time_ns, &noise)?;
        Ok(innovation)
    }
}

/// Checks that a matrix is a covariance.
fn require_covariance<const N: usize>(
    matrix: &'static str,
    time_ns: i64,
    values: &SMatrix<f64, N, N>,
) -> Result<(), NavError> {
    require_finite_squares(matrix, time_ns, values.as_slice())?;
    let symmetric = (values - values.transpose()).amax() <= 1e-9 * values.amax();
    if symmetric && values.cholesky().is_some() {
        return Ok(());
    }
    Err(NavError::NotPositiveDefinite { matrix, time_ns })
}

struct Entry {
    name: &'static str,
    method: Option<Box<dyn BeamMethod>>,
}

static ENTRIES: RwLock<Vec<OwnMethod>> = RwLock::new(Vec::new());
static MISSING: Entry = Entry { name: "", method: None };

/// A registered method; it lives as long as the process.
#[derive(Clone, Copy)]
pub struct OwnMethod(&'static Entry);

impl OwnMethod {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// False for one that was read from bytes where nothing of its name is registered.
    #[must_use]
    pub fn is_registered(self) -> bool {
        self.0.method.is_some()
    }

    /// What the ping measures, as the filter takes it.
    ///
    /// # Errors
    /// [`NavError::OwnMethod`], with time and method.
    pub(super) fn innovation(self, beams: &PingBeams<'_>, prior: &PingPrior<'_>) -> Result<Innovation, NavError> {
        let fault = |fault: String| NavError::OwnMethod {
            method: self.0.name,
            time_ns: beams.ping.time_ns,
            fault,
        };
        let Some(method) = &self.0.method else {
            return Err(fault("is not registered here".into()));
        };
        let measured = method
            .ping(beams, prior)
            .map_err(|error| fault(format!("{}: {error}", method.label())))?;
        measured
            .innovation(prior.state)
            .map_err(|error| fault(format!("{}: {error}", method.label())))
    }
}

impl fmt::Debug for OwnMethod {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "OwnMethod({})", self.0.name)
    }
}

impl PartialEq for OwnMethod {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.0, other.0)
    }
}

impl Eq for OwnMethod {}

impl Hash for OwnMethod {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.name.hash(state);
    }
}

/// By name: the method itself is not saved.
impl Serialize for OwnMethod {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.name.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for OwnMethod {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Ok(registered(&name).unwrap_or(Self(&MISSING)))
    }
}

/// The method of a name that was registered last.
pub(super) fn registered(name: &str) -> Option<OwnMethod> {
    let entries = ENTRIES.read().unwrap_or_else(std::sync::PoisonError::into_inner);
    entries.iter().rev().find(|one| one.0.name == name).copied()
}

/// Registers a method under a name, so that [`Method::named`] finds it; a method of that name from before is replaced for what
/// starts afterwards.
///
/// A method is kept until the process ends.
///
/// # Errors
/// [`NavError::UnknownName`] for the name of a built-in method, and one that is not lower-case letters, digits and
/// underscores.
pub fn register(name: &str, method: Box<dyn BeamMethod>) -> Result<Method, NavError> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let taken = METHODS.iter().any(|one| one.name == name);
    if taken || name.is_empty() || name.len() > 40 || !name.chars().all(plain) {
        return Err(NavError::UnknownName {
            what: "name for a method of one's own",
            name: name.into(),
            expected: "up to 40 lower-case letters, digits and underscores that are no built-in method",
        });
    }
    let mut entries = ENTRIES.write().unwrap_or_else(std::sync::PoisonError::into_inner);
    let own = OwnMethod(Box::leak(Box::new(Entry {
        name: Box::leak(name.to_owned().into_boxed_str()),
        method: Some(method),
    })));
    entries.retain(|one| one.0.name != name);
    entries.push(own);
    Ok(own.as_method())
}

impl OwnMethod {
    /// As the other methods.
    pub(super) fn as_method(self) -> Method {
        Method {
            name: self.0.name,
            aiding: BeamAiding::Own(self),
            all_beams: false,
        }
    }
}

#[cfg(test)]
#[path = "own_method_tests.rs"]
mod tests;
