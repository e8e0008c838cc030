//! The declaration of a sensor, for the event loop, the simulation, replay and the bindings.

use crate::aiding::registry::{Measurement, Sensor, SensorKind, SensorModels};
use crate::aiding::{Innovation, Motion};
use crate::earth::LocalLevel;
use crate::error::{NavError, require_finite, require_non_negative, require_positive};
use crate::frames::{Platform, Rot, Tangent, Vec3};
#[cfg(feature = "simulation")]
use crate::random::Normals;
use nalgebra::Vector3;

/// A reading of a sensor.
pub trait Reading {
    /// Time of validity, ns.
    fn time_ns(&self) -> i64;

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError`] that names the field.
    fn validate(&self) -> Result<(), NavError>;

    /// Whether the sample gives the update of a report.
    fn gives(&self, _report: Sensor) -> bool {
        true
    }

    /// The update of a report, of a sensor at `lever_p_m`.
    fn innovation(&self, report: Sensor, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>) -> Innovation;

    /// Its values, in the order of the columns of [`AidingSensor::SIMULATION`].
    fn numbers(&self) -> Vec<f64> {
        Vec::new()
    }
}

/// A sensor, by the type of its samples.
pub trait AidingSensor: Reading + Copy + Into<Measurement> {
    /// Its place in the registry.
    const KIND: SensorKind;
    /// Name of its stream, within which time rises; `<stream>_time_ns` is the key of its times in a log.
    const STREAM: &'static str;
    /// Key of its lever arm among the filter's options, where it has one.
    const LEVER: Option<&'static str> = None;
    /// Its columns in a recorded log; empty where a log has none of it.
    const LOG: &'static [Column] = &[];
    /// Its simulation, if it has one.
    const SIMULATION: Option<Simulation> = None;

    /// A sample of the true motion, with the noise of the models, for its Jacobian and noise.
    fn of_truth(motion: &Motion<'_>, lever_p_m: &Vec3<Platform>, models: &SensorModels) -> Self;

    /// A sample from a row of a log, a value for each of [`AidingSensor::LOG`].
    fn of_row(_time_ns: i64, _values: &[Option<&[f64]>], _models: &SensorModels) -> Option<Self> {
        None
    }

    /// A simulated sample.
    #[cfg(feature = "simulation")]
    fn simulate(_scene: &Scene<'_>, _random: &mut [Normals]) -> Option<Self> {
        None
    }
}

/// Quantity measured by an update.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// A position, m.
    Position,
    /// A velocity, m/s.
    Velocity,
    /// An angle, rad.
    Angle,
}

/// A column of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Its key.
    pub key: &'static str,
    /// Numbers per row.
    pub width: usize,
    /// Whether it is optional.
    pub optional: bool,
}

impl Column {
    /// A required column.
    #[must_use]
    pub const fn new(key: &'static str, width: usize) -> Self {
        Self {
            key,
            width,
            optional: false,
        }
    }
}

/// How a sensor is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Simulation {
    /// Its name in a schedule and in a table of readings.
    pub name: &'static str,
    /// Key of the environment's offset of its reading, if there is one.
    pub offset: Option<&'static str>,
    /// Numbers of its random streams, unique among the sensors.
    pub random: &'static [u64],
    /// Columns of its readings.
    pub columns: &'static [Column],
}

/// Inputs to the simulation of a sensor at one time.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// The true motion at that time.
    pub truth: &'a TrueMotion,
    /// North, east, down and depth at its position.
    pub level: LocalLevel,
    /// Offset of the reading from the environment.
    pub offset: f64,
    /// Lever arm, platform frame, m.
    pub lever_p_m: Vec3<Platform>,
    /// True errors of the sensors.
    pub actual: &'a SensorModels,
    /// Assumed errors, which give the reported standard deviations.
    pub claimed: &'a SensorModels,
}

/// The true motion at one time.
#[derive(Debug, Clone, Copy)]
pub struct TrueMotion {
    /// Tangent frame, m.
    pub position_t_m: Vector3<f64>,
    /// Platform to tangent.
    pub attitude_t_p: Rot<Tangent, Platform>,
    /// Platform frame, m/s.
    pub velocity_p_mps: Vector3<f64>,
    /// Inertial rate ω_ip, platform frame, rad/s.
    pub omega_p_radps: Vector3<f64>,
}

/// A section of a model; all zero for a model without the sensor.
pub trait Section: Copy + Default {
    /// Its name.
    const NAME: &'static str;

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError`] that names the field.
    fn validate(&self) -> Result<(), NavError>;
}

/// Declares a section of a model, with how it is checked.
macro_rules! model_section {
    ($(#[$doc:meta])* pub struct $model:ident in $section:literal {
        $($(#[$field_doc:meta])* pub $field:ident: $kind:ty,)+
    }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $model {
            $($(#[$field_doc])* pub $field: $kind,)+
        }

        impl $crate::aiding::sensor::Section for $model {
            const NAME: &'static str = $section;

            fn validate(&self) -> Result<(), $crate::error::NavError> {
                $($crate::aiding::sensor::Field::check(
                    &self.$field,
                    concat!($section, ".", stringify!($field)),
                )?;)+
                Ok(())
            }
        }
    };
}
pub(crate) use model_section;

/// A field of a section, and how it is checked.
pub trait Field: Copy {
    /// Checks it.
    ///
    /// # Errors
    /// [`NavError`] that names the field.
    fn check(&self, name: &'static str) -> Result<(), NavError>;
}

/// A standard deviation or a density: 0 or more.
impl Field for f64 {
    fn check(&self, name: &'static str) -> Result<(), NavError> {
        require_non_negative(name, *self)
    }
}

/// Three standard deviations: 0 or more.
impl Field for [f64; 3] {
    fn check(&self, name: &'static str) -> Result<(), NavError> {
        self.iter().try_for_each(|&value| require_non_negative(name, value))
    }
}

/// A fraction: 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, serde::Serialize, serde::Deserialize)]
pub struct Fraction(pub f64);

impl Field for Fraction {
    fn check(&self, name: &'static str) -> Result<(), NavError> {
        if (0.0..=1.0).contains(&self.0) {
            return Ok(());
        }
        Err(NavError::OutOfRange {
            field: name,
            value: self.0,
            expected: "0 to 1",
        })
    }
}

/// A number of either sign.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, serde::Serialize, serde::Deserialize)]
pub struct Signed(pub f64);

impl Field for Signed {
    fn check(&self, name: &'static str) -> Result<(), NavError> {
        require_finite(name, 0, &[self.0])
    }
}

/// Declares a time, s: more than 0, and so long where it is not given.
macro_rules! time {
    ($(#[$doc:meta])* $name:ident = $default:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, serde::Serialize, serde::Deserialize)]
        pub struct $name(pub f64);

        impl Default for $name {
            fn default() -> Self {
                Self($default)
            }
        }

        impl Field for $name {
            fn check(&self, name: &'static str) -> Result<(), NavError> {
                require_positive(name, self.0)
            }
        }
    };
}

time! {
    /// A correlation time, s: six hours where it is not given, half a semidiurnal tide.
    TimeConstant = 21_600.0
}
time! {
    /// Correlation time of a slow error, s: five minutes where it is not given.
    WalkTime = 300.0
}
time! {
    /// Mean period of waves, s: eight seconds where it is not given.
    WavePeriod = 8.0
}

/// Standard deviation of a slow error, rad: 0 or more, and 0, which is none, where it is not given.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, serde::Serialize, serde::Deserialize)]
pub struct SlowSd(pub f64);

impl Field for SlowSd {
    fn check(&self, name: &'static str) -> Result<(), NavError> {
        require_non_negative(name, self.0)
    }
}

/// A position: any finite numbers.
impl Field for Vec3<Tangent> {
    fn check(&self, name: &'static str) -> Result<(), NavError> {
        require_finite(name, 0, &self.to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a field may be: the ends of its range and the numbers just beyond.
    #[test]
    fn fields_have_their_ranges() {
        assert_eq!(
            [0.0, 3.0, -1e-9, f64::NAN].map(|value| value.check("field").is_ok()),
            [true, true, false, false]
        );
        assert!([0.0, 1.0, 2.0].check("field").is_ok() && [0.0, -1.0, 2.0].check("field").is_err());
        let fractions = [0.0, 1.0, -1e-9, 1.1].map(|value| Fraction(value).check("field").is_ok());
        assert_eq!(fractions, [true, true, false, false]);
        let times = [1e-9, 0.0, -1.0, f64::INFINITY].map(|value| TimeConstant(value).check("field").is_ok());
        assert_eq!(times, [true, false, false, false]);
        assert!(SlowSd(0.0).check("field").is_ok() && SlowSd(-1e-9).check("field").is_err());
        assert!(WalkTime(1.0).check("field").is_ok() && WalkTime(0.0).check("field").is_err());
        assert!(WavePeriod(1.0).check("field").is_ok() && WavePeriod(0.0).check("field").is_err());
        let places = [-7.0, f64::NAN].map(|value| Vec3::<Tangent>::new(0.0, 0.0, value).check("field").is_ok());
        assert_eq!(places, [true, false]);
        let text = Fraction(1.5).check("fraction").unwrap_err().to_string();
        assert_eq!(text, "fraction is 1.5, expected 0 to 1");
    }
}
