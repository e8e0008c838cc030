//! Beam geometry and velocity from beams.

use bottomlock::dvl::fix::{FixOutcome, PingContext, VelocityFix, VelocityPrior, solve};
use bottomlock::dvl::geometry as core;
use bottomlock::dvl::geometry::{BeamMotion, BeamSample, Janus, MAX_BEAMS};
use bottomlock::dvl::partial::{Assumptions, Component, PartialMethod, Reason};
use bottomlock::frames::{Rot, Vec3};
use nalgebra::{Matrix3, Vector3};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, booleans, floats, from_rows, rows, vector};
use crate::errors::{raise, refuse};
use crate::settings::mask;

/// Directions and lever arms of the beams of a DVL, 1 to 8 beams.
///
/// Args:
///     directions_d: (beams, 3) unit vectors in the DVL's own frame.
///     lever_arms_p_m: (beams, 3) place of each transducer in the platform frame; zero by default.
///     mounting_rpy_rad: (3,) roll, pitch, yaw (z-y-x) of the DVL frame in the platform frame; zero by default.
///     sound_speed_scale: sound speed that the instrument assumes over the true one.
///
/// Raises:
///     KernelError: for a wrong shape, no beam or more than 8, or a direction that is not a unit vector, naming the beam.
///
/// Source: Tal et al. 2017, Eqs. 12-16.
#[pyclass(frozen, module = "bottomlock._kernel")]
pub struct BeamGeometry {
    pub inner: core::BeamGeometry,
}

fn finish(
    mut geometry: core::BeamGeometry,
    lever_arms_p_m: Option<&Bound<'_, PyAny>>,
    mounting_rpy_rad: Option<&Bound<'_, PyAny>>,
    sound_speed_scale: f64,
) -> PyResult<BeamGeometry> {
    if let Some(angles) = mounting_rpy_rad {
        let [roll, pitch, yaw] = vector("mounting_rpy_rad", angles)?;
        if !(roll + pitch + yaw).is_finite() {
            return Err(refuse("mounting_rpy_rad is not finite"));
        }
        geometry = geometry.mounted(Rot::from_euler_rad(roll, pitch, yaw));
    }
    if let Some(levers) = lever_arms_p_m {
        let levers: Vec<_> = rows::<3>("lever_arms_p_m", levers, Some(geometry.beams()))?
            .into_iter()
            .map(Vec3::from_array)
            .collect();
        geometry = geometry.with_lever_arms(&levers).map_err(raise)?;
    }
    let inner = geometry.with_sound_speed_scale(sound_speed_scale).map_err(raise)?;
    Ok(BeamGeometry { inner })
}

#[pymethods]
impl BeamGeometry {
    #[new]
    #[pyo3(signature = (directions_d, *, lever_arms_p_m=None, mounting_rpy_rad=None, sound_speed_scale=1.0))]
    fn new(
        directions_d: &Bound<'_, PyAny>,
        lever_arms_p_m: Option<&Bound<'_, PyAny>>,
        mounting_rpy_rad: Option<&Bound<'_, PyAny>>,
        sound_speed_scale: f64,
    ) -> PyResult<Self> {
        let directions: Vec<_> = rows::<3>("directions_d", directions_d, None)?
            .into_iter()
            .map(Vec3::from_array)
            .collect();
        let geometry = core::BeamGeometry::from_directions(&directions).map_err(raise)?;
        finish(geometry, lever_arms_p_m, mounting_rpy_rad, sound_speed_scale)
    }

    /// Four beams of equal tilt from the vertical, rad: "x" at azimuths 45, 135, 225, 315 deg, "+" at 0, 90, 180, 270 deg
    /// (Eqs. 13 and 14).
    #[staticmethod]
    #[pyo3(signature = (tilt_rad, *, configuration="x", lever_arms_p_m=None, mounting_rpy_rad=None, sound_speed_scale=1.0))]
    fn janus(
        tilt_rad: f64,
        configuration: &str,
        lever_arms_p_m: Option<&Bound<'_, PyAny>>,
        mounting_rpy_rad: Option<&Bound<'_, PyAny>>,
        sound_speed_scale: f64,
    ) -> PyResult<Self> {
        let layout = match configuration {
            "x" => Janus::X,
            "+" => Janus::Plus,
            other => return Err(refuse(format!("configuration is '{other}', expected 'x' or '+'"))),
        };
        let geometry = core::BeamGeometry::janus(layout, tilt_rad).map_err(raise)?;
        finish(geometry, lever_arms_p_m, mounting_rpy_rad, sound_speed_scale)
    }

    /// Beams by tilt from the vertical and azimuth from the bow towards starboard, each (beams,), rad (Eq. 13).
    #[staticmethod]
    #[pyo3(signature = (tilt_rad, azimuth_rad, *, lever_arms_p_m=None, mounting_rpy_rad=None, sound_speed_scale=1.0))]
    fn from_angles(
        tilt_rad: &Bound<'_, PyAny>,
        azimuth_rad: &Bound<'_, PyAny>,
        lever_arms_p_m: Option<&Bound<'_, PyAny>>,
        mounting_rpy_rad: Option<&Bound<'_, PyAny>>,
        sound_speed_scale: f64,
    ) -> PyResult<Self> {
        let tilts = floats("tilt_rad", tilt_rad, &[None])?.values;
        let azimuths = floats("azimuth_rad", azimuth_rad, &[Some(tilts.len())])?.values;
        let geometry = core::BeamGeometry::from_angles(&tilts, &azimuths).map_err(raise)?;
        finish(geometry, lever_arms_p_m, mounting_rpy_rad, sound_speed_scale)
    }

    /// (beams, 3) unit vectors in the platform frame, mounting applied.
    #[getter]
    fn directions_p<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let values: Vec<[f64; 3]> = (0..self.inner.beams())
            .map(|beam| (*self.inner.direction_p(beam)).into())
            .collect();
        from_rows(py, &values)
    }

    /// (beams, 3) place of each transducer in the platform frame, m.
    #[getter]
    fn lever_arms_p_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let values: Vec<[f64; 3]> = (0..self.inner.beams())
            .map(|beam| (*self.inner.lever_arm_p_m(beam)).into())
            .collect();
        from_rows(py, &values)
    }

    /// Number of beams.
    #[getter]
    fn beams(&self) -> usize {
        self.inner.beams()
    }

    /// Number of independent directions: 3 where all beams together determine a velocity.
    #[getter]
    fn rank(&self) -> usize {
        self.inner.rank()
    }

    /// Sound speed that the instrument assumes over the true one.
    #[getter]
    fn sound_speed_scale(&self) -> f64 {
        self.inner.sound_speed_scale()
    }

    /// What the beams read without noise (Eq. 15), (n, beams), m/s.
    ///
    /// Args:
    ///     velocity_p_mps: (n, 3) velocity over ground, platform frame.
    ///     rate_tp_p_radps: (n, 3) angular rate against the tangent frame, for the lever arms; zero by default.
    ///     beam_bias_mps: (beams,) bias of each beam; zero by default.
    ///     scale_factor: scale factor error.
    #[pyo3(signature = (velocity_p_mps, *, rate_tp_p_radps=None, beam_bias_mps=None, scale_factor=0.0))]
    fn beam_velocities<'py>(
        &self,
        py: Python<'py>,
        velocity_p_mps: &Bound<'py, PyAny>,
        rate_tp_p_radps: Option<&Bound<'py, PyAny>>,
        beam_bias_mps: Option<&Bound<'py, PyAny>>,
        scale_factor: f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let velocities = rows::<3>("velocity_p_mps", velocity_p_mps, None)?;
        let beams = self.inner.beams();
        let rates = match rate_tp_p_radps {
            Some(value) => rows::<3>("rate_tp_p_radps", value, Some(velocities.len()))?,
            None => vec![[0.0; 3]; velocities.len()],
        };
        let bias = match beam_bias_mps {
            Some(value) => floats("beam_bias_mps", value, &[Some(beams)])?.values,
            None => vec![0.0; beams],
        };
        let mut out = Vec::with_capacity(velocities.len() * beams);
        for (velocity, rate) in velocities.iter().zip(&rates) {
            let motion = BeamMotion {
                velocity_p_mps: Vector3::from(*velocity),
                rate_tp_p_radps: Vector3::from(*rate),
                beam_bias_mps: [0.0; 4],
                scale_factor,
            };
            for (beam, bias) in bias.iter().enumerate() {
                out.push((self.inner.beam_velocity_mps(beam, &motion) + bias) * self.inner.sound_speed_scale());
            }
        }
        array(py, out, &[velocities.len(), beams])
    }

    fn __repr__(&self) -> String {
        let beams: Vec<String> = (0..self.inner.beams())
            .map(|beam| {
                let d = self.inner.direction_p(beam);
                format!("({:.4}, {:.4}, {:.4})", d.x, d.y, d.z)
            })
            .collect();
        format!("BeamGeometry(directions_p=[{}])", beams.join(", "))
    }
}

fn method_of(name: &str) -> PyResult<PartialMethod> {
    Ok(match name {
        "least_squares" => PartialMethod::LeastSquares,
        "virtual_beam" => PartialMethod::VirtualBeam,
        "nullified_sway" => PartialMethod::NullifiedSway,
        "partial_loose" => PartialMethod::PartialLoose,
        "virtual_heave" => PartialMethod::VirtualHeave,
        "selector" => PartialMethod::Selector,
        "information" => PartialMethod::Information,
        "weak_sway" => PartialMethod::WeakSway,
        other => {
            return Err(refuse(format!(
                "unknown method '{other}', expected one of least_squares, virtual_beam, nullified_sway, partial_loose, \
                 virtual_heave, selector, information, weak_sway"
            )));
        }
    })
}

fn reason_code(component: Component) -> u8 {
    match component {
        Component::Solved => 0,
        Component::Unobservable(Reason::NoBeams) => 1,
        Component::Unobservable(Reason::OutsideRowSpace) => 2,
        Component::Unobservable(Reason::ConstraintSingular) => 3,
        Component::Unobservable(Reason::PriorRequired) => 4,
        Component::Unobservable(Reason::PriorOnly) => 5,
    }
}

pub fn source_code(method: PartialMethod) -> u8 {
    match method {
        PartialMethod::LeastSquares => 1,
        PartialMethod::VirtualBeam | PartialMethod::VirtualBeamExact => 2,
        PartialMethod::NullifiedSway => 3,
        PartialMethod::PartialLoose => 4,
        PartialMethod::VirtualHeave => 5,
        PartialMethod::Selector => 0,
        PartialMethod::Information => 6,
        PartialMethod::WeakSway => 7,
    }
}

#[derive(Default)]
struct Columns {
    velocity: Vec<f64>,
    cov: Vec<f64>,
    observed_velocity: Vec<f64>,
    information: Vec<f64>,
    component: Vec<u8>,
    status: Vec<u8>,
    rank: Vec<u8>,
    source: Vec<u8>,
}

impl Columns {
    fn push(&mut self, outcome: &FixOutcome) {
        match outcome {
            FixOutcome::Fix(fix) => self.fix(0, fix),
            FixOutcome::Unobservable(fix) => {
                let any = (0..3).any(|k| fix.estimator.is_solved(k));
                self.fix(if any { 1 } else { 2 }, fix);
            }
            FixOutcome::TooFewBeams => self.none(3, Reason::NoBeams),
            FixOutcome::PriorRequired => self.none(4, Reason::PriorRequired),
        }
    }

    fn fix(&mut self, status: u8, fix: &VelocityFix) {
        let estimator = &fix.estimator;
        for k in 0..3 {
            let solved = estimator.is_solved(k);
            self.velocity
                .push(if solved { fix.velocity_p_mps.0[k] } else { f64::NAN });
            self.component.push(reason_code(estimator.components[k]));
            self.source
                .push(if solved { source_code(estimator.sources[k]) } else { 0 });
            for l in 0..3 {
                let both = solved && estimator.is_solved(l);
                self.cov
                    .push(if both { estimator.covariance[(k, l)] } else { f64::NAN });
            }
        }
        let (axes, variances) = estimator.solution.principal_axes();
        let weights = variances.map(|variance| if variance > 0.0 { variance.recip() } else { 0.0 });
        let information: Matrix3<f64> = axes * Matrix3::from_diagonal(&weights) * axes.transpose();
        // Row by row; a symmetric matrix reads the same by columns.
        self.information.extend(information.iter());
        self.observed_velocity.extend(fix.velocity_p_mps.0.iter());
        self.status.push(status);
        self.rank.push(estimator.solution.rank as u8);
    }

    fn none(&mut self, status: u8, reason: Reason) {
        self.velocity.extend([f64::NAN; 3]);
        self.cov.extend([f64::NAN; 9]);
        self.information.extend([0.0; 9]);
        self.observed_velocity.extend([0.0; 3]);
        self.component.extend([reason_code(Component::Unobservable(reason)); 3]);
        self.source.extend([0; 3]);
        self.status.push(status);
        self.rank.push(0);
    }
}

/// Solves pings for the platform velocity; one row per ping.
#[pyfunction]
#[pyo3(signature = (geometry, velocity_mps, valid, *, method, beam_sd_mps, prior_velocity_p_mps=None,
    prior_cov_m2ps2=None, rate_tp_p_radps=None, virtual_beam_factor, nullified_sway_var_m2ps2,
    weak_sway_var_m2ps2))]
pub fn solve_velocity<'py>(
    py: Python<'py>,
    geometry: &BeamGeometry,
    velocity_mps: &Bound<'py, PyAny>,
    valid: &Bound<'py, PyAny>,
    method: &str,
    beam_sd_mps: &Bound<'py, PyAny>,
    prior_velocity_p_mps: Option<&Bound<'py, PyAny>>,
    prior_cov_m2ps2: Option<&Bound<'py, PyAny>>,
    rate_tp_p_radps: Option<&Bound<'py, PyAny>>,
    virtual_beam_factor: f64,
    nullified_sway_var_m2ps2: f64,
    weak_sway_var_m2ps2: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let beams = geometry.inner.beams();
    let readings = floats("velocity_mps", velocity_mps, &[None, Some(beams)])?;
    let count = readings.shape[0];
    let flags = booleans("valid", valid, &[Some(count), Some(beams)])?.values;
    let sd = floats("beam_sd_mps", beam_sd_mps, &[Some(beams)])?.values;
    let method = method_of(method)?;
    let priors = match (prior_velocity_p_mps, prior_cov_m2ps2) {
        (Some(velocity), Some(cov)) => {
            let velocity = rows::<3>("prior_velocity_p_mps", velocity, Some(count))?;
            let cov = floats("prior_cov_m2ps2", cov, &[Some(count), Some(3), Some(3)])?.values;
            let prior = |(k, velocity): (usize, [f64; 3])| VelocityPrior {
                velocity_p_mps: Vec3::from_array(velocity),
                cov_m2ps2: Matrix3::from_row_slice(&cov[9 * k..9 * k + 9]),
            };
            Some(velocity.into_iter().enumerate().map(prior).collect::<Vec<_>>())
        }
        (None, None) => None,
        _ => {
            return Err(refuse(
                "prior_velocity_p_mps and prior_cov_m2ps2 go together: give both or neither",
            ));
        }
    };
    let rates = rate_tp_p_radps
        .map(|value| rows::<3>("rate_tp_p_radps", value, Some(count)))
        .transpose()?;
    let assumptions = Assumptions {
        virtual_beam_factor,
        nullified_sway_var_m2ps2,
        weak_sway_var_m2ps2,
    };

    let columns = py.detach(|| -> Result<Columns, (usize, bottomlock::NavError)> {
        let mut columns = Columns::default();
        for row in 0..count {
            let mut ping = BeamSample {
                time_ns: 0,
                velocity_mps: [f64::NAN; MAX_BEAMS],
                sd_mps: [f64::NAN; MAX_BEAMS],
                valid: mask(&flags[row * beams..(row + 1) * beams]),
            };
            ping.velocity_mps[..beams].copy_from_slice(&readings.values[row * beams..(row + 1) * beams]);
            ping.sd_mps[..beams].copy_from_slice(&sd);
            let context = PingContext {
                rate_tp_p_radps: rates
                    .as_ref()
                    .map_or(Vector3::zeros(), |rates| Vector3::from(rates[row])),
                prior: priors.as_ref().map(|priors| priors[row]),
            };
            let outcome =
                solve(method, &geometry.inner, &ping, &context, &assumptions).map_err(|error| (row, error))?;
            columns.push(&outcome);
        }
        Ok(columns)
    });
    let columns = columns.map_err(|(row, error)| refuse(format!("row {row}: {}", row_message(&error))))?;
    let out = PyDict::new(py);
    out.set_item("velocity_p_mps", array(py, columns.velocity, &[count, 3])?)?;
    out.set_item("cov_m2ps2", array(py, columns.cov, &[count, 3, 3])?)?;
    out.set_item(
        "observed_velocity_p_mps",
        array(py, columns.observed_velocity, &[count, 3])?,
    )?;
    out.set_item("information_s2pm2", array(py, columns.information, &[count, 3, 3])?)?;
    out.set_item("component", array(py, columns.component, &[count, 3])?)?;
    out.set_item("status", array(py, columns.status, &[count])?)?;
    out.set_item("beams_used", array(py, flags, &[count, beams])?)?;
    out.set_item("rank", array(py, columns.rank, &[count])?)?;
    out.set_item("source", array(py, columns.source, &[count, 3])?)?;
    Ok(out)
}

/// The row says where; the time of a table's ping is not known to the kernel.
fn row_message(error: &bottomlock::NavError) -> String {
    error.to_string().replace(" at 0 ns", "")
}
