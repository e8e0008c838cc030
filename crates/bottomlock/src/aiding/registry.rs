//! The registry: one line for each aiding sensor.

use crate::aiding::acoustic_position::AcousticPositionSample;
use crate::aiding::attitude::AttitudeSample;
use crate::aiding::depth::DepthSample;
use crate::aiding::further::Processes;
use crate::aiding::gps::GpsSample;
use crate::aiding::heading::HeadingSample;
pub use crate::aiding::reports::{Sensor, reports};
use crate::aiding::sensor::{AidingSensor, Column, Reading, Scene, Section, Simulation};
use crate::aiding::thrust::ThrustSample;
use crate::aiding::velocity::VelocitySample;
use crate::aiding::{Innovation, Motion};
use crate::error::{LARGEST, NavError};
use crate::frames::{Platform, Vec3};
#[cfg(feature = "simulation")]
use crate::random::Normals;
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Declares the sensors, in the order in which measurements of the same time are taken.
macro_rules! sensors {
    ($($kind:ident($sample:ty)),+) => {
        /// The sensor of a measurement.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum SensorKind {
            $(#[doc = concat!("That of [`", stringify!($sample), "`].")] $kind),+
        }

        impl SensorKind {
            /// Every sensor.
            pub const ALL: [Self; SENSORS] = [$(Self::$kind),+];
        }

        /// Number of sensors.
        pub const SENSORS: usize = [$(stringify!($kind)),+].len();

        const DECLARATIONS: [Declaration; SENSORS] = [$(Declaration::of::<$sample>()),+];

        /// A measurement of any sensor beside the beams.
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
        pub enum Measurement {
            $(#[doc = concat!("[`", stringify!($sample), "`].")] $kind($sample)),+
        }

        impl Measurement {
            /// Its sensor.
            #[must_use]
            pub const fn kind(&self) -> SensorKind {
                match self {
                    $(Self::$kind(_) => SensorKind::$kind),+
                }
            }

            fn reading(&self) -> &dyn Reading {
                match self {
                    $(Self::$kind(sample) => sample),+
                }
            }
        }

        $(impl From<$sample> for Measurement {
            fn from(sample: $sample) -> Self {
                Self::$kind(sample)
            }
        }

        impl TryFrom<Measurement> for $sample {
            type Error = Measurement;
            fn try_from(measurement: Measurement) -> Result<Self, Measurement> {
                match measurement {
                    Measurement::$kind(sample) => Ok(sample),
                    other => Err(other),
                }
            }
        })+
    };
}
sensors! {
    Velocity(VelocitySample),
    Depth(DepthSample),
    Attitude(AttitudeSample),
    Heading(HeadingSample),
    Gps(GpsSample),
    AcousticPosition(AcousticPositionSample),
    Thrust(ThrustSample)
}

impl Measurement {
    /// [`Reading::time_ns`].
    #[must_use]
    pub fn time_ns(&self) -> i64 {
        self.reading().time_ns()
    }

    /// [`Reading::validate`].
    ///
    /// # Errors
    /// [`NavError`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        self.reading().validate()
    }

    /// Its updates in order.
    pub fn reports(&self) -> impl Iterator<Item = Sensor> + use<'_> {
        let of_kind = reports().filter(|(kind, _)| *kind == self.kind());
        of_kind
            .map(|(_, report)| report)
            .filter(|&report| self.reading().gives(report))
    }

    /// One of its updates.
    #[must_use]
    pub fn innovation(&self, report: Sensor, motion: &Motion<'_>, levers: &Levers) -> Innovation {
        self.reading().innovation(report, motion, levers.of(self.kind()))
    }

    /// [`Reading::numbers`].
    #[must_use]
    pub fn numbers(&self) -> Vec<f64> {
        self.reading().numbers()
    }
}

/// Declares the models of the sensors, a section each.
macro_rules! models {
    ($($field:ident: $model:ty,)+) => {
        /// Assumed errors of the aiding sensors.
        #[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
        pub struct SensorModels {
            $(#[doc = concat!("[`", stringify!($model), "`].")] pub $field: $model,)+
        }

        impl SensorModels {
            /// Checks every number.
            ///
            /// # Errors
            /// [`NavError::OutOfRange`] or [`NavError::NotFinite`] that names the field.
            pub fn validate(&self) -> Result<(), NavError> {
                $(self.$field.validate()?;)+
                Ok(())
            }

            /// Reads the section of a name and checks its numbers.
            ///
            /// # Errors
            /// As [`crate::error::setting::read`] and [`Self::validate`]; [`NavError::UnknownName`] for a name that is none of them.
            pub(crate) fn check<'de, D>(name: &str, source: D) -> Result<(), NavError>
            where
                D: serde::Deserializer<'de, Error: std::fmt::Display>,
            {
                $(if name == <$model as Section>::NAME {
                    return crate::error::setting::read::<$model, D>(name, source)?.validate();
                })+
                Err(NavError::UnknownName {
                    what: "settings",
                    name: name.into(),
                    expected: concat!("options, model, environment, imu, initial", $(", ", stringify!($field)),+),
                })
            }
        }
    };
}

/// Gives a macro the models of the sensors, each with the name of its section.
macro_rules! sensor_models {
    ($then:ident) => {
        $then! {
            dvl: crate::aiding::beams::DvlModel,
            dvl_outliers: crate::aiding::beams::DvlOutlierModel,
            depth: crate::aiding::depth::DepthModel,
            magnetometer: crate::aiding::attitude::MagnetometerModel,
            heading: crate::aiding::heading::HeadingModel,
            gps: crate::aiding::gps::GpsModel,
            acoustic_position: crate::aiding::acoustic_position::AcousticPositionModel,
            water_track: crate::aiding::water_track::WaterTrackModel,
            thrust: crate::aiding::thrust::ThrustModel,
        }
    };
}
pub(crate) use sensor_models;

sensor_models!(models);

impl SensorModels {
    /// Slow errors of the readings as further states.
    pub(crate) fn processes(&self) -> Vec<Processes> {
        [
            self.depth.processes(),
            self.magnetometer.processes(),
            self.heading.processes(),
        ]
        .concat()
    }
}

/// [`AidingSensor::of_row`] of a sensor.
type OfRow = fn(i64, &[Option<&[f64]>], &SensorModels) -> Option<Measurement>;

/// The declaration of a sensor as plain values.
#[derive(Debug, Clone, Copy)]
pub struct Declaration {
    /// [`AidingSensor::STREAM`].
    pub stream: &'static str,
    /// [`AidingSensor::LEVER`].
    pub lever: Option<&'static str>,
    /// [`AidingSensor::LOG`].
    pub log: &'static [Column],
    /// [`AidingSensor::SIMULATION`].
    pub simulation: Option<Simulation>,
    of_truth: fn(&Motion<'_>, &Vec3<Platform>, &SensorModels) -> Measurement,
    of_row: OfRow,
    #[cfg(feature = "simulation")]
    simulate: fn(&Scene<'_>, &mut [Normals]) -> Option<Measurement>,
}

impl Declaration {
    const fn of<S: AidingSensor>() -> Self {
        Self {
            stream: S::STREAM,
            lever: S::LEVER,
            log: S::LOG,
            simulation: S::SIMULATION,
            of_truth: |motion, lever, models| S::of_truth(motion, lever, models).into(),
            of_row: |time_ns, values, models| S::of_row(time_ns, values, models).map(Into::into),
            #[cfg(feature = "simulation")]
            simulate: |scene, random| S::simulate(scene, random).map(Into::into),
        }
    }

    /// [`AidingSensor::of_truth`].
    #[must_use]
    pub fn of_truth(&self, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>, models: &SensorModels) -> Measurement {
        (self.of_truth)(motion, lever_p_m, models)
    }

    /// [`AidingSensor::of_row`] at every time; the columns are those of [`AidingSensor::LOG`], `None` for one that is left out.
    #[must_use]
    pub fn of_rows(&self, times_ns: &[i64], columns: &[Option<Vec<f64>>], models: &SensorModels) -> Vec<Measurement> {
        let of_row = |(row, &time_ns): (usize, &i64)| {
            let values = columns.iter().zip(self.log).map(|(column, Column { width, .. })| {
                let values = column.as_ref()?;
                Some(&values[row * width..(row + 1) * width])
            });
            (self.of_row)(time_ns, &values.collect::<Vec<_>>(), models)
        };
        times_ns.iter().enumerate().filter_map(of_row).collect()
    }

    /// [`AidingSensor::simulate`].
    #[cfg(feature = "simulation")]
    #[must_use]
    pub fn simulate(&self, scene: &Scene<'_>, random: &mut [Normals]) -> Option<Measurement> {
        (self.simulate)(scene, random)
    }
}

impl SensorKind {
    /// Its declaration.
    #[must_use]
    pub const fn declaration(self) -> &'static Declaration {
        &DECLARATIONS[self as usize]
    }
}

/// Names of the streams of a navigator and of a log, in the order in which measurements of the same time are taken.
pub const STREAM_NAMES: [&str; STREAMS] = {
    let mut names = ["imu"; STREAMS];
    names[1] = "dvl";
    let mut kind = 0;
    while kind < SENSORS {
        names[2 + kind] = DECLARATIONS[kind].stream;
        kind += 1;
    }
    names[WATER_TRACK] = "water_track";
    names
};
/// Place of the beams that the water returned, behind the sensors.
pub const WATER_TRACK: usize = 2 + SENSORS;
/// Number of streams: inertial readings, pings, one for each sensor, and the beams that the water returned.
pub const STREAMS: usize = WATER_TRACK + 1;

/// Lever arm of each sensor, platform frame, m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Levers([Vec3<Platform>; SENSORS]);

impl Levers {
    /// Lever arm of a sensor.
    #[must_use]
    pub const fn of(&self, kind: SensorKind) -> &Vec3<Platform> {
        &self.0[kind as usize]
    }

    /// The same with another lever arm of one sensor.
    #[must_use]
    pub fn with(mut self, kind: SensorKind, lever_p_m: Vec3<Platform>) -> Self {
        self.0[kind as usize] = lever_p_m;
        self
    }

    /// The sensors that have a lever arm, with its key.
    fn keys() -> impl Iterator<Item = (SensorKind, &'static str)> {
        let all = SensorKind::ALL.into_iter();
        all.filter_map(|kind| kind.declaration().lever.map(|key| (kind, key)))
    }

    /// Checks every number; `place` is the name of the lever arms in messages.
    ///
    /// # Errors
    /// [`NavError::Setting`] that names the lever arm.
    pub fn validate(&self, place: &str) -> Result<(), NavError> {
        for (kind, key) in Self::keys() {
            if let Some(value) = self
                .of(kind)
                .to_array()
                .into_iter()
                .find(|value| !(value.abs() < LARGEST))
            {
                let found = format!("is {value}");
                return Err(NavError::setting(format!("{place}.{key}"), found, "numbers of metres"));
            }
        }
        Ok(())
    }
}

impl Serialize for Levers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(Self::keys().count()))?;
        for (kind, key) in Self::keys() {
            map.serialize_entry(key, &self.of(kind).to_array())?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Levers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ByKey;

        impl<'de> Visitor<'de> for ByKey {
            type Value = Levers;

            fn expecting(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                text.write_str("a map of lever arms")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Levers, A::Error> {
                let mut levers = Levers::default();
                while let Some(given) = map.next_key::<String>()? {
                    let Some((kind, _)) = Levers::keys().find(|(_, key)| *key == given) else {
                        return Err(A::Error::unknown_field(&given, &LEVERS));
                    };
                    levers = levers.with(kind, map.next_value()?);
                }
                Ok(levers)
            }
        }

        deserializer.deserialize_map(ByKey)
    }
}

/// Number of sensors with a lever arm.
const LEVER_COUNT: usize = {
    let (mut count, mut kind) = (0, 0);
    while kind < SENSORS {
        count += DECLARATIONS[kind].lever.is_some() as usize;
        kind += 1;
    }
    count
};

/// Keys of the lever arms.
const LEVERS: [&str; LEVER_COUNT] = {
    let (mut keys, mut count, mut kind) = ([""; LEVER_COUNT], 0, 0);
    while kind < SENSORS {
        if let Some(key) = DECLARATIONS[kind].lever {
            keys[count] = key;
            count += 1;
        }
        kind += 1;
    }
    keys
};
