//! The row by hand, against differences, and blind to what it cannot tell.

use proptest::prelude::*;

use super::*;
use crate::aiding::current_layers::{CurrentAt, LAYER_STATES, LayerVector, Layers, LayersPrior};
use crate::aiding::further::FIRST_LAYERS;
use crate::aiding::water::tests::{example, motion as motion_at};
use crate::aiding::water::{CURRENT, WaterVector, inject};
use crate::frames::Rot;
use crate::state::{ErrorVector, NavState};

const RATE: [f64; 3] = [0.1, -0.2, 0.3];

/// A vehicle whose axes all differ, somewhat light.
fn model() -> EffortModel {
    EffortModel {
        mass_kg: [20.0, 24.0, 32.0],
        linear_drag_kgps: [14.0, 3.0, 33.0],
        quadratic_drag_kgpm: [140.0, 217.0, 0.0],
        buoyancy_n: Signed(2.4),
        slip_sd_mps: 0.02,
        ..EffortModel::default()
    }
}

fn sample(force_p_n: [f64; 3], sd_n: f64) -> EffortSample {
    EffortSample {
        time_ns: 0,
        force_p_n: Vec3::from_array(force_p_n),
        sd_n,
    }
}

fn steady() -> MotionChange {
    MotionChange {
        acceleration_p_mps2: Vector3::zeros(),
        angular_acceleration_p_radps2: Vector3::zeros(),
        velocity_by_state: SMatrix::zeros(),
    }
}

fn layers() -> Layers {
    let mut layers = Layers::new(&LayersPrior::default()).unwrap();
    layers.enclose(12.0, 38.0);
    layers.inject(
        0.0,
        &LayerVector::from([0.1, -0.05, 0.02, 0.08, -0.07, 0.03, 0.04, -0.09]),
    );
    layers
}

/// Hand-worked: level, heading east at 1.0 m/s over ground in 0.5 m/s to the east, 0.1 m/s² faster and faster. Of 60 N, 20 kg take
/// 2 N; 58 N are 14 n + 140 n² at n = 0.5956 m/s, whose slope is 1/(14 + 280 n). Upwards 2.4 N hold the vehicle down, and nothing is
/// left for the drag.
#[test]
fn by_hand() {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    state.velocity_p_mps = Vec3::new(1.0, 0.0, 0.0);
    let motion = motion_at(&state, [0.0; 3]);
    let water = WaterVector::from([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]);
    let motion = Motion {
        water: Some(CurrentAt::new(&water, None, 0.0)),
        ..motion
    };
    let change = MotionChange {
        acceleration_p_mps2: Vector3::new(0.1, 0.0, 0.0),
        ..steady()
    };
    let of = |axis| {
        let force = sample([60.0, 0.0, 2.4], 1e-3);
        effort(axis, &motion, &change, &model(), &force, &Vector3::zeros(), 1.1)
    };
    let surge = of(0);
    let n = (-14.0 + (14.0_f64 * 14.0 + 4.0 * 140.0 * 58.0).sqrt()) / 280.0;
    let slope = 1.0 / (14.0 + 280.0 * n);
    assert_eq!((surge.rows, surge.degrees), (1, 1));
    assert!((surge.residual[0] + 0.5).abs() < 1e-15);
    assert!((surge.noise[(0, 0)].sqrt() - 1.1 * slope * 1e-3).abs() < 1e-12);
    let further = surge.by_further.unwrap();
    let columns = [
        (FIRST_EFFORT + SPEED_SCALE, -n),
        (FIRST_EFFORT + SLIP, -1.0),
        (FIRST_EFFORT + INERTIA, 1.1 * slope * 20.0 * 0.1),
        (FIRST_WATER + CURRENT + 1, -1.0),
        (FIRST_EFFORT + SPEED_SCALE + 1, 0.0),
    ];
    for (k, expected) in columns {
        assert!((further[(0, k)] - expected).abs() < 1e-9, "{k}: {}", further[(0, k)]);
    }
    let heave = of(2).by_further.unwrap();
    // But for what the earth's rate takes.
    assert!(heave[(0, FIRST_EFFORT + SPEED_SCALE + 2)].abs() < 1e-4);
}

/// A steady turn in a steady current takes ω × M u alone, whatever the current: the velocity's components in platform axes change,
/// and nothing accelerates through the water.
#[test]
fn a_turn_in_a_current() {
    let (rate, u) = (Vector3::new(0.0, 0.0, 0.3), Vector3::new(1.0, 0.05, 0.0));
    for current in [[0.0, 0.0], [0.4, -0.3]] {
        let water = WaterVector::from([current[0], current[1], 0.0, 0.0, 0.0, 0.0]);
        let mut state = NavState::at_rest(0);
        state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, 0.7);
        let current_p = state
            .attitude_t_p
            .matrix()
            .tr_mul(&Vector3::new(current[0], current[1], 0.0));
        state.velocity_p_mps = (u + current_p).into();
        let motion = motion_at(&state, rate.into());
        let motion = Motion {
            water: Some(CurrentAt::new(&water, None, 0.0)),
            ..motion
        };
        let change = MotionChange {
            acceleration_p_mps2: -motion.rate_tp().cross(&current_p),
            ..steady()
        };
        let model = model();
        let drag =
            |axis: usize| u[axis] * (model.linear_drag_kgps[axis] + model.quadratic_drag_kgpm[axis] * u[axis].abs());
        let rotating = motion.rate_tp().cross(&u.component_mul(&Vector3::from(model.mass_kg)));
        for axis in 0..2 {
            let mut force = [0.0; 3];
            force[axis] = drag(axis) + rotating[axis];
            let row = effort(
                axis,
                &motion,
                &change,
                &model,
                &sample(force, 1.0),
                &Vector3::zeros(),
                1.0,
            );
            let speed = -row.by_further.unwrap()[(0, FIRST_EFFORT + SPEED_SCALE + axis)];
            assert!(
                (speed - u[axis]).abs() < 1e-12 && (row.residual[0] + u[axis]).abs() < 1e-12,
                "{axis}: {speed}"
            );
        }
    }
}

/// An axis without drag, and a filter without the current, have no row.
#[test]
fn no_row() {
    let (state, water) = example(5.0);
    let motion = motion_at(&state, [0.0; 3]);
    let of = |motion: &Motion<'_>, model: &EffortModel, axis| {
        effort(
            axis,
            motion,
            &steady(),
            model,
            &sample([1.0; 3], 1.0),
            &Vector3::zeros(),
            1.0,
        )
        .rows
    };
    let with_water = Motion {
        water: Some(CurrentAt::new(&water, None, 0.0)),
        ..motion
    };
    let mut surge = model();
    (surge.linear_drag_kgps, surge.quadratic_drag_kgpm) = ([14.0, 0.0, 0.0], [0.0; 3]);
    assert_eq!([0, 1, 2].map(|axis| of(&with_water, &surge, axis)), [1, 0, 0]);
    assert!(surge.is_given() && !EffortModel::default().is_given());
    assert_eq!(of(&motion, &surge, 0), 0);
}

/// H against central differences of a literal form when the estimate moves, also where the vehicle stands on end.
#[test]
fn the_row_is_the_derivative() {
    let (model, lever) = (model(), Vector3::new(-0.3, 0.1, 0.2));
    let force = sample([45.0, -20.0, 12.0], 1e-5);
    let scale = 1.07;
    // Any derivative of the acceleration will do.
    let by_state = SMatrix::<f64, 3, DIM>::from_fn(|i, j| 0.1 * ((3 * j + i) as f64).sin());
    let change = MotionChange {
        acceleration_p_mps2: Vector3::new(0.05, -0.02, 0.03),
        angular_acceleration_p_radps2: Vector3::new(0.01, 0.02, -0.03),
        velocity_by_state: by_state,
    };
    for pitch in [0.0, 12.0, -70.0, 89.9, -89.9, 90.0, -90.0] {
        let ((mut state, water), layers) = (example(pitch), layers());
        state.position_t_m = Vec3::new(40.0, -20.0, 22.0);
        let of_motion = motion_at(&state, RATE);
        let at = CurrentAt::new(&water, Some(&layers), of_motion.level.depth_m);
        let motion = Motion {
            water: Some(at),
            ..of_motion
        };
        for axis in 0..3 {
            let row = effort(axis, &motion, &change, &model, &force, &lever, scale);
            let further = row.by_further.as_deref().unwrap();
            // a n + s − u with n by Newton's steps on the drag law, written out axis by axis.
            let z = |error: &ErrorVector, by: &WaterVector, by_layer: &LayerVector, own: [f64; 3]| {
                let (mut state, mut water, mut layers) = (state, water, layers.clone());
                state.inject(error);
                inject(&mut water, error[ATTITUDE + 2], by);
                layers.inject(error[ATTITUDE + 2], by_layer);
                let motion = motion_at(&state, RATE);
                let current = CurrentAt::new(&water, Some(&layers), motion.level.depth_m).water;
                let rotation = state.attitude_t_p.matrix();
                let current_p = rotation.tr_mul(&Vector3::new(current[CURRENT], current[CURRENT + 1], 0.0));
                let rate = motion.rate_tp();
                let u = state.velocity_p_mps.0 + rate.cross(&lever) - current_p;
                let changes = change.acceleration_p_mps2
                    + by_state * error
                    + change.angular_acceleration_p_radps2.cross(&lever)
                    + rate.cross(&current_p);
                let momentum = Vector3::from_fn(|k, _| model.mass_kg[k] * u[k]);
                let left = force.force_p_n.0[axis]
                    - model.buoyancy_n.0 * rotation[(2, axis)]
                    - model.mass_kg[axis] * (1.0 + own[2]) * changes[axis]
                    - rate.cross(&momentum)[axis];
                let (d, q) = (model.linear_drag_kgps[axis], model.quadratic_drag_kgpm[axis]);
                let mut n = left.signum();
                for _ in 0..60 {
                    n -= (d * n + q * n * n.abs() - left) / (d + 2.0 * q * n.abs());
                }
                (scale + own[0]) * n + own[1] - u[axis]
            };
            let (none, zero, still, step) = (WaterVector::zeros(), ErrorVector::zeros(), LayerVector::zeros(), 1e-5);
            let check = |ahead: f64, behind: f64, expected: f64, name: &str, j: usize| {
                let slope = (behind - ahead) / (2.0 * step);
                assert!(
                    (slope - expected).abs() < 1e-7,
                    "pitch {pitch}, axis {axis}, {name} {j}: {slope}, {expected}"
                );
            };
            for j in 0..DIM {
                let error = ErrorVector::ith(j, step);
                let moved = |error| z(&error, &none, &still, [0.0; 3]);
                check(moved(error), moved(-error), row.jacobian[(0, j)], "state", j);
            }
            for j in 0..WATER {
                let by = WaterVector::ith(j, step);
                let moved = |by| z(&zero, &by, &still, [0.0; 3]);
                check(moved(by), moved(-by), further[(0, FIRST_WATER + j)], "water", j);
            }
            for j in 0..LAYER_STATES {
                let by = LayerVector::ith(j, step);
                let moved = |by| z(&zero, &none, &by, [0.0; 3]);
                check(moved(by), moved(-by), further[(0, FIRST_LAYERS + j)], "layer", j);
            }
            for (j, first) in [SPEED_SCALE, SLIP, INERTIA].into_iter().enumerate() {
                let own = |step: f64| std::array::from_fn(|k| if k == j { step } else { 0.0 });
                let moved = |step| z(&zero, &none, &still, own(step));
                check(
                    moved(step),
                    moved(-step),
                    further[(0, FIRST_EFFORT + first + axis)],
                    "own",
                    j,
                );
            }
        }
    }
}

/// A velocity over ground and the same current change no row, also in a turn, and no row turns the yaw but by the
/// earth's rate.
#[test]
fn what_it_leaves_open() {
    for pitch in [0.0, -40.0, 85.0] {
        let (state, water) = example(pitch);
        let motion = motion_at(&state, RATE);
        let motion = Motion {
            water: Some(CurrentAt::new(&water, None, motion.level.depth_m)),
            ..motion
        };
        let mut change = steady();
        change
            .velocity_by_state
            .fixed_view_mut::<3, 3>(0, VELOCITY)
            .copy_from(&-skew(&motion.rate_tp()));
        for axis in 0..3 {
            let force = sample([30.0, 5.0, -12.0], 1.0);
            let row = effort(
                axis,
                &motion,
                &change,
                &model(),
                &force,
                &Vector3::new(0.1, 0.0, -0.2),
                1.0,
            );
            let further = row.by_further.as_deref().unwrap();
            let rotation = state.attitude_t_p.matrix();
            for north_east in 0..2 {
                let by_velocity = rotation.tr_mul(&Vector3::ith(north_east, 1.0));
                let open = row.jacobian.fixed_view::<1, 3>(0, VELOCITY) * by_velocity;
                let sum = open[0] + further[(0, FIRST_WATER + CURRENT + north_east)];
                assert!(sum.abs() < 1e-14, "pitch {pitch}: {sum}");
            }
            assert!(row.jacobian[(0, ATTITUDE + 2)].abs() < 1e-4);
        }
    }
}

proptest! {
    /// The drag at the speed of a force is that force, at the ends of the ranges too; the slope is positive, and that of the law where
    /// the noise is small.
    #[test]
    fn the_drag_law_inverted(
        linear in prop_oneof![Just(0.0), 1e-6..1e4_f64],
        quadratic in prop_oneof![Just(0.0), 1e-6..1e4_f64],
        force in -1e6..1e6_f64,
        exponent in -3.0..6.0_f64,
    ) {
        prop_assume!(linear + quadratic > 0.0);
        let model = EffortModel {
            linear_drag_kgps: [linear; 3],
            quadratic_drag_kgpm: [quadratic; 3],
            ..EffortModel::default()
        };
        let n = model.speed_mps(0, force);
        let drag = linear * n + quadratic * n * n.abs();
        prop_assert!((drag - force).abs() <= 1e-9 * force.abs().max(1e-9));
        let slope = model.slope(0, force, 10_f64.powf(exponent));
        prop_assert!(slope.is_finite() && slope > 0.0);
        let law = 1.0 / (linear + 2.0 * quadratic * n.abs());
        if force.abs() > 1.0 {
            let near = model.slope(0, force, 1e-4 * force.abs());
            prop_assert!((near / law - 1.0).abs() < 1e-6, "{near} {law}");
        }
    }
}

/// Numbers that no vehicle has are named, and so are readings.
#[test]
fn models_and_readings_are_checked() {
    assert_eq!(model().require_usable(), Ok(()));
    type Change = fn(&mut EffortModel);
    let changes: [(&str, Change); 6] = [
        ("effort.slip_sd_mps", |model| model.slip_sd_mps = 0.0),
        ("effort.slip_sd_mps", |model| model.slip_sd_mps = 1e4),
        ("effort.mass_kg", |model| model.mass_kg[1] = 0.0),
        ("effort.mass_kg", |model| model.mass_kg[2] = 1e12),
        ("effort.buoyancy_n", |model| model.buoyancy_n = Signed(-1e12)),
        ("drag", |model| model.linear_drag_kgps[2] = 1e-9),
    ];
    for (field, change) in changes {
        let mut model = model();
        change(&mut model);
        let text = model.require_usable().unwrap_err().to_string();
        assert!(text.contains(field), "{text}");
    }
    assert_eq!(sample([1.0, -2.0, 0.0], 1.0).validate(), Ok(()));
    for (force, sd_n, field) in [
        ([f64::NAN, 0.0, 0.0], 1.0, "force_p_n"),
        ([0.0, 1e12, 0.0], 1.0, "force_p_n"),
        ([0.0; 3], 0.0, "sd_n"),
        ([0.0; 3], 1e12, "sd_n"),
    ] {
        let text = sample(force, sd_n).validate().unwrap_err().to_string();
        assert!(text.contains(field), "{text}");
    }
    let models = SensorModels {
        effort: EffortModel {
            noise_sd_n: 2.0,
            ..model()
        },
        ..SensorModels::default()
    };
    let read = EffortSample::of_row(9, &[Some(&[1.0, 2.0, 3.0])], &models).unwrap();
    assert_eq!((read.numbers(), read.sd_n, read.time_ns), (vec![1.0, 2.0, 3.0], 2.0, 9));
    assert_eq!(effort_axis(Sensor::EffortHeave), Some(2));
    assert_eq!(effort_axis(Sensor::Thrust), None);
}
