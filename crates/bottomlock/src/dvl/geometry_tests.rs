use super::*;
use crate::testing::assert_refused;

/// Eqs. 13 and 14 by hand: beam 2 of the x-Janus points aft and right.
#[test]
fn second_beam_of_the_x_janus() {
    let tilt = 20_f64.to_radians();
    let geometry = BeamGeometry::janus(Janus::X, tilt).unwrap();
    let side = tilt.sin() / 2_f64.sqrt();
    assert!((geometry.direction_p(1) - Vector3::new(-side, side, tilt.cos())).norm() < 1e-15);
}

/// Eq. 15 by hand: with a lever arm ahead a yaw rate moves the transducer to starboard.
#[test]
fn lever_arm_adds_the_yaw_rate() {
    let geometry = BeamGeometry::from_directions(&[Vec3::new(0.0, 1.0, 0.0)])
        .and_then(|g| g.with_lever_arms(&[Vec3::new(1.5, 0.0, 0.0)]))
        .unwrap();
    let motion = BeamMotion {
        velocity_p_mps: Vector3::new(2.0, 0.1, 0.0),
        omega_tp_p_radps: Vector3::new(0.0, 0.0, 0.2),
        beam_bias_mps: [0.01, 0.0, 0.0, 0.0],
        scale_factor: 0.5,
    };
    assert!((geometry.beam_velocity_mps(0, &motion) - (0.15 + 0.3 + 0.01)).abs() < 1e-15);
}

/// Three beams in one plane determine two directions.
#[test]
fn rank_counts_directions() {
    let tilt = 0.4;
    assert_eq!(BeamGeometry::janus(Janus::X, tilt).unwrap().rank(), 3);
    let flat = BeamGeometry::from_angles(&[tilt, 0.0, -tilt], &[0.3; 3]).unwrap();
    assert_eq!(flat.rank(), 2);
}

/// A direction that is not a unit vector is rejected with its beam number.
#[test]
fn a_direction_of_norm_two_is_rejected() {
    let result = BeamGeometry::from_directions(&[Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, 0.0, 2.0)]);
    assert_eq!(result, Err(NavError::NotUnit { beam: 2, norm: 2.0 }));
    assert!(BeamGeometry::from_directions(&[Vec3::new(f64::NAN, 0.0, 1.0)]).is_err());
    assert!(BeamGeometry::from_directions(&[]).is_err());
}

/// A mask is a set of beam indices below the largest number of beams.
#[test]
fn a_mask_is_a_set_of_beams() {
    let mask: BeamMask = [0, 2, 9].into_iter().collect();
    assert_eq!(mask.iter().collect::<Vec<_>>(), vec![0, 2]);
    assert_eq!(BeamMask::all(4).count(), 4);
    assert!(!mask.contains(100));
}

/// Beams in both, and a beam named twice is one.
#[test]
fn masks_by_hand() {
    let of = |beams: &[usize]| -> BeamMask { beams.iter().copied().collect() };
    assert_eq!(of(&[0, 1, 3]).and(of(&[1, 2, 3])), of(&[1, 3]));
    assert_eq!(of(&[2, 2]), of(&[2]));
    assert_eq!(of(&[7, MAX_BEAMS]), of(&[7]));
    assert!(of(&[0, 7]).contains(7) && !of(&[0, 7]).contains(MAX_BEAMS));
}

/// Eight beams are the most.
#[test]
fn as_many_beams_as_there_are_slots() {
    let beams = |count| BeamGeometry::from_directions(&vec![Vec3::new(0.0, 0.0, 1.0); count]);
    assert_eq!(beams(MAX_BEAMS).unwrap().beams(), MAX_BEAMS);
    let text = beams(MAX_BEAMS + 1).unwrap_err().to_string();
    assert!(text.contains("1 to 8"), "{text}");
}

/// Bytes restore a geometry; one that could not be made is not restored.
#[test]
fn bytes_restore_a_geometry() {
    let geometry = BeamGeometry::janus(Janus::Plus, 0.4)
        .and_then(|geometry| geometry.with_sound_speed_scale(1.02))
        .unwrap();
    assert_eq!(geometry.sound_speed_scale(), 1.02);
    assert_eq!(
        BeamGeometry::from_bytes(&geometry.to_bytes().unwrap()),
        Ok(geometry.clone())
    );
    let faults: [fn(&mut BeamGeometry); 4] = [
        |geometry| geometry.sound_speed_scale = -1.0,
        |geometry| geometry.directions_p[3] *= 2.0,
        |geometry| geometry.lever_arms_p_m.truncate(2),
        |geometry| geometry.lever_arms_p_m[0].z = f64::NAN,
    ];
    for change in faults {
        let mut broken = geometry.clone();
        change(&mut broken);
        assert!(
            BeamGeometry::from_bytes(&broken.to_bytes().unwrap()).is_err(),
            "{broken:?}"
        );
    }
}

/// A motion with a number that is not finite is refused and the number named.
#[test]
fn motions_are_finite() {
    let good = BeamMotion {
        velocity_p_mps: Vector3::new(1.0, 2.0, 3.0),
        omega_tp_p_radps: Vector3::zeros(),
        beam_bias_mps: [0.0; 4],
        scale_factor: 0.0,
    };
    type Fault = (&'static str, fn(&mut BeamMotion));
    let faults: [Fault; 4] = [
        ("velocity_p_mps", |motion| motion.velocity_p_mps.y = f64::NAN),
        ("omega_tp_p_radps", |motion| motion.omega_tp_p_radps.z = f64::INFINITY),
        ("beam_bias_mps", |motion| motion.beam_bias_mps[3] = f64::NAN),
        ("scale_factor", |motion| motion.scale_factor = f64::NAN),
    ];
    assert_refused(&good, BeamMotion::validate, &faults);
}

/// A ping's fault names the beam, counted from 1, the number and what was expected; beams that are flagged may hold anything.
#[test]
fn faults_of_a_ping() {
    let geometry = BeamGeometry::janus(Janus::X, 0.4).unwrap();
    let good = BeamSample {
        time_ns: 3,
        velocity_mps: [f64::NAN, 49.9, -MAX_BEAM_SPEED_MPS, 0.0, 0.0, 0.0, 0.0, 0.0],
        sd_mps: [f64::NAN, 0.1, 0.1, 1e-9, 0.0, 0.0, 0.0, 0.0],
        valid: [1, 2, 3].into_iter().collect(),
    };
    assert_eq!(good.validate(&geometry), Ok(()));
    type Fault = (usize, &'static str, f64, &'static str, fn(&mut BeamSample));
    let faults: [Fault; 6] = [
        (5, "number", 5.0, BEAM_EXISTS, |ping| {
            ping.valid = [1, 4].into_iter().collect()
        }),
        (2, "velocity", LARGEST, "flag a lost beam", |ping| {
            ping.velocity_mps[1] = LARGEST
        }),
        (2, "velocity", 50.1, SLOW_ENOUGH, |ping| ping.velocity_mps[1] = 50.1),
        (4, "standard deviation", 0.0, "finite number > 0", |ping| {
            ping.sd_mps[3] = 0.0
        }),
        (4, "standard deviation", -0.1, "finite number > 0", |ping| {
            ping.sd_mps[3] = -0.1
        }),
        (4, "standard deviation", LARGEST, "finite number > 0", |ping| {
            ping.sd_mps[3] = LARGEST
        }),
    ];
    for (number, of, wrong, words, change) in faults {
        let mut ping = good;
        change(&mut ping);
        let Err(NavError::BadBeam {
            beam,
            time_ns,
            field,
            value,
            expected,
        }) = ping.validate(&geometry)
        else {
            panic!("{of} {wrong} passes");
        };
        assert_eq!((beam, time_ns, field, value), (number, 3, of, wrong));
        assert!(expected.contains(words), "{expected} has no {words}");
    }
}
