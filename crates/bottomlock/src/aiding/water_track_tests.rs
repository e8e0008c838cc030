//! The rows by hand, against differences, and blind to what the water alone leaves open.

use super::*;
use crate::aiding::current_layers::{Layers, LayersPrior};
use crate::aiding::water::tests::{example as moving, motion as motion_at};
use crate::testing::*;

fn janus() -> BeamGeometry {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    geometry.with_lever_arms(&[Vec3::new(0.8, -0.1, 0.3); 4]).unwrap()
}

/// As for the assumptions, with errors of the DVL.
fn example(pitch_deg: f64) -> (NavState, WaterVector) {
    let (mut state, water) = moving(pitch_deg);
    state.dvl_bias_mps = [0.01, -0.02, 0.03, 0.0].into();
    state.dvl_scale_factor = 0.02;
    (state, water)
}

fn motion(state: &NavState) -> Motion<'_> {
    motion_at(state, [0.1, -0.2, 0.3])
}

fn sample(valid: BeamMask) -> WaterSample {
    WaterSample {
        ping: ping_of(0, std::array::from_fn(|beam| 0.3 * beam as f64 - 0.4), 0.05, valid),
        range_m: 7.0,
    }
}

/// Layers about 22 m of depth, each with a current of its own.
pub(in crate::aiding) fn layers() -> (Layers, LayerVector) {
    let mut layers = Layers::new(&LayersPrior::default()).unwrap();
    layers.enclose(12.0, 38.0);
    (layers, [0.1, -0.05, 0.02, 0.08, -0.07, 0.03, 0.04, -0.09].into())
}

fn terms(state: &NavState, water: &Water<'_>, sample: &WaterSample) -> BeamTerms {
    let (motion, geometry) = (motion(state), janus());
    water_track_terms(&motion, &geometry, water, sample, |relative| {
        beam_terms(relative, &geometry, &sample.ping)
    })
}

/// Hand-worked: level, heading east at 2 m/s over ground in a current of 0.5 m/s to the east and 0.3 m/s to the north, the beams
/// read 1.5 m/s ahead and 0.3 m/s to starboard.
#[test]
fn a_current_by_hand() {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let water = Water::common(&[0.3, 0.5, 0.0, 0.0, 0.0, 0.0].into());
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let mut sample = sample(BeamMask::all(4));
    for beam in 0..4 {
        sample.ping.velocity_mps[beam] = geometry.direction_p(beam).dot(&Vector3::new(1.5, 0.3, 0.0));
    }
    let still = Motion {
        rate_ip_p_radps: Vector3::zeros(),
        earth_rate_t_radps: Vector3::zeros(),
        ..motion(&state)
    };
    let terms = water_track_terms(&still, &geometry, &water, &sample, |relative| {
        beam_terms(relative, &geometry, &sample.ping)
    });
    assert!(terms.residual.amax() < 1e-15, "{}", terms.residual);
}

/// Without a current the rows are those of the bottom, but for the columns of the current.
#[test]
fn in_still_water_the_rows_are_those_of_the_bottom() {
    let (state, _) = example(5.0);
    let sample = sample(BeamMask::all(4));
    let still = terms(&state, &Water::common(&WaterVector::zeros()), &sample);
    let bottom = beam_terms(&motion(&state), &janus(), &sample.ping);
    assert_eq!(
        (still.residual, still.jacobian, still.noise),
        (bottom.residual, bottom.jacobian, bottom.noise)
    );
}

/// Hand-worked: with layers at 10 m and 20 m the vehicle at 11 m, level, looks from a metre below at a cell 4 m deeper: three
/// fifths of the way, so that of 0.1 and −0.3 m/s to the north −0.14 m/s are left; the beam itself sees none of it.
#[test]
fn a_layer_by_hand() {
    let mut layers = Layers::new(&LayersPrior::default()).unwrap();
    layers.enclose(12.0, 16.0);
    let places = [1, 2];
    let mut own = LayerVector::zeros();
    (own[2 * places[0]], own[2 * places[1]]) = (0.1, -0.3);
    let mut state = NavState::at_rest(0);
    state.position_t_m = Vec3::new(0.0, 0.0, 11.0);
    let geometry = BeamGeometry::from_directions(&[Vec3::new(0.6, 0.0, 0.8)]).unwrap();
    let geometry = geometry.with_lever_arms(&[Vec3::new(0.0, 0.0, 1.0)]).unwrap();
    let mut sample = WaterSample {
        range_m: 5.0,
        ..sample(BeamMask::all(1))
    };
    sample.ping.velocity_mps[0] = 0.6 * 0.14;
    let still = Motion::still(&state);
    let found = water_track_terms(
        &still,
        &geometry,
        &Water::common(&WaterVector::zeros()).with(&layers, &own),
        &sample,
        |relative| beam_terms(relative, &geometry, &sample.ping),
    );
    assert!(found.residual[0].abs() < 1e-15, "{}", found.residual[0]);
    let further = found.by_further.as_deref().unwrap();
    assert!((further[(0, block::LAYERS.first + 2 * places[0])] + 0.6 * 0.4).abs() < 1e-15);
    assert!((further[(0, block::LAYERS.first + 2 * places[1])] + 0.6 * 0.6).abs() < 1e-15);
    // A metre deeper the current is 0.04 m/s less.
    assert!((found.jacobian[(0, POSITION + 2)] - 0.6 * 0.04).abs() < 1e-15);
}

/// H against central differences when the estimate moves, also where the vehicle stands on end and beams are lost; between layers,
/// whose current at a cell moves with its depth.
#[test]
fn rows_are_the_derivatives() {
    for (pitch, valid) in [0.0, 12.0, -70.0, 89.9, -89.9, 90.0]
        .into_iter()
        .flat_map(|pitch| [BeamMask::all(4), [0, 2, 3].into_iter().collect()].map(|valid| (pitch, valid)))
    {
        let ((mut state, water), (layers, own_mps)) = (example(pitch), layers());
        let water = Water::common(&water).with(&layers, &own_mps);
        state.position_t_m = Vec3::new(40.0, -20.0, 22.0);
        let sample = sample(valid);
        let at = |error: &ErrorVector, by: &FurtherVector| {
            let (mut state, mut water) = (state, water);
            state.inject(error);
            water.inject(error[ATTITUDE + 2], &part(by, block::WATER), &part(by, block::LAYERS));
            terms(&state, &water, &sample)
        };
        let (zero, none, place) = (
            ErrorVector::zeros(),
            FurtherVector::zeros(),
            format!("pitch {pitch}, {valid:?}"),
        );
        let stated = at(&zero, &none);
        assert_slopes(&place, &stated.jacobian, [1e-5, 1e-8], |error| {
            at(error, &none).residual
        });
        let stated = stated.by_further.unwrap();
        assert_slopes(&place, &stated, [1e-5, 1e-9], |by| at(&zero, by).residual);
    }
}

/// A velocity over ground and the same current change no reading, and no row turns the yaw: its derivative is that of the bottom.
#[test]
fn what_the_water_alone_leaves_open() {
    for pitch in [0.0, -40.0, 85.0] {
        let (state, water) = example(pitch);
        let sample = sample(BeamMask::all(4));
        let (layers, own_mps) = layers();
        let whole = terms(&state, &Water::common(&water).with(&layers, &own_mps), &sample);
        let further = whole.by_further.as_deref().unwrap();
        let rotation = motion(&state).rotation();
        for axis in 0..2 {
            let by_velocity = rotation.tr_mul(&Vector3::ith(axis, 1.0));
            let open = whole.jacobian.fixed_columns::<3>(VELOCITY) * by_velocity
                + further.column(block::WATER.first + CURRENT + axis);
            assert!(open.amax() < 1e-15, "pitch {pitch}: {open}");
        }
        let bottom = beam_terms(&motion(&state), &janus(), &sample.ping);
        let yaw = whole.jacobian.column(ATTITUDE + 2) - bottom.jacobian.column(ATTITUDE + 2);
        assert!(yaw.amax() < 1e-15);
        assert_eq!(whole.residual.rows(4, MAX_ROWS - 4).amax(), 0.0);
    }
}
