//! What a navigator estimates beside its state: motion through the water, current by depth, slow errors, mounting and clock.

use bottomlock::navigator::Navigator as Filters;
use bottomlock::navigator::estimates::{CalibrationEstimate, LayerEstimate, ThrustEstimate, WaterEstimate};

use crate::calls::{Failure, Outcome, Status, call};
use crate::navigator::Navigator;
use crate::pointers::{at, put, put_all};

/// What `of` takes of a navigator; `what` is missing where it takes nothing, and `remedy` says what gives it.
unsafe fn estimate<T>(
    navigator: *const Navigator,
    [what, remedy]: [&str; 2],
    of: impl FnOnce(&Filters) -> Option<T>,
) -> Outcome<T> {
    let missing = || Failure::new(Status::NotAvailable, format!("{what} is not estimated: {remedy}"));
    // SAFETY: as the header asks.
    let held = unsafe { at("navigator", navigator)? }.locked()?;
    of(held.live.navigator()).ok_or_else(missing)
}

/// The motion through the water after the last update; `BL_STATUS_NOT_AVAILABLE` where it is not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_water(navigator: *const Navigator, water: *mut WaterEstimate) -> Status {
    const MISSING: [&str; 2] = [
        "the motion through the water",
        "set the option 'water_track', or take the method 'sway_current'",
    ];
    call!(status, {
        let estimate = estimate(navigator, MISSING, Filters::water_estimate)?;
        put("water", water, estimate)
    })
}

/// Scale and slip of the speed by the vehicle's drives after the last update; `BL_STATUS_NOT_AVAILABLE` where they are not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_thrust(navigator: *const Navigator, drives: *mut ThrustEstimate) -> Status {
    const MISSING: [&str; 2] = ["the scale of the speed by the drives", "set the option 'thrust'"];
    call!(status, {
        let estimate = estimate(navigator, MISSING, Filters::thrust_estimate)?;
        put("drives", drives, estimate)
    })
}

/// The current by depth; `count` is the number of layers, 0 where none is estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_layers(
    navigator: *const Navigator,
    layers: *mut LayerEstimate,
    capacity: usize,
    count: *mut usize,
) -> Status {
    call!(status, {
        let held = at("navigator", navigator)?.locked()?;
        let found = held.live.navigator().layer_estimates();
        put_all(("layers", layers, capacity), ("count", count), &found)
    })
}

/// Writes errors and their standard deviations.
unsafe fn put_errors<const N: usize>(errors: [(f64, f64); N], error_rad: *mut f64, sd_rad: *mut f64) -> Outcome<()> {
    // SAFETY: as the header asks.
    unsafe {
        at("sd_rad", sd_rad)?;
        put("error_rad", error_rad.cast(), errors.map(|(error, _)| error))?;
        put("sd_rad", sd_rad.cast(), errors.map(|(_, sd)| sd))
    }
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
    let of = |filters: &Filters| filters.filter().attitude_error_rad();
    call!(status, put_errors(estimate(navigator, MISSING, of)?, error_rad, sd_rad))
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
    let of = |filters: &Filters| Some([filters.filter().heading_error_rad()?]);
    call!(status, put_errors(estimate(navigator, MISSING, of)?, error_rad, sd_rad))
}

/// The mounting and clock of the DVL after the last update; `BL_STATUS_NOT_AVAILABLE` where they are not estimated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_calibration(
    navigator: *const Navigator,
    calibration: *mut CalibrationEstimate,
) -> Status {
    const MISSING: [&str; 2] = [
        "the calibration of the DVL",
        "set 'calibration.mounting_sd_rad' or 'calibration.clock_sd_s' among the options",
    ];
    call!(status, {
        let estimate = estimate(navigator, MISSING, Filters::calibration_estimate)?;
        put("calibration", calibration, estimate)
    })
}
