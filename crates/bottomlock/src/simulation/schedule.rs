//! When sensors measure and which beams return.

use crate::dvl::geometry::BeamMask;
use crate::error::NavError;

/// When each sensor measures, which beams return, and what the surroundings add to a reading.
#[derive(Debug, Clone, Copy, Default)]
pub struct Schedule<'a> {
    /// DVL epochs, ns, rising.
    pub dvl_time_ns: &'a [i64],
    /// Valid beams of each DVL epoch.
    pub beam_valid: &'a [BeamMask],
    /// Depth epochs, ns, rising.
    pub depth_time_ns: &'a [i64],
    /// Reading less true depth without noise, m, of each depth epoch; none for an ideal sea.
    pub depth_offset_m: &'a [f64],
    /// Magnetometer epochs, ns, rising.
    pub magnetometer_time_ns: &'a [i64],
    /// Reading less true yaw without noise, rad, of each magnetometer epoch; none for an ideal compass.
    pub yaw_offset_rad: &'a [f64],
    /// GPS epochs, ns, rising.
    pub gps_time_ns: &'a [i64],
}

impl Schedule<'_> {
    /// Checks that what belongs to the epochs is as long as they are, and finite.
    pub(crate) fn validate(&self) -> Result<(), NavError> {
        let same = |field, got: usize, wanted: usize, of: &str| {
            if got == wanted {
                Ok(())
            } else {
                Err(NavError::WrongCount {
                    field,
                    got,
                    expected: format!("{wanted} as for {of}"),
                })
            }
        };
        same(
            "beam_valid",
            self.beam_valid.len(),
            self.dvl_time_ns.len(),
            "dvl_time_ns",
        )?;
        let offsets = [
            (
                "depth_offset_m",
                self.depth_offset_m,
                self.depth_time_ns,
                "depth_time_ns",
            ),
            (
                "yaw_offset_rad",
                self.yaw_offset_rad,
                self.magnetometer_time_ns,
                "magnetometer_time_ns",
            ),
        ];
        for (field, offset, times, of) in offsets {
            if !offset.is_empty() {
                same(field, offset.len(), times.len(), of)?;
            }
            if let Some(k) = offset.iter().position(|value| !value.is_finite()) {
                return Err(NavError::NotFinite {
                    field,
                    time_ns: times[k],
                });
            }
        }
        Ok(())
    }
}
