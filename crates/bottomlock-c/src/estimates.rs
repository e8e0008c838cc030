//! What a navigator estimates beside its state: motion through the water, current by depth, slow errors, mounting and clock.

use bottomlock::aiding::calibration::CLOCK;
use bottomlock::aiding::{effort, thrust, water};
use bottomlock::navigator::NavigatorSet;

use crate::calls::{Failure, Outcome, Status, status};
use crate::navigator::Navigator;
use crate::pointers::{at, fill, put, put_all};

/// Estimate of the motion through the water, with options of "water_track" or the method sway_current.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Water {
    /// Current north and east at the vehicle's depth, m/s.
    pub current_t_mps: [f64; 2],
    /// Its covariance, in which the heading's error is, (m/s)^2.
    pub current_covariance: [[f64; 2]; 2],
    /// Sway gain, m.
    pub sway_gain_m: f64,
    /// Heave by trim, m/s.
    pub trim_heave_mps: f64,
    /// Slip along sway and heave, m/s.
    pub sway_slip_mps: f64,
    /// The same along heave, m/s.
    pub heave_slip_mps: f64,
    /// Estimated standard deviation of the slip along sway, m/s.
    pub sway_slip_sd_mps: f64,
    /// The same along heave, m/s.
    pub heave_slip_sd_mps: f64,
    /// Estimated time constant of the slip along sway, s.
    pub sway_slip_time_s: f64,
    /// The same along heave, s.
    pub heave_slip_time_s: f64,
    /// Number of restarts of the assumptions.
    pub restarts: u64,
    /// Number of alarms that widened the slip.
    pub alarms: u64,
}

/// The current at one depth, with options of "current_layers.sd_mps" and "water_track".
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Layer {
    /// Depth, m.
    pub depth_m: f64,
    /// Current north and east, m/s.
    pub current_t_mps: [f64; 2],
    /// Its covariance, (m/s)^2.
    pub current_covariance: [[f64; 2]; 2],
    /// Time since the layer was measured last, s; infinite for one that was not.
    pub age_s: f64,
}

/// Estimate of the mounting and clock of the DVL, with options of "calibration".
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Calibration {
    /// Rotation from the stated mounting about forward, right and down, rad.
    pub mounting_rad: [f64; 3],
    /// Time to add to the stamps, s.
    pub clock_s: f64,
    /// Covariance of both, mounting first.
    pub covariance: [[f64; 4]; 4],
}

/// Writes what `of` takes of a navigator; `what` is missing where it takes nothing, and `remedy` says what gives it.
unsafe fn estimate<T>(
    navigator: *const Navigator,
    [what, remedy]: [&str; 2],
    of: impl FnOnce(&NavigatorSet) -> Option<T>,
    write: impl FnOnce(T) -> Outcome<()>,
) -> Status {
    status(|| {
        let held = at("navigator", navigator)?.locked()?;
        let missing = || Failure::new(Status::NotAvailable, format!("{what} is not estimated: {remedy}"));
        write(of(held.live.navigators()).ok_or_else(missing)?)
    })
}

/// The motion through the water after the last update; `BL_STATUS_NOT_AVAILABLE` where it is not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_water(navigator: *const Navigator, water: *mut Water) -> Status {
    const MISSING: [&str; 2] = [
        "the motion through the water",
        "set the option 'water_track', or take the method 'sway_current'",
    ];
    let of = |navigators: &NavigatorSet| {
        let (block, (current, covariance)) = navigators.water().zip(navigators.selected().filter().current())?;
        let (estimate, slip_sd_mps) = (block.estimate(), block.variance().map(f64::sqrt));
        let [sway_slip_time_s, heave_slip_time_s] = block.slip_time_s();
        Some(Water {
            current_t_mps: current.into(),
            current_covariance: covariance.into(),
            sway_gain_m: estimate[water::GAIN],
            trim_heave_mps: estimate[water::TRIM],
            sway_slip_mps: estimate[water::SWAY],
            heave_slip_mps: estimate[water::HEAVE],
            sway_slip_sd_mps: slip_sd_mps[water::SWAY],
            heave_slip_sd_mps: slip_sd_mps[water::HEAVE],
            sway_slip_time_s,
            heave_slip_time_s,
            restarts: block.restarts(),
            alarms: block.alarms(),
        })
    };
    estimate(navigator, MISSING, of, |made| put("water", water, made))
}

/// What is known of the propeller, with options of "thrust".
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Thrust {
    /// Advance per revolution, m.
    pub advance_m: f64,
    /// Slip: speed that the revolutions do not say, m/s.
    pub slip_mps: f64,
    /// Covariance of both.
    pub covariance: [[f64; 2]; 2],
}

/// Advance and slip of the propeller after the last update; `BL_STATUS_NOT_AVAILABLE` where they are not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_thrust(navigator: *const Navigator, propeller: *mut Thrust) -> Status {
    let of = |navigators: &NavigatorSet| {
        let (estimate, covariance) = navigators.selected().filter().thrust()?;
        Some(Thrust {
            advance_m: estimate[thrust::ADVANCE],
            slip_mps: estimate[thrust::SLIP],
            covariance: covariance.into(),
        })
    };
    let missing = ["the advance of the propeller", "set the option 'thrust'"];
    estimate(navigator, missing, of, |made| put("propeller", propeller, made))
}

/// What drag and mass are wrong by, with options of "thrust" and a model with "effort"; along surge, sway and heave each.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Effort {
    /// Speed over that by the drag law; 0 for an axis without drag.
    pub speed_scale: [f64; 3],
    /// Slip: speed that the forces do not say, m/s.
    pub slip_mps: [f64; 3],
    /// Relative error of mass and added mass.
    pub inertia_error: [f64; 3],
    /// Covariance of all, in this order.
    pub covariance: [[f64; 9]; 9],
}

/// What drag and mass are wrong by after the last update; `BL_STATUS_NOT_AVAILABLE` where it is not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_effort(navigator: *const Navigator, hull: *mut Effort) -> Status {
    let of = |navigators: &NavigatorSet| {
        let (estimate, covariance) = navigators.selected().filter().effort()?;
        let three = |first: usize| std::array::from_fn(|axis| estimate[first + axis]);
        Some(Effort {
            speed_scale: three(effort::SPEED_SCALE),
            slip_mps: three(effort::SLIP),
            inertia_error: three(effort::INERTIA),
            covariance: covariance.into(),
        })
    };
    let missing = [
        "the error of the drag",
        "set the option 'thrust' and a drag of the model",
    ];
    estimate(navigator, missing, of, |made| put("hull", hull, made))
}

/// The current by depth; `count` is the number of layers, 0 where none is estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_layers(
    navigator: *const Navigator,
    layers: *mut Layer,
    capacity: usize,
    count: *mut usize,
) -> Status {
    status(|| {
        let found = at("navigator", navigator)?
            .locked()?
            .live
            .navigators()
            .selected()
            .filter()
            .layers();
        let made: Vec<_> = found
            .into_iter()
            .map(|(layer, (current, covariance))| Layer {
                depth_m: layer.depth_m,
                current_t_mps: current.into(),
                current_covariance: covariance.into(),
                age_s: layer.age_s,
            })
            .collect();
        put_all(("layers", layers, capacity), ("count", count), &made)
    })
}

/// Writes errors and their standard deviations.
unsafe fn put_errors<const N: usize>(errors: [(f64, f64); N], error_rad: *mut f64, sd_rad: *mut f64) -> Outcome<()> {
    at("sd_rad", sd_rad)?;
    fill("error_rad", error_rad, N, &errors.map(|(error, _)| error))?;
    fill("sd_rad", sd_rad, N, &errors.map(|(_, sd)| sd))
}

/// Estimated error of the attitude reference in roll, pitch and yaw with its standard deviation, 3 numbers each, rad;
/// `BL_STATUS_NOT_AVAILABLE` where the model's magnetometer has no slow errors.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_attitude_error(
    navigator: *const Navigator,
    error_rad: *mut f64,
    sd_rad: *mut f64,
) -> Status {
    const MISSING: [&str; 2] = [
        "the error of the attitude reference",
        "set 'magnetometer.yaw_offset_sd_rad' or another of its slow errors in the model",
    ];
    let of = |navigators: &NavigatorSet| navigators.selected().filter().attitude_error_rad();
    estimate(navigator, MISSING, of, |errors| put_errors(errors, error_rad, sd_rad))
}

/// Estimated error of the heading sensor with its standard deviation, rad; `BL_STATUS_NOT_AVAILABLE` where the model's heading has no
/// slow errors.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_heading_error(
    navigator: *const Navigator,
    error_rad: *mut f64,
    sd_rad: *mut f64,
) -> Status {
    const MISSING: [&str; 2] = [
        "the error of the heading sensor",
        "set 'heading.offset_sd_rad' or 'heading.walk_sd_rad' in the model",
    ];
    let of = |navigators: &NavigatorSet| navigators.selected().filter().heading_error_rad();
    estimate(navigator, MISSING, of, |error| put_errors([error], error_rad, sd_rad))
}

/// The mounting and clock of the DVL after the last update; `BL_STATUS_NOT_AVAILABLE` where they are not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_calibration(
    navigator: *const Navigator,
    calibration: *mut Calibration,
) -> Status {
    const MISSING: [&str; 2] = [
        "the calibration of the DVL",
        "set 'calibration.mounting_sd_rad' or 'calibration.clock_sd_s' among the options",
    ];
    let of = |navigators: &NavigatorSet| {
        let (estimate, covariance) = navigators.selected().filter().calibration()?;
        let numbers = estimate.numbers();
        Some(Calibration {
            mounting_rad: [numbers[0], numbers[1], numbers[2]],
            clock_s: numbers[CLOCK],
            covariance: covariance.into(),
        })
    };
    estimate(navigator, MISSING, of, |made| put("calibration", calibration, made))
}
