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

/// A refusal names the whole key, what was expected, and the nearest known key.
#[test]
fn refusals_name_the_key() {
    for (place, given, key, expected, hint) in [
        (
            "options",
            json!({"gaate": "off"}),
            "options.gaate",
            "",
            "did you mean 'gate'?",
        ),
        (
            "options",
            json!({"gate": "of"}),
            "options.gate",
            "'joint', 'per_row' or 'off'",
            "did you mean 'off'?",
        ),
        ("options", json!({"gate": 1}), "options.gate", "", ""),
        (
            "options",
            json!({"water": {"slip_tme_s": 1.0}}),
            "options.water.slip_tme_s",
            "",
            "did you mean 'slip_time_s'?",
        ),
        (
            "options",
            json!({"water": {"slip_time_s": true}}),
            "options.water.slip_time_s",
            "a number",
            "",
        ),
        (
            "options",
            json!({"water": {"slip_time_s": "5"}}),
            "options.water.slip_time_s",
            "a number",
            "",
        ),
        (
            "options",
            json!({"water": null}),
            "options.water",
            "a table of settings",
            "",
        ),
        (
            "options",
            json!({"water": {"slip_time_s": 0.0}}),
            "options.water.slip_time_s",
            "a finite number > 0",
            "",
        ),
        (
            "options",
            json!({"imu_limits": {"stuck_after": 2.5}}),
            "options.imu_limits.stuck_after",
            "a whole number, 0 or more",
            "",
        ),
        (
            "options",
            json!({"levers": {"depth": [0, 0, 0]}}),
            "options.levers.depth",
            "",
            "did you mean 'depth_p_m'?",
        ),
        (
            "options",
            json!({"levers": {"gps_p_m": [0, 0, 1e13]}}),
            "options.levers.gps_p_m",
            "numbers of metres",
            "",
        ),
        (
            "options",
            json!({"gate_probability": 1.0, "gate": "off"}),
            "options.gate_probability",
            "strictly between 0 and 1: a probability, not a percentage",
            "",
        ),
        (
            "options.robust",
            json!({"beam_gate": 2.0}),
            "options.robust.beam_gate",
            "strictly between 0 and 1",
            "",
        ),
        ("model", json!({"gravity": 9.8}), "gravity", "", ""),
        (
            "initial",
            json!({"position_sd_m": [1, 1, 1], "attitude_sd_rad": [0, 0, 0]}),
            "initial.velocity_sd_mps",
            "",
            "",
        ),
        (
            "depth",
            json!({"sd_m": -1.0, "bias_sd_m": 0, "bias_time_s": 1}),
            "depth.sd_m",
            "a finite number >= 0",
            "",
        ),
        ("imu", json!([1, 2]), "imu", "", ""),
    ] {
        let (found, wanted, near) = refused(place, &given);
        assert_eq!(found, key, "{given}");
        if !expected.is_empty() {
            assert_eq!(wanted, expected, "{given}");
        }
        if !hint.is_empty() {
            assert_eq!(near, hint, "{given}");
        }
    }
    let error = check("nothing", &mut Deserializer::from_str("{}")).unwrap_err();
    assert!(matches!(error, NavError::UnknownName { .. }));
}

/// A section of a model is named by itself, within the model too; what is missing is named.
#[test]
fn sections_of_a_model() {
    let given = serde_json::to_value(Model::table_2()).unwrap();
    let model: Model = serde_json::from_value(given.clone()).unwrap();
    assert_eq!(model, Model::table_2());
    assert_eq!(given["thrust"], Value::Null);
    let with = |section: &str, key: &str, value: Value| {
        let mut given = given.clone();
        given[section][key] = value;
        refused("model", &given)
    };
    assert_eq!(
        with("imu", "gyro_noise_rad_rts", json!("x")).0,
        "imu.gyro_noise_rad_rts"
    );
    assert_eq!(with("imu", "gyro_noise", json!(1.0)).0, "imu.gyro_noise");
    assert_eq!(with("gps", "position_sd_m", json!([1.0, 2.0])).0, "gps.position_sd_m");
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
