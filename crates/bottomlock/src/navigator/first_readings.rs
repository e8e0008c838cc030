//! Units of the first readings of a stream: bounds that no instrument under water exceeds, and the likely mistake.
//!
//! A single reading may be anything; a mean over a second may not. A vehicle under water is not in free fall, whatever waves and
//! tow cables do to it, so the specific force averages to something near gravity, and points up by the estimate's attitude.

use serde::{Deserialize, Serialize};

use nalgebra::Vector3;

use crate::error::{NavError, require_finite, require_non_negative};
use crate::frames::{Platform, Vec3};
use crate::navigator::events::Event;

/// Interval over which the specific force is averaged, ns.
const FORCE_INTERVAL_NS: i64 = 1_000_000_000;
/// Least mean of |f|, m/s²: a fifth of gravity.
const LEAST_FORCE_MPS2: f64 = 2.0;
/// Greatest mean of |f|, m/s²: eight times gravity, less than gravity in m/s² that is taken for g (96).
const GREATEST_FORCE_MPS2: f64 = 80.0;
/// Greatest mean of |f| without gravity, m/s²: half of gravity, and a turn of 1 rad/s at 5 m/s.
const GREATEST_WEIGHTLESS_MPS2: f64 = 5.0;
/// Greatest difference of the mean of f from that of a vehicle at rest, over gravity: free fall is 1, an instrument with its
/// vertical axis level 1.4, one upside down 2.
const GREATEST_MISFIT: f64 = 1.2;
/// Most that one reading counts for, m/s²: a few wild ones say nothing of the units of the others.
const MOST_COUNTED_MPS2: f64 = 200.0;
/// The same of its direction: two g.
const MOST_DIRECTED_MPS2: f64 = 20.0;
/// Mean of |ω|, rad/s, above which it is taken for gravity where the specific force is too small: 290 degrees a second.
const FORCE_LIKE_RATE_RADPS: f64 = 5.0;
/// Inertial readings after which their rate is known, and their least mean interval, ns: 20 kHz.
const READINGS: (u32, i64) = (20, 50_000);
/// Pings after which their rate is known, and their least mean interval, ns: sound goes 75 cm and back in a millisecond.
const PINGS: (u32, i64) = (10, 1_000_000);

/// The first readings of a navigator or of a log; plain numbers, so that one that is refused leaves no trace.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FirstReadings {
    imu: Count,
    pings: Count,
    force_mps2: f64,
    force_p_mps2: Vector3<f64>,
    rate_radps: f64,
    is_force_known: bool,
}

/// Number of readings of a stream, in whatever order, and the times of the earliest and the latest.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Count {
    readings: u32,
    first_ns: i64,
    last_ns: i64,
}

impl Count {
    fn with(self, time_ns: i64) -> Self {
        Self {
            readings: self.readings + 1,
            first_ns: if self.readings == 0 {
                time_ns
            } else {
                self.first_ns.min(time_ns)
            },
            last_ns: if self.readings == 0 {
                time_ns
            } else {
                self.last_ns.max(time_ns)
            },
        }
    }

    /// From the earliest to the latest, ns.
    fn span_ns(&self) -> i64 {
        self.last_ns.saturating_sub(self.first_ns)
    }

    /// Checks the mean interval once `needed` readings are there.
    fn check(&self, field: &'static str, (needed, least_ns): (u32, i64)) -> Result<(), NavError> {
        let mean_ns = self.span_ns() as f64 / f64::from(needed - 1);
        if self.readings != needed || mean_ns >= least_ns as f64 {
            return Ok(());
        }
        Err(NavError::OutOfRange {
            field,
            value: mean_ns,
            expected: "more, since no instrument is that fast: times are in nanoseconds, not in micro- or milliseconds",
        })
    }
}

impl FirstReadings {
    /// Checks the numbers of readings that were read from bytes.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the number.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        require_non_negative("first specific forces", self.force_mps2)?;
        require_finite("first specific forces", 0, self.force_p_mps2.as_slice())?;
        require_non_negative("first angular rates", self.rate_radps)
    }

    /// Whether the units of the inertial readings are known: further ones are not looked at.
    #[must_use]
    pub fn has_units(&self) -> bool {
        self.is_force_known && self.imu.readings >= READINGS.0
    }

    /// The readings with one more, for a filter whose gravity is `gravity_mps2` (m/s²) and whose estimate has down along
    /// `down_p`, where there is one. Without gravity the specific force is the vehicle's own acceleration.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] for a mean that no instrument under water gives, with the likely mistake.
    pub fn with(&self, event: &Event, gravity_mps2: f64, down_p: Option<&Vec3<Platform>>) -> Result<Self, NavError> {
        match event {
            Event::Imu(sample) if !self.has_units() => {
                let force = &sample.force_p_mps2.0;
                let next = Self {
                    imu: self.imu.with(sample.time_ns),
                    force_mps2: self.force_mps2 + force.norm().min(MOST_COUNTED_MPS2),
                    force_p_mps2: self.force_p_mps2 + force.cap_magnitude(MOST_DIRECTED_MPS2),
                    rate_radps: self.rate_radps + sample.rate_p_radps.0.norm(),
                    ..*self
                };
                next.imu.check("mean interval of imu times, ns,", READINGS)?;
                if next.is_force_known || next.imu.span_ns() < FORCE_INTERVAL_NS {
                    return Ok(next);
                }
                next.check_force(gravity_mps2)?;
                down_p.map_or(Ok(()), |down| next.check_axes(gravity_mps2, &down.0))?;
                Ok(Self {
                    is_force_known: true,
                    ..next
                })
            }
            Event::Beams(ping) if self.pings.readings < PINGS.0 => {
                let next = Self {
                    pings: self.pings.with(ping.time_ns),
                    ..*self
                };
                next.pings.check("mean interval of dvl times, ns,", PINGS)?;
                Ok(next)
            }
            _ => Ok(*self),
        }
    }

    fn check_force(&self, gravity_mps2: f64) -> Result<(), NavError> {
        let count = f64::from(self.imu.readings);
        let (force, rate) = (self.force_mps2 / count, self.rate_radps / count);
        let expected = if gravity_mps2 == 0.0 {
            if force < GREATEST_WEIGHTLESS_MPS2 {
                return Ok(());
            }
            "less than 5 m/s²: environment.gravity_mps2 is 0, so the specific force is without gravity"
        } else if force > GREATEST_FORCE_MPS2 {
            "less than 80 m/s², near gravity: is it in mg or cm/s², or m/s² taken for g?"
        } else if force >= LEAST_FORCE_MPS2 {
            return Ok(());
        } else if rate > FORCE_LIKE_RATE_RADPS {
            "near gravity, 9.8 m/s²: are omega_p_radps and force_p_mps2 swapped?"
        } else {
            "near gravity, 9.8 m/s²: is it in g, without gravity, or a velocity increment?"
        };
        Err(NavError::OutOfRange {
            field: "mean |force_p_mps2| of the first second",
            value: force,
            expected,
        })
    }

    /// Checks that the mean specific force points up: its component along down is near −g, where there is gravity.
    fn check_axes(&self, gravity_mps2: f64, down_p: &Vector3<f64>) -> Result<(), NavError> {
        let mean = self.force_p_mps2 / f64::from(self.imu.readings);
        if gravity_mps2 == 0.0 || (mean + down_p * gravity_mps2).norm() <= GREATEST_MISFIT * gravity_mps2 {
            return Ok(());
        }
        let along_down = mean.dot(down_p);
        Err(NavError::OutOfRange {
            field: "mean of force_p_mps2 along the estimate's down in the first second",
            value: along_down,
            expected: if along_down > 0.5 * gravity_mps2 {
                "about -9.8 m/s²: axes are forward, starboard, down; is z up, as in ROS? Then turn y and z of forces and rates"
            } else {
                "about -9.8 m/s²: axes are forward, starboard, down; is the IMU mounted a quarter turn off, or the initial \
                 attitude?"
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dvl::geometry::{BeamMask, BeamSample, MAX_BEAMS};
    use crate::mechanisation::ImuSample;

    /// Feeds 200 inertial readings at an interval; the message of the first error.
    fn fed(interval_ns: i64, rate: f64, force: f64) -> Option<String> {
        let mut first = FirstReadings::default();
        (0..200).find_map(|k| {
            let sample = ImuSample {
                time_ns: k * interval_ns,
                rate_p_radps: Vec3::new(0.0, 0.0, rate),
                force_p_mps2: Vec3::new(0.0, 0.0, -force),
            };
            match first.with(&Event::Imu(sample), 9.8, None) {
                Ok(next) => {
                    first = next;
                    None
                }
                Err(error) => Some(error.to_string()),
            }
        })
    }

    #[test]
    fn mistakes_are_named_and_what_may_be_is_taken() {
        let of = |rate, force| fed(10_000_000, rate, force);
        assert!(of(0.0, 1.0).unwrap().contains("in g"));
        assert!(of(9.8, 0.01).unwrap().contains("swapped"));
        assert!(of(0.0, 980.665).unwrap().contains("mg or cm/s²"));
        assert!(fed(10, 0.0, 9.8).unwrap().contains("nanoseconds"));
        assert!(fed(10_000, 0.0, 9.8).unwrap().contains("nanoseconds"));
        assert!(of(0.0, 9.8 * 9.8).unwrap().contains("taken for g"));
        // A fifth of gravity, eight times gravity, a fast spin, and 10 kHz.
        for taken in [of(0.0, 2.01), of(0.0, 79.0), of(20.0, 9.8), fed(100_000, 0.0, 9.8)] {
            assert_eq!(taken, None);
        }
        // Less than a second says nothing of the force.
        assert_eq!(fed(4_000_000, 0.0, 0.0), None);
    }

    #[test]
    fn pings_in_milliseconds_are_named() {
        let ping = |time_ns| {
            Event::Beams(BeamSample {
                time_ns,
                velocity_mps: [0.0; MAX_BEAMS],
                sd_mps: [0.1; MAX_BEAMS],
                valid: BeamMask::default(),
            })
        };
        let fed = |interval_ns: i64| {
            let mut first = FirstReadings::default();
            (0..20).try_for_each(|k| first.with(&ping(k * interval_ns), 9.8, None).map(|next| first = next))
        };
        assert!(fed(100).unwrap_err().to_string().contains("nanoseconds"));
        assert!(fed(200_000).is_err());
        assert!(fed(10_000_000).is_ok());
    }

    /// One reading of 1e6 m/s² among fifty of gravity does not make them readings in another unit.
    #[test]
    fn a_wild_reading_does_not_change_the_unit() {
        let mut first = FirstReadings::default();
        for k in 0..=50 {
            let force = if k == 20 { 1e6 } else { 9.8 };
            let sample = ImuSample {
                time_ns: k * 20_000_000,
                rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
                force_p_mps2: Vec3::new(0.0, 0.0, -force),
            };
            first = first.with(&Event::Imu(sample), 9.8, None).unwrap();
        }
        assert!(first.has_units());
    }

    /// A refused reading is refused again: nothing was kept of it.
    #[test]
    fn a_refused_reading_leaves_no_trace() {
        let sample = |time_ns| {
            Event::Imu(ImuSample {
                time_ns,
                rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
                force_p_mps2: Vec3::new(0.0, 0.0, -1.0),
            })
        };
        let first = FirstReadings::default().with(&sample(0), 9.8, None).unwrap();
        let refused = first.with(&sample(1_000_000_000), 9.8, None);
        assert!(refused.is_err());
        assert_eq!(refused, first.with(&sample(1_000_000_000), 9.8, None));
    }

    /// A filter without gravity takes the vehicle's own acceleration, and refuses readings that hold gravity.
    #[test]
    fn without_gravity_the_force_is_small() {
        let of = |force: f64| -> Result<(), NavError> {
            let mut first = FirstReadings::default();
            (0..200_i64).try_for_each(|k| {
                let sample = ImuSample {
                    time_ns: k * 10_000_000,
                    rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
                    force_p_mps2: Vec3::new(0.0, 0.0, -force),
                };
                first.with(&Event::Imu(sample), 0.0, None).map(|next| first = next)
            })
        };
        assert_eq!(of(0.0), Ok(()));
        assert_eq!(of(4.99), Ok(()));
        assert!(of(5.01).is_err());
        assert!(of(9.8).unwrap_err().to_string().contains("without gravity"));
    }

    /// Upside down and a quarter turn off are named; free fall, a roll of 60° and a filter without gravity are taken.
    #[test]
    fn axes_are_those_of_the_estimate() {
        let of = |force: [f64; 3], roll: f64, gravity: f64| -> Result<(), NavError> {
            let down = Vec3::<Platform>::new(0.0, f64::sin(roll), f64::cos(roll));
            let mut first = FirstReadings::default();
            (0..200_i64).try_for_each(|k| {
                let sample = ImuSample {
                    time_ns: k * 10_000_000,
                    rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
                    force_p_mps2: Vec3::from_array(force),
                };
                first
                    .with(&Event::Imu(sample), gravity, Some(&down))
                    .map(|next| first = next)
            })
        };
        let words = |force, roll: f64| of(force, roll.to_radians(), 9.8).unwrap_err().to_string();
        assert!(words([0.0, 0.0, 9.8], 0.0).contains("is z up"));
        assert!(words([0.0, 9.8, 0.0], 0.0).contains("quarter turn"));
        assert!(words([0.0, 0.0, -9.8], 180.0).contains("is z up"));
        // 1.19 and 1.21 of gravity off.
        assert_eq!(of([0.0, 1.19 * 9.8, -9.8], 0.0, 9.8), Ok(()));
        assert!(of([0.0, 1.21 * 9.8, -9.8], 0.0, 9.8).is_err());
        assert_eq!(of([0.0, 0.0, -9.8], 60.0_f64.to_radians(), 9.8), Ok(()));
        assert_eq!(of([0.0, 0.0, 2.0], 0.0, 0.0), Ok(()));
    }
}
