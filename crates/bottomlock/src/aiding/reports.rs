//! Report names of the updates: one line for each.

use crate::aiding::registry::SensorKind;
use crate::aiding::sensor::Quantity;

/// Declares the report names of updates: what each is, its name, its sensor, and what it measures.
macro_rules! report_names {
    ($($(#[$doc:meta])* $report:ident: $name:literal, $kind:expr, $quantity:expr;)+) => {
        /// Report name of an update.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Sensor {
            $($(#[$doc])* $report,)+
        }

        impl Sensor {
            /// Number of report names.
            pub const COUNT: usize = [$($name),+].len();

            const ALL: [(Self, &'static str, Option<SensorKind>, Option<Quantity>); Self::COUNT] =
                [$((Self::$report, $name, $kind, $quantity)),+];
        }
    };
}
report_names! {
    /// Beams of the DVL.
    Beams: "beams", None, Some(Quantity::Velocity);
    /// The assumption on sway through the water.
    Sway: "sway", None, None;
    /// The assumption on heave through the water.
    Heave: "heave", None, None;
    /// The bound on the speed.
    Speed: "speed", None, None;
    /// The prior of the vehicle's motion.
    Motion: "motion", None, None;
    /// Beams that the water returned.
    WaterTrack: "water_track", None, None;
    /// A velocity.
    Velocity: "velocity", Some(SensorKind::Velocity), Some(Quantity::Velocity);
    /// A depth.
    Depth: "depth", Some(SensorKind::Depth), Some(Quantity::Position);
    /// An attitude.
    Attitude: "attitude", Some(SensorKind::Attitude), Some(Quantity::Angle);
    /// A heading.
    Heading: "heading", Some(SensorKind::Heading), Some(Quantity::Angle);
    /// Position of a GPS receiver.
    GpsPosition: "gps_position", Some(SensorKind::Gps), Some(Quantity::Position);
    /// Velocity of a GPS receiver.
    GpsVelocity: "gps_velocity", Some(SensorKind::Gps), Some(Quantity::Velocity);
    /// A position by acoustics.
    AcousticPosition: "acoustic_position", Some(SensorKind::AcousticPosition), Some(Quantity::Position);
    /// Speed by the drives along surge.
    ThrustSurge: "thrust_surge", Some(SensorKind::Thrust), None;
    /// Speed by the drives along sway.
    ThrustSway: "thrust_sway", Some(SensorKind::Thrust), None;
    /// Speed by the drives along heave.
    ThrustHeave: "thrust_heave", Some(SensorKind::Thrust), None;
}

impl Sensor {
    /// What it measures; `None` for an assumption, and for the velocity relative to the water, which is no evidence against the
    /// filter.
    #[must_use]
    pub const fn quantity(self) -> Option<Quantity> {
        Self::ALL[self as usize].3
    }

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// Each sensor with the report names of its updates, in order.
pub fn reports() -> impl Iterator<Item = (SensorKind, Sensor)> {
    let all = Sensor::ALL.into_iter();
    all.filter_map(|(report, _, kind, _)| kind.map(|kind| (kind, report)))
}
