//! The row by hand, against differences, and blind to what it cannot tell.

use super::*;
use crate::aiding::water::tests::{example, motion as motion_at};
use crate::aiding::water_track::tests::layers;
use crate::testing::*;

const RATE: [f64; 3] = [0.1, -0.2, 0.3];

/// What the drives say, which differs by axis.
fn sample() -> ThrustSample {
    ThrustSample {
        time_ns: 0,
        speed_p_mps: Vec3::new(1.7, -0.4, 0.3),
        sd_mps: 0.01,
    }
}

fn row_of(axis: usize, state: &NavState, water: &Water<'_>, lever_p_m: &Vec3<Platform>) -> Innovation {
    let motion = motion_at(state, RATE);
    let water = Some(water.at(motion.level.depth_m));
    thrust(axis, &Motion { water, ..motion }, &sample(), lever_p_m)
}

/// Hand-worked: level, heading east at 2 m/s over ground in a current of 0.5 m/s to the east and 0.3 m/s to the north, the speed
/// through the water is 1.5 m/s ahead; a scale on 1.7 m/s, or a slip, would explain as much of it. To starboard, which is south, it is
/// 0.3 m/s, and 0.2 m/s more at a place 0.5 m ahead that turns to starboard at 0.4 rad/s.
#[test]
fn a_current_by_hand() {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let water = WaterVector::from([0.3, 0.5, 0.0, 0.0, 0.0, 0.0]);
    let mut motion = motion_at(&state, [0.0, 0.0, 0.4]);
    motion.earth_rate_t_radps = Vector3::zeros();
    motion.water = Some(Water::common(&water).at(0.0));
    let ahead = Vec3::new(0.5, 0.0, 0.0);
    let of = |axis| thrust(axis, &motion, &sample(), &ahead);
    let row = of(0);
    assert_eq!((row.rows, row.degrees), (1, 1));
    assert!((row.residual[0] + 1.5).abs() < 1e-15);
    assert_eq!(row.noise[(0, 0)], 1e-4);
    let further = row.by_further.unwrap();
    let columns = [
        (block::THRUST.first + SCALE, -1.7),
        (block::THRUST.first + SLIP, -1.0),
        (block::THRUST.first + SCALE + 1, 0.0),
        (block::WATER.first + CURRENT + 1, -1.0),
        (block::WATER.first + CURRENT, 0.0),
    ];
    for (k, expected) in columns {
        assert!((further[(0, k)] - expected).abs() < 1e-15, "{k}");
    }
    let starboard = of(1);
    assert!((starboard.residual[0] + 0.5).abs() < 1e-15, "{}", starboard.residual[0]);
    assert_eq!(starboard.by_further.unwrap()[(0, block::THRUST.first + SCALE + 1)], 0.4);
}

/// Drives at rest say nothing, and without the current as states there is nothing to relate a speed to.
#[test]
fn no_row() {
    let (state, water) = example(5.0);
    let motion = motion_at(&state, [0.0; 3]);
    assert_eq!(thrust(0, &motion, &sample(), &Vec3::zeros()).rows, 0);
    let water = Some(Water::common(&water).at(0.0));
    let with_water = Motion { water, ..motion };
    for (speed_mps, rows) in [(0.0, 0), (-0.0, 0), (1e-3, 1), (-2.0, 1)] {
        let still = ThrustSample {
            speed_p_mps: Vec3::new(speed_mps, 0.0, 0.0),
            ..sample()
        };
        assert_eq!(thrust(0, &with_water, &still, &Vec3::zeros()).rows, rows);
        assert_eq!(still.gives(Sensor::ThrustSurge), rows == 1);
        assert!(!still.gives(Sensor::ThrustSway) && !still.gives(Sensor::Depth));
    }
}

/// H against central differences when the estimate moves, along each axis, also where the vehicle stands on end.
#[test]
fn the_row_is_the_derivative() {
    let lever = Vec3::new(-0.3, 0.1, 0.2);
    for (pitch, axis) in [0.0, 12.0, -70.0, 89.9, -89.9, 90.0, -90.0]
        .into_iter()
        .flat_map(|pitch| [0, 1, 2].map(|axis| (pitch, axis)))
    {
        let ((mut state, water), (layers, own_mps)) = (example(pitch), layers());
        let water = Water::common(&water).with(&layers, &own_mps);
        state.position_t_m = Vec3::new(40.0, -20.0, 22.0);
        let at = |error: &ErrorVector, by: &FurtherVector| {
            let (mut state, mut water) = (state, water);
            state.inject(error);
            water.inject(error[ATTITUDE + 2], &part(by, block::WATER), &part(by, block::LAYERS));
            let motion = motion_at(&state, RATE);
            let at = water.at(motion.level.depth_m);
            let current_t = Vector3::new(at.water[CURRENT], at.water[CURRENT + 1], 0.0);
            let relative_p = state.velocity_p_mps.0 + motion.rate_tp().cross(&lever.0)
                - state.attitude_t_p.matrix().tr_mul(&current_t);
            // What the filter adds: a n + s.
            let own = part::<THRUST>(by, block::THRUST);
            let said = (1.1 + own[SCALE + axis]) * sample().speed_p_mps.0[axis] + 0.03 + own[SLIP + axis];
            SVector::from([said - relative_p[axis]])
        };
        let row = row_of(axis, &state, &water, &lever);
        let (zero, none, place) = (
            ErrorVector::zeros(),
            FurtherVector::zeros(),
            format!("pitch {pitch}, axis {axis}"),
        );
        let stated = row.jacobian.fixed_rows::<1>(0).into_owned();
        assert_slopes(&place, &stated, [1e-5, 1e-8], |error| at(error, &none));
        let stated = row.by_further.unwrap().fixed_rows::<1>(0).into_owned();
        assert_slopes(&place, &stated, [1e-5, 1e-8], |by| at(&zero, by));
    }
}

/// A velocity over ground and the same current change no reading, and no row turns the yaw but by the earth's rate.
#[test]
fn what_it_leaves_open() {
    for (pitch, axis) in [(0.0, 0), (0.0, 2), (-40.0, 1), (85.0, 0)] {
        let (state, water) = example(pitch);
        for (lever, bound) in [(Vec3::zeros(), 1e-15), (Vec3::new(0.1, 0.3, -0.2), 1e-4)] {
            let (layers, own_mps) = layers();
            let row = row_of(axis, &state, &Water::common(&water).with(&layers, &own_mps), &lever);
            let further = row.by_further.as_deref().unwrap();
            let rotation = state.attitude_t_p.matrix();
            for north_east in 0..2 {
                let by_velocity = rotation.tr_mul(&Vector3::ith(north_east, 1.0));
                let open = row.jacobian.fixed_view::<1, 3>(0, VELOCITY) * by_velocity;
                let sum = open[0] + further[(0, block::WATER.first + CURRENT + north_east)];
                assert!(sum.abs() < 1e-15, "pitch {pitch}");
            }
            assert!(row.jacobian[(0, ATTITUDE + 2)].abs() < bound);
        }
    }
}

/// Numbers that no vehicle has are named; one axis is enough.
#[test]
fn models_are_checked() {
    let good = ThrustModel {
        scale_sd: [0.1; 3],
        slip_sd_mps: [0.0, 0.02, 0.0],
        ..ThrustModel::default()
    };
    assert_eq!([0, 1, 2].map(|axis| good.has(axis)), [false, true, false]);
    let faults: [Fault<ThrustModel>; 3] = [
        ("thrust.scale_sd", |model| model.scale_sd[2] = f64::INFINITY),
        ("thrust.slip_sd_mps", |model| model.slip_sd_mps[1] = 0.0),
        ("thrust.slip_sd_mps", |model| model.slip_sd_mps[1] = 1e5),
    ];
    assert_refused(&good, ThrustModel::require_usable, &faults);
}
