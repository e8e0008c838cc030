//! The live navigator: made, read, saved. What is pushed into it: `push.rs`.

use std::ffi::c_char;
use std::sync::{Mutex, MutexGuard};

use bottomlock::aiding::registry::SensorModels;
use bottomlock::layout::DIM;
use bottomlock::navigator::{LiveNavigator, Method, Notice, RECOMMENDED_METHOD, Snapshot};
use bottomlock::plain_state::PlainState;
use bottomlock::settings::read;
use bottomlock::state::{Covariance, NavState};
use serde::Deserialize;
use serde_json::value::RawValue;

use crate::calls::{Failure, Outcome, Status, call, free};
use crate::geometry::Geometry;
use crate::model::Model;
use crate::options::Options;
use crate::pointers::{at, numbers, put, put_all, text, values};
use crate::settings::{Settings, parsed};

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
    fn new(
        geometry: &Geometry,
        model: &Model,
        options: &Options,
        method: &str,
        start: NavState,
        horizon_ns: i64,
    ) -> Outcome<Self> {
        let aiding = Method::named(method)?.aiding;
        let live = LiveNavigator::new(start, &geometry.0, aiding, &model.0, &options.0, horizon_ns)?;
        let sensors = model.0.sensors;
        Ok(Self::of(Snapshot { live, sensors }))
    }

    fn of(snapshot: Snapshot) -> Self {
        Self {
            beams: snapshot.live.navigator().geometry().beams(),
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

/// What a navigator is made from in one call; the parts are texts of JSON.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    geometry: Box<RawValue>,
    model: Box<RawValue>,
    options: Option<Box<RawValue>>,
    start: Option<Box<RawValue>>,
    method: Option<String>,
    horizon_ns: Option<i64>,
}

impl Given {
    fn navigator(&self) -> Outcome<Navigator> {
        let geometry = Geometry::from_json(self.geometry.get())?;
        let model = Model::given(self.model.get())?;
        let options = Options::from_json(self.options.as_deref().map_or("{}", RawValue::get))?;
        let start = PlainState::from_json(self.start.as_deref().map_or("{}", RawValue::get))?;
        let method = self.method.as_deref().unwrap_or(RECOMMENDED_METHOD);
        let horizon_ns = self.horizon_ns.unwrap_or(DEFAULT_HORIZON_NS);
        Navigator::new(&geometry, &model, &options, method, start.state("start")?, horizon_ns)
    }
}

/// A navigator from one object of JSON: "geometry" as `bl_geometry_from_json` and "model" as `bl_model_from_json` take it; and, where they
/// differ from the defaults, "options" as of `bl_options_from_json`, "start" with the fields of `bl_state`, at rest at time 0
/// otherwise, "method" and "horizon_ns" as of `bl_navigator_new`. NULL for an error; `bl_last_error_key` has its key.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_from_json(json: *const c_char) -> Option<Box<Navigator>> {
    call!(made, {
        let json = text("json", json)?;
        if !parsed(json)?.is_object() {
            return Err(Failure::invalid("the navigator is no object of JSON"));
        }
        let given: Given = read("navigator", &mut serde_json::Deserializer::from_str(json))?;
        given.navigator()
    })
}

/// A navigator at an initial state.
///
/// `options` NULL are the default ones. `method` is an aiding method: ins, lc, tc, vb, nsv, plcf, vhv, elc, info, weak_sway or
/// sway_current; NULL is "sway_current", for a slender vehicle unless the options say otherwise. `horizon_ns` is how late a reading
/// may be behind the last good inertial reading, 0 (none) to 10 s; negative for the default of 2 s. The objects may be freed
/// afterwards. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_new(
    geometry: *const Geometry,
    model: *const Model,
    options: *const Options,
    method: *const c_char,
    initial: *const PlainState,
    horizon_ns: i64,
) -> Option<Box<Navigator>> {
    call!(made, {
        let (geometry, model, options, initial) = (
            at("geometry", geometry)?,
            at("model", model)?,
            options.as_ref().cloned().unwrap_or_default(),
            at("initial", initial)?.state("initial")?,
        );
        let name = if method.is_null() {
            RECOMMENDED_METHOD
        } else {
            text("method", method)?
        };
        let horizon_ns = if horizon_ns < 0 { DEFAULT_HORIZON_NS } else { horizon_ns };
        Navigator::new(geometry, model, &options, name, initial, horizon_ns)
    })
}

/// A copy that goes its own way. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_copy(navigator: *const Navigator) -> Option<Box<Navigator>> {
    call!(made, at("navigator", navigator)?.snapshot().map(Navigator::of))
}

/// Frees a navigator; NULL is none. No other call with it may be under way.
#[unsafe(no_mangle)]
pub extern "C" fn bl_navigator_free(navigator: Option<Box<Navigator>>) {
    free(navigator);
}

/// Replaces the covariance of every filter: 20 by 20, 400 numbers. What is older than the estimate is then too late.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_set_covariance(navigator: *mut Navigator, covariance: *const f64) -> Status {
    call!(status, {
        let navigator = at("navigator", navigator)?;
        let given = Covariance::from_row_slice(&numbers::<{ STATES * STATES }>("covariance", covariance)?);
        Ok(navigator.locked()?.live.set_covariance(&given)?)
    })
}

/// The estimate at the time of the last inertial reading.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_state(navigator: *const Navigator, state: *mut PlainState) -> Status {
    call!(status, {
        let now = at("navigator", navigator)?.locked()?.live.navigator().state();
        put("state", state, PlainState::from(&now))
    })
}

/// Its covariance, 20 by 20, 400 numbers; the call changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_covariance(navigator: *const Navigator, covariance: *mut f64) -> Status {
    call!(status, {
        let now = at("navigator", navigator)?.locked()?.live.navigator().covariance();
        put("covariance", covariance.cast(), now.data.0)
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
    call!(status, {
        let held = at("navigator", navigator)?.locked()?;
        put_all(("counts", counts, capacity), ("count", count), held.live.late_events())
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
    call!(status, {
        let held = at("navigator", navigator)?.locked()?;
        put_all(("counts", counts, capacity), ("count", count), held.live.imu_faults())
    })
}

/// Drops the measurements that wait for the next inertial reading, where they make its push fail; `dropped` may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_discard_waiting(navigator: *mut Navigator, dropped: *mut usize) -> Status {
    call!(status, {
        let number = at("navigator", navigator)?.locked()?.live.discard_waiting();
        if dropped.is_null() {
            return Ok(());
        }
        put("dropped", dropped, number)
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
    call!(status, {
        let saved = at("navigator", navigator)?.snapshot()?.to_bytes()?;
        put_all(("bytes", bytes, capacity), ("size", size), &saved)
    })
}

/// The navigator of saved bytes, also of those that Python has saved; it goes on as the saved one does, bit for bit. NULL for an
/// error: bytes that are damaged, cut short or saved by another version.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_navigator_load(bytes: *const u8, size: usize) -> Option<Box<Navigator>> {
    call!(made, {
        let saved = values("bytes", bytes, size)?;
        Ok(Navigator::of(Snapshot::from_bytes(saved)?))
    })
}
