use proptest::prelude::*;
use serde_json::{Deserializer, Value, json};

use super::*;
use crate::aiding::registry::{Levers, SensorKind};
use crate::frames::Vec3;

/// Key, expectation and hint of the refusal of settings as JSON.
fn refused(place: &str, given: &Value) -> (String, String, String) {
    let text = given.to_string();
    let error = check(place, &mut Deserializer::from_str(&text)).expect_err(&text);
    (error.key().into(), error.expected().into(), error.hint().into())
}

/// A setting that is refused by its own key, what is expected of it, and the hint, where there are any.
const REFUSED: &str = r#"
options.gaate = "off"                                ; ; did you mean 'gate'?
options.gate = "of"                                  ; 'joint', 'per_row' or 'off' ; did you mean 'off'?
options.gate = 1
options.gate_probability = 1.0                       ; strictly between 0 and 1: a probability, not a percentage
options.covariance_period_ns = -1                    ; 0 (every IMU step) or a positive number of nanoseconds
options.inflate_after_rejections = 1                 ; 0 (never), or 2 or more: single correct fixes are rejected by chance
options.assumptions.virtual_beam_factor = 0.0        ; a finite number > 0
options.assumptions.nullified_sway_var_m2ps2 = -1    ; a finite number > 0
options.assumptions.weak_sway_var_m2ps2 = 0.0        ; a finite number > 0
options.water = null                                 ; a table of settings
options.water.slip_tme_s = 1.0                       ; ; did you mean 'slip_time_s'?
options.water.slip_time_s = true                     ; a number
options.water.slip_time_s = "5"                      ; a number
options.water.slip_time_s = 0.0                      ; a finite number > 0
options.water.slip_sd_mps = 0.0                      ; a finite number > 0
options.water.slip_sd_mps = 1e10                     ; less than 1e7: 1e6 already gives the assumption no weight
options.water.current_sd_mps = -0.1                  ; a finite number >= 0
options.water.current_sd_mps = 1e7
options.water.current_time_s = 0.0                   ; a finite number > 0
options.water.sway_gain_m = -1e8
options.water.sway_gain_m = -1e13
options.water.sway_gain_sd_m = -1.0                  ; a finite number >= 0
options.water.sway_gain_sd_m = 1e11
options.water.trim_sd_mps = -1.0                     ; a finite number >= 0
options.water.trim_sd_mps = 3e9
options.water.trim_time_s = -1.0                     ; a finite number > 0
options.current_layers.sd_mps = -1.0                 ; a finite number >= 0
options.current_layers.sd_mps = 1e7                  ; less than 1e7 m/s
options.current_layers.time_s = 0.0                  ; a finite number > 0
options.current_layers.way_m = 0.0                   ; a finite number > 0
options.current_layers.spacing_m = 0.0               ; a finite number > 0
options.current_layers.mean_time_s = 0.0             ; a finite number > 0
options.calibration.mounting_sd_rad = [-0.1, 0, 0]   ; a finite number >= 0
options.calibration.mounting_sd_rad = [0, 5, 0]      ; at most 0.6 rad: is it in degrees?
options.calibration.clock_sd_s = -1.0                ; a finite number >= 0
options.calibration.clock_sd_s = 100.0               ; at most 2 s: is it in milliseconds?
options.speed_bound.sd_mps = -1.0                    ; a finite number >= 0
options.speed_bound.time_s = 0.0                     ; a finite number > 0
options.motion.mean_sd_mps = [0, -1, 0]              ; a finite number >= 0
options.motion.change_sd_mps = [0, 0, -1]            ; a finite number >= 0
options.motion.mean_time_s = 0.0                     ; a finite number > 0
options.motion.change_time_s = [0, 1, 1]             ; a finite number > 0
options.robust.beam_gate = 0.0                       ; strictly between 0 and 1
options.robust.beam_gate = 1.0                       ; strictly between 0 and 1
options.robust.closure_gate = 1.0                    ; strictly between 0 and 1
options.robust.student_t_degrees = 0.5               ; a finite number >= 1
options.imu_limits.stuck_after = 2.5                 ; a whole number, 0 or more
options.imu_limits.stuck_after = 1                   ; 0 (never), or 2 or more equal readings in a row
options.imu_limits.max_rate_radps = 0.0              ; a full scale of the data sheet, more than 0 and at most 1e6
options.imu_limits.max_force_mps2 = 1e7              ; a full scale of the data sheet, more than 0 and at most 1e6
options.imu_limits.max_gap_s = 0.0                   ; a number of seconds, more than 0 and at most 1e6
options.imu_limits.gap_rate_sd_radps = -1.0          ; a finite number >= 0
options.imu_limits.gap_accel_sd_mps2 = -1.0          ; a finite number >= 0
options.levers.depth = [0, 0, 0]                     ; ; did you mean 'depth_p_m'?
options.levers.gps_p_m = [0, 0, 1e13]                ; numbers of metres
environment.gravity_mps2 = -1.0                      ; a finite number >= 0
environment.gravity_mps2 = 980.0                     ; 9.7 to 9.9 m/s^2, 20 at most
environment.latitude_rad = 32.8                      ; -pi/2 to pi/2: the latitude is in radians
imu.gyro_noise_rad_rts = "x"                         ; a number
imu.gyro_noise_rad_rts = -1.0                        ; a finite number >= 0
imu.accel_bias_walk_mps2_rts = -1.0                  ; a finite number >= 0
imu.gyro_noise = 1.0
initial.attitude_sd_rad = [0, 0, -1]                 ; a finite number >= 0
dvl.scale_factor_sd = -1.0                           ; a finite number >= 0
gps.position_sd_m = [1.0, 2.0]
"#;

/// A refusal names the whole key, what was expected, and the nearest known key; so does that of a section of a model, which is
/// named by itself.
#[test]
fn refusals_name_the_key() {
    let model = serde_json::to_value(Model::table_2()).unwrap();
    for line in REFUSED.trim().lines() {
        let (setting, expected) = line.split_once(" ; ").unwrap_or((line, ""));
        let (expected, hint) = expected.split_once("; ").unwrap_or((expected, ""));
        let (key, value) = setting.split_once(" = ").unwrap();
        let mut value: Value = serde_json::from_str(value).unwrap();
        let place = match key.strip_prefix("options.") {
            Some(path) => {
                for part in path.rsplit('.') {
                    value = json!({ part: value });
                }
                "options"
            }
            None => {
                let (section, name) = key.split_once('.').unwrap();
                let mut given = model.clone();
                given[section][name] = value;
                value = given;
                "model"
            }
        };
        let (found, wanted, near) = refused(place, &value);
        assert_eq!(found, key, "{line}");
        assert!(
            expected.trim().is_empty() || wanted == expected.trim(),
            "{line}: {wanted}"
        );
        assert!(hint.is_empty() || near == hint, "{line}: {near}");
    }
}

/// Of parts alone: what is missing or no table at all, one that needs another, and a name that is none.
#[test]
fn refusals_of_parts() {
    for (place, given, key) in [
        ("options.robust", json!({"beam_gate": 2.0}), "options.robust.beam_gate"),
        ("model", json!({"gravity": 9.8}), "gravity"),
        (
            "initial",
            json!({"position_sd_m": [1, 1, 1]}),
            "initial.attitude_sd_rad",
        ),
        (
            "depth",
            json!({"sd_m": -1.0, "bias_sd_m": 0, "bias_time_s": 1}),
            "depth.sd_m",
        ),
        ("imu", json!([1, 2]), "imu"),
    ] {
        assert_eq!(refused(place, &given).0, key, "{given}");
    }
    let factor = json!({"exact_virtual_beams": true, "virtual_beam_factor": 2.0});
    assert!(
        refused("options.assumptions", &factor)
            .1
            .starts_with("1 with exact_virtual_beams")
    );
    let error = check("nothing", &mut Deserializer::from_str("{}")).unwrap_err();
    assert!(matches!(error, NavError::UnknownName { .. }));
    let gates = Robust {
        beam_gate: Some(f64::NAN),
        ..Robust::OFF
    };
    assert!(gates.validate().is_err() && options(&mut Deserializer::from_str("{}")).is_ok());
    for good in [0, 2, 3] {
        let given = json!({"covariance_period_ns": 0, "inflate_after_rejections": good}).to_string();
        assert!(check("options", &mut Deserializer::from_str(&given)).is_ok());
    }
}

/// A model is written by sections, without those that there are not; a section that is missing is named.
#[test]
fn sections_of_a_model() {
    let given = serde_json::to_value(Model::table_2()).unwrap();
    let model: Model = serde_json::from_value(given.clone()).unwrap();
    assert_eq!(model, Model::table_2());
    assert_eq!(given["thrust"], Value::Null);
    let mut lacking = given.clone();
    lacking.as_object_mut().unwrap().remove("imu");
    let error = check("model", &mut Deserializer::from_str(&lacking.to_string())).unwrap_err();
    assert_eq!(
        (error.key(), error.to_string().as_str()),
        ("model.imu", "model.imu is missing")
    );
}
/// What is written is read again as the same options, by a key for each part.
#[test]
fn options_have_the_shape_of_their_keys() {
    let mut options = Options::default();
    options.levers = options.levers.with(SensorKind::Gps, Vec3::new(0.1, -0.2, 0.3));
    options.robust = None;
    let text = serde_json::to_string(&options).unwrap();
    assert_eq!(super::options(&mut Deserializer::from_str(&text)), Ok(options));
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["levers"]["gps_p_m"], json!([0.1, -0.2, 0.3]));
    assert_eq!(
        (&value["robust"], &value["imu_limits"]["gap"]),
        (&Value::Null, &json!("refuse"))
    );
    let empty = super::options(&mut Deserializer::from_str("{}"));
    assert_eq!(empty, Ok(Options::default()));
    let lever: Levers = serde_json::from_str(r#"{"depth_p_m": [1, 2, 3]}"#).unwrap();
    assert_eq!(lever.of(SensorKind::Depth).to_array(), [1.0, 2.0, 3.0]);
}

proptest! {
    /// Numbers come back to the last bit.
    #[test]
    fn json_keeps_the_bits(value in 1e-12..1e11_f64) {
        let mut options = Options::default();
        options.water.slip_time_s = value;
        let text = serde_json::to_string(&options).unwrap();
        prop_assert_eq!(super::options(&mut Deserializer::from_str(&text)).unwrap().water.slip_time_s.to_bits(), value.to_bits());
    }
}
