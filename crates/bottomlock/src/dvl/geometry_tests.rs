use super::*;

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
