//! Options of the filter, by key.

use std::ffi::c_char;
use std::ptr;

use bottomlock::NavError;
use bottomlock::aiding::InformationPort;
use bottomlock::aiding::outliers::Tail;
use bottomlock::aiding::registry::SensorKind;
use bottomlock::aiding::thrust::ThrustUse;
use bottomlock::filter::gate::{Gate, GateTable};
use bottomlock::filter::options::Options as Core;
use bottomlock::frames::Vec3;
use bottomlock::mechanisation::{LongGap, Sampling};

use crate::calls::{Status, free, made, status};
use crate::names::c_name;
use crate::pointers::{at, at_mut, fill, put, text};
use crate::settings::{Choice, Key, Keyed, Slot, key, keys};

/// Options of the filter, SI. Those of which a choice has several parts stand beside the kernel's.
#[derive(Debug, Clone)]
pub struct Options {
    inner: Core,
    gate: Choice,
    gate_probability: f64,
    sampling: Choice,
    information_port: Choice,
    long_gap: Choice,
    thrust: Choice,
    tail: Choice,
    student_t_degrees: f64,
    depth_lever_p_m: [f64; 3],
    gps_lever_p_m: [f64; 3],
    acoustic_position_lever_p_m: [f64; 3],
    effort_lever_p_m: [f64; 3],
}

impl Default for Options {
    fn default() -> Self {
        let inner = Core::default();
        let lever = |kind| inner.levers.of(kind).to_array();
        let gate_of = match inner.gate {
            Gate::Joint { .. } => "joint",
            Gate::PerRow => "per_row",
            Gate::Off => "off",
        };
        let thrust = ThrustUse::NAMES.into_iter().find(|(of, _)| *of == inner.thrust);
        let tail_of = match inner.robust.tail {
            Tail::Gaussian => "gaussian",
            Tail::StudentT { .. } => "student_t",
        };
        Self {
            gate: Choice {
                chosen: gate_of,
                all: &["joint", "per_row", "off"],
            },
            gate_probability: match inner.gate {
                Gate::Joint { probability } => probability,
                _ => 0.9973,
            },
            sampling: Choice {
                chosen: match inner.sampling {
                    Sampling::Instantaneous => "instantaneous",
                    Sampling::Averaged => "averaged",
                },
                all: &["instantaneous", "averaged"],
            },
            information_port: Choice {
                chosen: match inner.information_port {
                    InformationPort::Axes => "axes",
                    InformationPort::Full => "full",
                },
                all: &["axes", "full"],
            },
            long_gap: Choice {
                chosen: match inner.imu_limits.long_gap {
                    LongGap::Refuse => "refuse",
                    LongGap::Inflate => "inflate",
                },
                all: &["refuse", "inflate"],
            },
            thrust: Choice {
                chosen: thrust.map_or(THRUST[0], |(_, name)| name),
                all: &THRUST,
            },
            tail: Choice {
                chosen: tail_of,
                all: &["gaussian", "student_t"],
            },
            student_t_degrees: Tail::STUDENT_T_DEGREES,
            depth_lever_p_m: lever(SensorKind::Depth),
            gps_lever_p_m: lever(SensorKind::Gps),
            acoustic_position_lever_p_m: lever(SensorKind::AcousticPosition),
            effort_lever_p_m: lever(SensorKind::Effort),
            inner,
        }
    }
}

const THRUST: [&str; 3] = [ThrustUse::NAMES[0].1, ThrustUse::NAMES[1].1, ThrustUse::NAMES[2].1];

impl Options {
    fn joint(&self) -> Gate {
        Gate::Joint {
            probability: self.gate_probability,
        }
    }

    fn student_t(&self) -> Tail {
        Tail::StudentT {
            degrees: self.student_t_degrees,
        }
    }

    /// The kernel's options.
    pub(crate) fn made(&self) -> Core {
        let mut made = self.inner;
        made.gate = match self.gate.chosen {
            "joint" => self.joint(),
            "per_row" => Gate::PerRow,
            _ => Gate::Off,
        };
        made.sampling = match self.sampling.chosen {
            "instantaneous" => Sampling::Instantaneous,
            _ => Sampling::Averaged,
        };
        made.information_port = match self.information_port.chosen {
            "axes" => InformationPort::Axes,
            _ => InformationPort::Full,
        };
        made.imu_limits.long_gap = match self.long_gap.chosen {
            "refuse" => LongGap::Refuse,
            _ => LongGap::Inflate,
        };
        let chosen = ThrustUse::NAMES
            .into_iter()
            .find(|(_, name)| *name == self.thrust.chosen);
        made.thrust = chosen.map_or(ThrustUse::Off, |(of, _)| of);
        made.robust.tail = match self.tail.chosen {
            "gaussian" => Tail::Gaussian,
            _ => self.student_t(),
        };
        made.levers = made
            .levers
            .with(SensorKind::Depth, Vec3::from_array(self.depth_lever_p_m))
            .with(SensorKind::Gps, Vec3::from_array(self.gps_lever_p_m))
            .with(
                SensorKind::AcousticPosition,
                Vec3::from_array(self.acoustic_position_lever_p_m),
            )
            .with(SensorKind::Effort, Vec3::from_array(self.effort_lever_p_m));
        made
    }
}

impl Keyed for Options {
    const OWNER: &'static str = "options";
    const KEYS: &'static [Key<Self>] = keys! {
        "gate": Choice gate;
        "gate_probability": Number gate_probability;
        "inflate_after_rejections": Count inner.inflate_after_rejections;
        "covariance_period_ns": Nanoseconds inner.covariance_period_ns;
        "imu_sampling": Choice sampling;
        "estimate_dvl": Switch inner.estimate_dvl;
        "virtual_beam_factor": Number inner.assumptions.virtual_beam_factor;
        "nullified_sway_var_m2ps2": Number inner.assumptions.nullified_sway_var_m2ps2;
        "weak_sway_var_m2ps2": Number inner.assumptions.weak_sway_var_m2ps2;
        "information_port": Choice information_port;
        "water_track": Switch inner.water_track;
        "thrust": Choice thrust;
        "speed_sd_mps": Number inner.speed_bound.sd_mps;
        "speed_time_s": Number inner.speed_bound.time_s;
        "max_imu_rate_radps": Number inner.imu_limits.max_rate_radps;
        "max_imu_force_mps2": Number inner.imu_limits.max_force_mps2;
        "imu_stuck_after": Count inner.imu_limits.stuck_after;
        "max_imu_gap_s": Number inner.imu_limits.max_gap_s;
        "imu_gap": Choice long_gap;
        "imu_gap_rate_sd_radps": Number inner.imu_limits.gap_rate_sd_radps;
        "imu_gap_accel_sd_mps2": Number inner.imu_limits.gap_accel_sd_mps2;
        "depth_lever_p_m": Vector depth_lever_p_m;
        "gps_lever_p_m": Vector gps_lever_p_m;
        "acoustic_position_lever_p_m": Vector acoustic_position_lever_p_m;
        "effort_lever_p_m": Vector effort_lever_p_m;
        "water.current_sd_mps": Number inner.water.current_sd_mps;
        "water.current_time_s": Number inner.water.current_time_s;
        "water.sway_gain_m": Number inner.water.sway_gain_m;
        "water.sway_gain_sd_m": Number inner.water.sway_gain_sd_m;
        "water.trim_sd_mps": Number inner.water.trim_sd_mps;
        "water.trim_time_s": Number inner.water.trim_time_s;
        "water.slip_sd_mps": Number inner.water.slip_sd_mps;
        "water.slip_time_s": Number inner.water.slip_time_s;
        "water.slip_epochs": Number inner.water.slip_epochs;
        "current_layers.sd_mps": Number inner.current_layers.sd_mps;
        "current_layers.time_s": Number inner.current_layers.time_s;
        "current_layers.way_m": Number inner.current_layers.way_m;
        "current_layers.spacing_m": Number inner.current_layers.spacing_m;
        "current_layers.mean_time_s": Number inner.current_layers.mean_time_s;
        "calibration.mounting_sd_rad": Vector inner.calibration.mounting_sd_rad;
        "calibration.clock_sd_s": Number inner.calibration.clock_sd_s;
        "motion.mean_sd_mps": Vector inner.motion.mean_sd_mps;
        "motion.mean_time_s": Number inner.motion.mean_time_s;
        "motion.change_sd_mps": Vector inner.motion.change_sd_mps;
        "motion.change_time_s": Vector inner.motion.change_time_s;
        "robust.closure_gate": Gate inner.robust.closure_gate;
        "robust.beam_gate": Gate inner.robust.beam_gate;
        "robust.tail": Choice tail;
        "robust.student_t_degrees": Number student_t_degrees;
    };

    fn check(&self) -> Result<(), NavError> {
        // What is not chosen is checked too.
        GateTable::new(self.joint())?;
        let mut made = self.made();
        made.validate()?;
        made.robust.tail = self.student_t();
        made.robust.validate()?;
        Ok(())
    }
}

/// The default options: all of them suit a vehicle whose inertial readings are instantaneous. NULL for an error.
#[unsafe(no_mangle)]
pub extern "C" fn bl_options_default() -> *mut Options {
    made(|| Ok(Options::default()))
}

/// Name of a key by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_options_key(number: usize) -> *const c_char {
    Options::KEYS.get(number).map_or(ptr::null(), |key| c_name(key.name))
}

/// Sets a key whose value is a number, SI; 0 or 1 for a switch. For example "water_track". An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_set(options: *mut Options, key: *const c_char, value: f64) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { at_mut("options", options)?.set(self::key(key)?, value) })
}

/// Sets a key whose value is a vector of `count` numbers, SI. An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_set_vector(
    options: *mut Options,
    key: *const c_char,
    values: *const f64,
    count: usize,
) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { at_mut("options", options)?.set_vector(self::key(key)?, values, count) })
}

/// Sets a key whose value is a text. For example "gate", "off". An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_set_text(
    options: *mut Options,
    key: *const c_char,
    value: *const c_char,
) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { at_mut("options", options)?.set_text(self::key(key)?, text("value", value)?) })
}

/// Reads the numbers of a key into `values`, which holds `capacity`; `count` is how many there are, 1 but for a vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_get(
    options: *const Options,
    key: *const c_char,
    values: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        unsafe {
            let numbers = at("options", options)?.numbers(self::key(key)?)?;
            put("count", count, numbers.len())?;
            fill("values", values, capacity, &numbers)
        }
    })
}

/// Reads the text of a key; it lives as long as the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_get_text(
    options: *const Options,
    key: *const c_char,
    value: *mut *const c_char,
) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { put("value", value, c_name(at("options", options)?.text(self::key(key)?)?)) })
}

/// A copy. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_copy(options: *const Options) -> *mut Options {
    // SAFETY: as the header asks.
    made(|| unsafe { at("options", options) }.cloned())
}

/// Frees options; NULL is none. Navigators made with them stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_free(options: *mut Options) {
    // SAFETY: as the header asks.
    unsafe { free(options) }
}
