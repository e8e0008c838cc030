//! The live navigator: made, read, saved. What is pushed into it: `push.rs`.

use std::ffi::c_char;
use std::sync::{Mutex, MutexGuard};

use bottomlock::aiding::registry::SensorModels;
use bottomlock::layout::DIM;
use bottomlock::mechanisation::IMU_FAULTS;
use bottomlock::navigator::events::STREAMS;
use bottomlock::navigator::{LiveNavigator, Method, Notice, Snapshot};
use bottomlock::state::Covariance;

use crate::calls::{Failure, Outcome, Status, free, made, status};
use crate::geometry::Geometry;
use crate::model::Model;
use crate::names::hint;
use crate::options::Options;
use crate::pointers::{at, fill, numbers, put, text, values};
use crate::state::State;

/// How late a reading may be where `horizon_ns` is negative, ns: 2 s.
pub const DEFAULT_HORIZON_NS: i64 = 2_000_000_000;

/// Number of error states: position (tangent), misalignment (tangent), velocity (platform), accelerometer bias, gyro bias, bias
/// of four beams, scale factor of the DVL.
pub const STATES: usize = 20;
const _: () = assert!(STATES == DIM);

/// An aided inertial navigator for live use. It may be used from several threads: a lock inside takes their calls one after
/// another, each whole. One thread should push, since reports are those of the last push.
#[derive(Debug)]
pub struct Navigator {
    held: Mutex<Held>,
    pub(crate) sensors: SensorModels,
    pub(crate) beams: usize,
}

/// What the lock guards.
#[derive(Debug)]
pub(crate) struct Held {
    pub(crate) live: LiveNavigator,
    /// What the last push told.
    pub(crate) notices: Vec<Notice>,
}

impl Navigator {
    fn of(snapshot: Snapshot) -> Self {
        Self {
            beams: snapshot.live.navigators().selected().geometry().beams(),
            sensors: snapshot.sensors,
            held: Mutex::new(Held {
                live: snapshot.live,
                notices: Vec::new(),
            }),
        }
    }

    pub(crate) fn locked(&self) -> Outcome<MutexGuard<'_, Held>> {
        let broken = "this navigator has met an internal error before: start a new one, or load a saved one";
        self.held.lock().map_err(|_| Failure::new(Status::Internal, broken))
    }

    fn snapshot(&self) -> Outcome<Snapshot> {
        Ok(Snapshot {
            live: self.locked()?.live.clone(),
            sensors: self.sensors,
        })
    }
}

/// The aiding method of a name; the error names the nearest one.
fn method(name: &str) -> Outcome<Method> {
    Method::named(name).map_err(|error| {
        let known: Vec<_> = bottomlock::navigator::METHODS
            .iter()
            .map(|method| method.name)
            .collect();
        Failure::new(Status::UnknownName, format!("{error} ({})", hint(name, &known)))
    })
}

/// A navigator at an initial state.
///
/// `options` NULL are the default ones. `method` is an aiding method: ins, lc, tc, vb, nsv, plcf, vhv, elc, vb_exact, info,
/// weak_sway, sway_current or consistent; NULL is "tc", which assumes nothing of the vehicle. `horizon_ns` is how late a reading
/// may be behind the last good inertial reading, 0 (none) to 10 s; negative for the default of 2 s. The objects may be freed
/// afterwards. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_new(
    geometry: *const Geometry,
    model: *const Model,
    options: *const Options,
    method: *const c_char,
    initial: *const State,
    horizon_ns: i64,
) -> *mut Navigator {
    made(|| {
        // SAFETY: as the header asks.
        let (geometry, model, options, initial) = unsafe {
            (
                at("geometry", geometry)?,
                at("model", model)?.0,
                options.as_ref().map(|options| options.0).unwrap_or_default(),
                at("initial", initial)?.to_kernel()?,
            )
        };
        let name = if method.is_null() {
            "tc"
        } else {
            // SAFETY: as the header asks.
            unsafe { text("method", method) }?
        };
        let aiding = self::method(name)?.aiding;
        let horizon_ns = if horizon_ns < 0 { DEFAULT_HORIZON_NS } else { horizon_ns };
        let live = LiveNavigator::new(initial, &geometry.inner, aiding, &model, &options, horizon_ns)?;
        Ok(Navigator::of(Snapshot {
            live,
            sensors: model.sensors,
        }))
    })
}

/// A copy that goes its own way. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_copy(navigator: *const Navigator) -> *mut Navigator {
    // SAFETY: as the header asks.
    made(|| unsafe { at("navigator", navigator) }?.snapshot().map(Navigator::of))
}

/// Frees a navigator; NULL is none. No other call with it may be under way.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_free(navigator: *mut Navigator) {
    // SAFETY: as the header asks.
    unsafe { free(navigator) }
}

/// Replaces the covariance of every filter: 20 by 20, 400 numbers. What is older than the estimate is then too late.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_set_covariance(navigator: *mut Navigator, covariance: *const f64) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let (navigator, covariance) = unsafe {
            (
                at("navigator", navigator)?,
                numbers::<{ STATES * STATES }>("covariance", covariance)?,
            )
        };
        navigator
            .locked()?
            .live
            .set_covariance(&Covariance::from_row_slice(&covariance))?;
        Ok(())
    })
}

/// The estimate at the time of the last inertial reading.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_state(navigator: *const Navigator, state: *mut State) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let now = unsafe { at("navigator", navigator) }?
            .locked()?
            .live
            .navigators()
            .state();
        // SAFETY: as the header asks.
        unsafe { put("state", state, State::from(&now)) }
    })
}

/// Its covariance, 20 by 20, 400 numbers; the call changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_covariance(navigator: *const Navigator, covariance: *mut f64) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let now = unsafe { at("navigator", navigator) }?
            .locked()?
            .live
            .navigators()
            .covariance();
        // SAFETY: as the header asks.
        unsafe { fill("covariance", covariance, STATES * STATES, now.as_slice()) }
    })
}

/// Number of readings of each stream that arrived too late and were not used, in the order of `bl_stream_name`; `count` is how
/// many streams there are.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_late_events(
    navigator: *const Navigator,
    counts: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let late: [u64; STREAMS] = *unsafe { at("navigator", navigator) }?.locked()?.live.late_events();
        // SAFETY: as the header asks.
        unsafe {
            put("count", count, late.len())?;
            fill("counts", counts, capacity, &late)
        }
    })
}

/// Number of inertial readings that were rejected by reason, and of gaps that were bridged with inflation, in the order of
/// `bl_imu_fault_name`; `count` is how many there are.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_imu_faults(
    navigator: *const Navigator,
    counts: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let faults: [u64; IMU_FAULTS.len()] = *unsafe { at("navigator", navigator) }?.locked()?.live.imu_faults();
        // SAFETY: as the header asks.
        unsafe {
            put("count", count, faults.len())?;
            fill("counts", counts, capacity, &faults)
        }
    })
}

/// Drops the measurements that wait for the next inertial reading, where they make its push fail; `dropped` may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_discard_waiting(navigator: *mut Navigator, dropped: *mut usize) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let number = unsafe { at("navigator", navigator) }?.locked()?.live.discard_waiting();
        if dropped.is_null() {
            return Ok(());
        }
        // SAFETY: as the header asks.
        unsafe { put("dropped", dropped, number) }
    })
}

/// The whole navigator as bytes: `size` is their number; `BL_STATUS_BUFFER_TOO_SMALL` where `bytes` holds less, as with a
/// capacity of 0. Between two calls of one navigator nothing may be pushed, else the size differs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_save(
    navigator: *const Navigator,
    bytes: *mut u8,
    capacity: usize,
    size: *mut usize,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        let saved = unsafe { at("navigator", navigator) }?.snapshot()?.to_bytes()?;
        // SAFETY: as the header asks.
        unsafe {
            put("size", size, saved.len())?;
            fill("bytes", bytes, capacity, &saved)
        }
    })
}

/// The navigator of saved bytes, also of those that Python has saved; it goes on as the saved one does, bit for bit. NULL for an
/// error: bytes that are damaged, cut short or saved by another version.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_load(bytes: *const u8, size: usize) -> *mut Navigator {
    made(|| {
        // SAFETY: as the header asks.
        let saved = unsafe { values("bytes", bytes, size) }?;
        Ok(Navigator::of(Snapshot::from_bytes(saved)?))
    })
}
