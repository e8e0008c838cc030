//! The macros of [`crate::aiding::registry`] and of the sections of a model: the items that a sensor's line generates.

/// Declares the sensors: an enum of them, of their samples and of the names of their updates.
macro_rules! sensors {
    ($($kind:ident($sample:ty): $($report:ident = $name:literal),+;)+) => {
        /// The sensor of a measurement.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum SensorKind {
            $(#[doc = concat!("That of [`", stringify!($sample), "`].")] $kind),+
        }

        impl SensorKind {
            /// Every sensor, in the order in which measurements of the same time are taken.
            pub const ALL: [Self; SENSORS] = [$(Self::$kind),+];
        }

        /// Number of sensors.
        pub const SENSORS: usize = [$(stringify!($kind)),+].len();

        const DECLARATIONS: [Declaration; SENSORS] = [$(Declaration::of::<$sample>()),+];

        /// Report name of an update.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Sensor {
            /// Beams of the DVL.
            Beams,
            /// The assumption on sway through the water.
            Sway,
            /// The assumption on heave through the water.
            Heave,
            /// The bound on the speed.
            Speed,
            /// The prior of the vehicle's motion.
            Motion,
            /// Beams that the water returned.
            WaterTrack,
            $($(#[doc = concat!("`", $name, "`.")] $report,)+)+
        }

        impl Sensor {
            /// Number of report names.
            pub const COUNT: usize = 6 + [$($(stringify!($report)),+),+].len();

            /// What it measures; `None` for an assumption, and for the velocity relative to the water, which is no evidence against
            /// the filter.
            #[must_use]
            pub fn quantity(self) -> Option<Quantity> {
                match self {
                    Self::Beams => Some(Quantity::Velocity),
                    Self::Sway | Self::Heave | Self::Speed | Self::Motion | Self::WaterTrack => None,
                    other => reports()
                        .find(|(_, report)| report.sensor == other)
                        .and_then(|(_, report)| report.quantity),
                }
            }

            /// Its name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    Self::Beams => "beams",
                    Self::Sway => "sway",
                    Self::Heave => "heave",
                    Self::Speed => "speed",
                    Self::Motion => "motion",
                    Self::WaterTrack => "water_track",
                    $($(Self::$report => $name,)+)+
                }
            }
        }

        /// A measurement of any sensor beside the beams.
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
        pub enum Measurement {
            $(#[doc = concat!("[`", stringify!($sample), "`].")] $kind($sample)),+
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
                    #[allow(unreachable_patterns)]
                    other => Err(other),
                }
            }
        })+

        impl Measurement {
            /// Its sensor.
            #[must_use]
            pub const fn kind(&self) -> SensorKind {
                match self {
                    $(Self::$kind(_) => SensorKind::$kind),+
                }
            }

            /// Time of validity, ns.
            #[must_use]
            pub fn time_ns(&self) -> i64 {
                match self {
                    $(Self::$kind(sample) => sample.time_ns()),+
                }
            }

            /// Checks every number.
            ///
            /// # Errors
            /// [`NavError`] that names the field.
            pub fn validate(&self) -> Result<(), NavError> {
                match self {
                    $(Self::$kind(sample) => sample.validate()),+
                }
            }

            /// Its updates in order.
            pub fn reports(&self) -> impl Iterator<Item = Sensor> + use<'_> {
                let reports = self.kind().declaration().reports.iter().map(|report| report.sensor);
                reports.filter(|&report| match self {
                    $(Self::$kind(sample) => sample.gives(report)),+
                })
            }

            /// One of its updates.
            #[must_use]
            pub fn innovation(&self, report: Sensor, motion: &Motion<'_>, levers: &Levers) -> Innovation {
                match self {
                    $(Self::$kind(sample) => sample.innovation(report, motion, levers.of(self.kind()))),+
                }
            }

            /// Its values, in the order of the columns of its simulation.
            #[must_use]
            pub fn numbers(&self) -> Vec<f64> {
                match self {
                    $(Self::$kind(sample) => sample.numbers()),+
                }
            }
        }
    };
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

/// Declares the sections of a model side by side.
macro_rules! sections {
    ($($field:ident: $model:ty,)+) => {
        /// The sections of a model side by side, as they are written; a sensor that there is not has none.
        #[derive(serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(crate) struct Sections {
            environment: Environment,
            imu: ImuModel,
            initial: InitialModel,
            $(#[serde(default)] $field: Option<$model>,)+
        }

        impl From<Sections> for Model {
            fn from(sections: Sections) -> Self {
                Self {
                    environment: sections.environment,
                    imu: sections.imu,
                    initial: sections.initial,
                    sensors: SensorModels { $($field: sections.$field.unwrap_or_default(),)+ },
                }
            }
        }

        impl From<Model> for Sections {
            fn from(model: Model) -> Self {
                Self {
                    environment: model.environment,
                    imu: model.imu,
                    initial: model.initial,
                    $($field: Some(model.sensors.$field).filter(|section| *section != <$model>::default()),)+
                }
            }
        }
    };
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
pub(crate) use {model_section, models, sections, sensors};
