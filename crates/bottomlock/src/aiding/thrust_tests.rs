//! The row by hand, against differences, and blind to what it cannot tell.

use nalgebra::SVector;

use super::*;
use crate::aiding::current_layers::{CurrentAt, LAYER_STATES, LayerVector, Layers, LayersPrior};
use crate::aiding::further::FIRST_LAYERS;
use crate::aiding::water::tests::{example, motion as motion_at};
use crate::aiding::water::{CURRENT, WaterVector, inject};
use crate::frames::Rot;
use crate::layout::{ATTITUDE, DIM, VELOCITY};
use crate::state::{ErrorVector, NavState};

const REVOLUTIONS_HZ: f64 = 17.0;

/// Layers about 22 m of depth, each with a current of its own.
fn layers() -> Layers {
    let mut layers = Layers::new(&LayersPrior::default()).unwrap();
    layers.enclose(12.0, 38.0);
    layers.inject(
        0.0,
        &LayerVector::from([0.1, -0.05, 0.02, 0.08, -0.07, 0.03, 0.04, -0.09]),
    );
    layers
}

fn row_of(state: &NavState, water: &WaterVector, layers: Option<&Layers>) -> Innovation {
    let motion = motion_at(state, [0.1, -0.2, 0.3]);
    let water = Some(CurrentAt::new(water, layers, motion.level.depth_m));
    thrust(&Motion { water, ..motion }, REVOLUTIONS_HZ, 0.01)
}

/// Hand-worked: level, heading east at 2 m/s over ground in a current of 0.5 m/s to the east and 0.3 m/s to the north, the speed
/// through the water is 1.5 m/s; 17 turns of a metre more, or a slip, would explain as much of it.
#[test]
fn a_current_by_hand() {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    state.velocity_p_mps = Vec3::new(2.0, -0.3, 0.0);
    let row = row_of(&state, &WaterVector::from([0.3, 0.5, 0.0, 0.0, 0.0, 0.0]), None);
    assert_eq!((row.rows, row.degrees), (1, 1));
    assert!((row.residual[0] + 1.5).abs() < 1e-15);
    assert_eq!(row.noise[(0, 0)], 1e-4);
    let further = row.by_further.unwrap();
    let columns = [
        (FIRST_THRUST + ADVANCE, -17.0),
        (FIRST_THRUST + SLIP, -1.0),
        (FIRST_WATER + CURRENT + 1, -1.0),
        (FIRST_WATER + CURRENT, 0.0),
    ];
    for (k, expected) in columns {
        assert!((further[(0, k)] - expected).abs() < 1e-15, "{k}");
    }
}

/// A propeller at rest drives nothing, and without the current as states there is nothing to relate it to.
#[test]
fn no_row() {
    let (state, water) = example(5.0);
    let motion = motion_at(&state, [0.0; 3]);
    assert_eq!(thrust(&motion, REVOLUTIONS_HZ, 0.01).rows, 0);
    let water = Some(CurrentAt::new(&water, None, 0.0));
    let of = |revolutions_hz| thrust(&Motion { water, ..motion }, revolutions_hz, 0.01).rows;
    assert_eq!([0.0, -0.0, 1e-3, -20.0].map(of), [0, 0, 1, 1]);
}

/// H against central differences when the estimate moves, also where the vehicle stands on end.
#[test]
fn the_row_is_the_derivative() {
    for pitch in [0.0, 12.0, -70.0, 89.9, -89.9, 90.0, -90.0] {
        let ((mut state, water), layers) = (example(pitch), layers());
        state.position_t_m = Vec3::new(40.0, -20.0, 22.0);
        // What the filter adds: a n + s.
        let own = [0.1, 0.03];
        let at = |error: &ErrorVector, by: &WaterVector, by_layer: &LayerVector, by_thrust: [f64; 2]| {
            let (mut state, mut water, mut layers) = (state, water, layers.clone());
            state.inject(error);
            inject(&mut water, error[ATTITUDE + 2], by);
            layers.inject(error[ATTITUDE + 2], by_layer);
            let motion = motion_at(&state, [0.1, -0.2, 0.3]);
            let at = CurrentAt::new(&water, Some(&layers), motion.level.depth_m);
            let current_t = Vector3::new(at.water[CURRENT], at.water[CURRENT + 1], 0.0);
            let relative_p = state.velocity_p_mps.0 - state.attitude_t_p.matrix().tr_mul(&current_t);
            (own[0] + by_thrust[0]) * REVOLUTIONS_HZ + own[1] + by_thrust[1] - relative_p.x
        };
        let row = row_of(&state, &water, Some(&layers));
        let further = row.by_further.as_deref().unwrap();
        let (none, zero, still, step) = (WaterVector::zeros(), ErrorVector::zeros(), LayerVector::zeros(), 1e-5);
        let check = |ahead: f64, behind: f64, expected: f64, name: &str, j: usize| {
            let slope = (behind - ahead) / (2.0 * step);
            assert!((slope - expected).abs() < 1e-8, "pitch {pitch}, {name} {j}: {slope}");
        };
        for j in 0..DIM {
            let error = ErrorVector::ith(j, step);
            let moved = |error| at(error, &none, &still, [0.0; 2]);
            check(moved(&error), moved(&-error), row.jacobian[(0, j)], "state", j);
        }
        for j in 0..WATER {
            let by = WaterVector::ith(j, step);
            let moved = |by| at(&zero, by, &still, [0.0; 2]);
            check(moved(&by), moved(&-by), further[(0, FIRST_WATER + j)], "water", j);
        }
        for j in 0..LAYER_STATES {
            let by = LayerVector::ith(j, step);
            let moved = |by| at(&zero, &none, by, [0.0; 2]);
            check(moved(&by), moved(&-by), further[(0, FIRST_LAYERS + j)], "layer", j);
        }
        for j in 0..THRUST {
            let by = SVector::<f64, THRUST>::ith(j, step);
            let moved = |by: SVector<f64, THRUST>| at(&zero, &none, &still, [by[0], by[1]]);
            check(moved(by), moved(-by), further[(0, FIRST_THRUST + j)], "thrust", j);
        }
    }
}

/// A velocity over ground and the same current change no reading, and no row turns the yaw.
#[test]
fn what_it_leaves_open() {
    for pitch in [0.0, -40.0, 85.0] {
        let (state, water) = example(pitch);
        let row = row_of(&state, &water, Some(&layers()));
        let further = row.by_further.as_deref().unwrap();
        let rotation = state.attitude_t_p.matrix();
        for axis in 0..2 {
            let by_velocity = rotation.tr_mul(&Vector3::ith(axis, 1.0));
            let open = row.jacobian.fixed_view::<1, 3>(0, VELOCITY) * by_velocity;
            let sum = open[0] + further[(0, FIRST_WATER + CURRENT + axis)];
            assert!(sum.abs() < 1e-15, "pitch {pitch}");
        }
        assert!(row.jacobian[(0, ATTITUDE + 2)].abs() < 1e-15);
    }
}

/// Numbers that no propeller has are named.
#[test]
fn models_are_checked() {
    let good = ThrustModel {
        advance_m: 0.1,
        slip_sd_mps: 0.02,
        ..ThrustModel::default()
    };
    assert_eq!(good.require_usable(), Ok(()));
    type Change = fn(&mut ThrustModel);
    let changes: [(&str, Change); 5] = [
        ("thrust.advance_m", |model| model.advance_m = 0.0),
        ("thrust.advance_m", |model| model.advance_m = 1e3),
        ("thrust.advance_sd_m", |model| model.advance_sd_m = f64::INFINITY),
        ("thrust.slip_sd_mps", |model| model.slip_sd_mps = 0.0),
        ("thrust.slip_sd_mps", |model| model.slip_sd_mps = 1e5),
    ];
    for (field, change) in changes {
        let mut model = good;
        change(&mut model);
        let text = model.require_usable().unwrap_err().to_string();
        assert!(text.contains(field), "{text}");
    }
}
