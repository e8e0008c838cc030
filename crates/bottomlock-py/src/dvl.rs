//! Beam geometry.

use bottomlock::dvl::geometry as core;
use bottomlock::dvl::geometry::{BeamMotion, Janus};
use bottomlock::error::LARGEST;
use bottomlock::frames::Vec3;
use nalgebra::Vector3;
use numpy::PyArrayDyn;
use pyo3::types::{PyBytes, PyType};

use crate::arrays::{array, floats, rows, vector};
use crate::prelude::*;
use crate::results::entries;

/// Directions and lever arms of the beams of a DVL, 1 to 8 beams.
///
/// Args:
///     directions_d: (beams, 3) unit vectors, DVL frame.
///     lever_arms_p_m: (beams, 3) lever arm of each transducer, platform frame, m; zero by default.
///     mounting_rpy_rad: (3,) roll, pitch, yaw (z-y-x) of the DVL frame in the platform frame; zero by default.
///     sound_speed_scale: ratio of assumed to true sound speed.
///
/// Raises:
///     KernelError: for a wrong shape, no beam or more than 8, or a direction that is not a unit vector, naming the
///         beam.
///
/// Source: Tal et al. 2017, Eqs. 12-16.
#[pyclass(frozen, module = "bottomlock._kernel")]
pub struct BeamGeometry {
    pub inner: core::BeamGeometry,
}

/// The beams of a DVL as users name it: of themselves, of what `read_geometry` returns, or by packaged name or file.
pub fn geometry(value: Argument) -> PyResult<core::BeamGeometry> {
    if let Ok(given) = value.cast::<BeamGeometry>() {
        return Ok(given.get().inner.clone());
    }
    let arguments = value.py().import("bottomlock.arguments")?;
    let named = arguments.call_method1("beam_geometry", (value,))?;
    Ok(named.cast::<BeamGeometry>()?.get().inner.clone())
}

/// Vectors in a frame, (count, 3).
fn vectors<F>(name: &str, value: Argument, count: Option<usize>) -> PyResult<Vec<Vec3<F>>> {
    let rows = rows::<3>(name, value, count)?.into_iter();
    Ok(rows.map(Vec3::from_array).collect())
}

/// Applies mounting, lever arms and sound speed to a geometry.
fn finish(
    mut geometry: core::BeamGeometry,
    lever_arms_p_m: Option<Argument>,
    mounting_rpy_rad: Option<Argument>,
    sound_speed_scale: f64,
) -> PyResult<BeamGeometry> {
    if let Some(angles) = mounting_rpy_rad {
        let name = "mounting_rpy_rad";
        geometry = geometry.mounted_by(name, vector(name, angles)?).map_err(raise)?;
    }
    if let Some(levers) = lever_arms_p_m {
        let levers = vectors("lever_arms_p_m", levers, Some(geometry.beams()))?;
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
        directions_d: Argument,
        lever_arms_p_m: Option<Argument>,
        mounting_rpy_rad: Option<Argument>,
        sound_speed_scale: f64,
    ) -> PyResult<Self> {
        let directions = vectors("directions_d", directions_d, None)?;
        let geometry = core::BeamGeometry::from_directions(&directions).map_err(raise)?;
        finish(geometry, lever_arms_p_m, mounting_rpy_rad, sound_speed_scale)
    }

    /// Four beams of equal tilt from the vertical, rad: "x" at azimuths 45, 135, 225, 315 deg, "+" at 0, 90, 180, 270
    /// deg (Eqs. 13 and 14).
    #[staticmethod]
    #[pyo3(signature = (tilt_rad, *, configuration="x", lever_arms_p_m=None, mounting_rpy_rad=None, sound_speed_scale=1.0))]
    fn janus(
        tilt_rad: f64,
        configuration: &str,
        lever_arms_p_m: Option<Argument>,
        mounting_rpy_rad: Option<Argument>,
        sound_speed_scale: f64,
    ) -> PyResult<Self> {
        let layout = Janus::named("configuration", configuration).map_err(raise)?;
        let geometry = core::BeamGeometry::janus(layout, tilt_rad).map_err(raise)?;
        finish(geometry, lever_arms_p_m, mounting_rpy_rad, sound_speed_scale)
    }

    /// Beams by tilt from the vertical and azimuth from the bow towards starboard, each (beams,), rad (Eq. 13).
    #[staticmethod]
    #[pyo3(signature = (tilt_rad, azimuth_rad, *, lever_arms_p_m=None, mounting_rpy_rad=None, sound_speed_scale=1.0))]
    fn from_angles(
        tilt_rad: Argument,
        azimuth_rad: Argument,
        lever_arms_p_m: Option<Argument>,
        mounting_rpy_rad: Option<Argument>,
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
        let beams = self.inner.beams();
        entries(py, &[beams], (0..beams).map(|beam| *self.inner.direction_p(beam)))
    }

    /// (beams, 3) lever arm of each transducer, platform frame, m.
    #[getter]
    fn lever_arms_p_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let beams = self.inner.beams();
        entries(py, &[beams], (0..beams).map(|beam| *self.inner.lever_arm_p_m(beam)))
    }

    /// Number of beams.
    #[getter]
    fn beams(&self) -> usize {
        self.inner.beams()
    }

    /// Number of independent directions: 3 if all beams together determine a velocity.
    #[getter]
    fn rank(&self) -> usize {
        self.inner.rank()
    }

    /// Ratio of assumed to true sound speed.
    #[getter]
    fn sound_speed_scale(&self) -> f64 {
        self.inner.sound_speed_scale()
    }

    /// Noise-free beam readings (Eq. 15), (n, beams), m/s.
    ///
    /// Args:
    ///     velocity_p_mps: (n, 3) velocity over ground, platform frame, m/s.
    ///     omega_tp_p_radps: (n, 3) angular rate relative to the tangent frame, rad/s, for the lever arms; zero by
    ///         default.
    ///     beam_bias_mps: (beams,) bias of each beam, m/s; zero by default.
    ///     scale_factor: scale factor error.
    #[pyo3(signature = (velocity_p_mps, *, omega_tp_p_radps=None, beam_bias_mps=None, scale_factor=0.0))]
    fn beam_velocities<'py>(
        &self,
        py: Python<'py>,
        velocity_p_mps: Argument,
        omega_tp_p_radps: Option<Argument>,
        beam_bias_mps: Option<Argument>,
        scale_factor: f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let velocities = rows::<3>("velocity_p_mps", velocity_p_mps, None)?;
        let beams = self.inner.beams();
        let rates = omega_tp_p_radps.map(|value| rows::<3>("omega_tp_p_radps", value, Some(velocities.len())));
        let rates = rates.transpose()?.unwrap_or_else(|| vec![[0.0; 3]; velocities.len()]);
        let bias = beam_bias_mps.map(|value| floats("beam_bias_mps", value, &[Some(beams)]));
        let bias = bias.transpose()?.map_or_else(|| vec![0.0; beams], |bias| bias.values);
        if let Some(beam) = bias.iter().position(|bias| !(bias.abs() < LARGEST)) {
            let (number, given) = (beam + 1, bias[beam]);
            return Err(invalid(format!(
                "beam_bias_mps of beam {number} is {given}, expected a finite number"
            )));
        }
        let mut out = Vec::with_capacity(velocities.len() * beams);
        for (row, (velocity, rate)) in velocities.iter().zip(&rates).enumerate() {
            let motion = BeamMotion {
                velocity_p_mps: Vector3::from(*velocity),
                omega_tp_p_radps: Vector3::from(*rate),
                beam_bias_mps: [0.0; 4],
                scale_factor,
            };
            let readings = self.inner.readings_mps(&motion, &bias);
            out.extend(readings.map_err(|error| invalid(format!("row {row}: {}", error.timeless())))?);
        }
        array(py, out, &[velocities.len(), beams])
    }

    /// The geometry as bytes, with a format number and a digest.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.inner.to_bytes().map_err(raise)?))
    }

    /// The geometry of the bytes that `save` returned, bit for bit.
    ///
    /// Raises KernelError for bytes that are damaged, cut short, no geometry, or saved by another version.
    #[classmethod]
    fn load(_cls: &Bound<'_, PyType>, data: &[u8]) -> PyResult<Self> {
        let inner = core::BeamGeometry::from_bytes(data).map_err(raise)?;
        Ok(Self { inner })
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: Argument) -> Py<Self> {
        slf
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((slf.get_type().getattr("load")?, (slf.get().save(slf.py())?,)))
    }
}
