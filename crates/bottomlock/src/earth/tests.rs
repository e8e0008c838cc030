//! Places on the ellipsoid against geodetic coordinates, and every derivative by differences.

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::frames::{Tangent, Vec3};

const LATITUDES_DEG: [f64; 6] = [0.0, 45.0, -45.0, 70.0, 85.0, -89.0];

fn at(latitude_deg: f64) -> Environment {
    Environment::normal(latitude_deg.to_radians(), 0.0).on(EarthModel::Ellipsoid)
}

/// Earth-fixed position of geodetic coordinates (Groves 2013, Eq. 2.112).
fn earth_fixed(latitude: f64, longitude: f64, height_m: f64) -> Vector3<f64> {
    let transverse = SEMI_MAJOR_AXIS_M / (1.0 - ECCENTRICITY_SQUARED * latitude.sin().powi(2)).sqrt();
    let level = (transverse + height_m) * latitude.cos();
    Vector3::new(
        level * longitude.cos(),
        level * longitude.sin(),
        (transverse * (1.0 - ECCENTRICITY_SQUARED) + height_m) * latitude.sin(),
    )
}

/// North, east and down as rows, in Earth-fixed axes (Groves 2013, Eq. 2.150).
fn axes(latitude: f64, longitude: f64) -> Matrix3<f64> {
    let ((s, c), (sl, cl)) = (latitude.sin_cos(), longitude.sin_cos());
    Matrix3::new(-s * cl, -s * sl, c, -sl, cl, 0.0, -c * cl, -c * sl, -s)
}

/// Places up to 100 km away, from the deepest sea to 9 km up, by the forward formulas: depth, north, east, down and gravity.
#[test]
fn places_have_the_coordinates_that_made_them() {
    for degrees in LATITUDES_DEG {
        let (origin, environment) = (degrees.to_radians(), at(degrees));
        let earth = Earth::from(&environment);
        for (k, height_m) in [0.0, -11_000.0, 9_000.0, -4_000.0, 30.0].into_iter().enumerate() {
            let (latitude, longitude) = (origin - 0.003 * k as f64 * degrees.signum(), 0.008 * (k as f64 - 1.0));
            let position =
                axes(origin, 0.0) * (earth_fixed(latitude, longitude, height_m) - earth_fixed(origin, 0.0, 0.0));
            let position_t_m = Vec3::<Tangent>::from(position);
            let level = earth.level(&position_t_m);
            assert!(
                (level.depth_m + height_m).abs() < 1e-8,
                "{degrees} {k}: {}",
                level.depth_m
            );
            let expected = axes(origin, 0.0) * axes(latitude, longitude).transpose();
            let allowed = 1e-10 / latitude.cos();
            assert!((level.rotation_t_n - expected).amax() < allowed, "{degrees} {k}");
            let gravity = earth.gravity_t_mps2(&position_t_m);
            let size = normal_gravity_mps2(latitude, -height_m);
            assert!((gravity - expected.column(2) * size).norm() < 1e-9, "{degrees} {k}");
        }
    }
}

/// At the origin level axes and gravity are those of the tangent frame, and stated gravity holds there.
#[test]
fn the_origin_is_as_on_the_plane() {
    let mut environment = at(45.0);
    environment.gravity_mps2 += 3e-4;
    let earth = Earth::from(&environment);
    let level = earth.level(&Vec3::zeros());
    assert!((level.rotation_t_n - Matrix3::identity()).amax() < 1e-15 && level.depth_m.abs() < 2e-9);
    let gravity = earth.gravity_t_mps2(&Vec3::zeros());
    assert!((gravity - Vector3::new(0.0, 0.0, environment.gravity_mps2)).norm() < 1e-14);
}

/// Hand-worked: 10 km from the equator along it the surface is s²/2a = 7.839 m below the plane, level is tilted by s/a = 1.56785 mrad,
/// and there is no convergence of the meridians; at 45° north it is s tan φ/N = 1.5654 mrad.
#[test]
fn ten_kilometres_east_by_hand() {
    let earth = Earth::from(&at(0.0));
    let level = earth.level(&Vec3::new(0.0, 10_000.0, 0.0));
    assert!((level.depth_m + 7.8393).abs() < 1e-4, "{}", level.depth_m);
    assert!((level.down_t().y + 1.567_85e-3).abs() < 1e-8);
    let north = |earth: &Earth| {
        earth
            .level(&Vec3::new(0.0, 10_000.0, 0.0))
            .rotation_t_n
            .column(0)
            .into_owned()
    };
    assert!(north(&earth).y.abs() < 1e-15);
    let convergence = north(&Earth::from(&at(45.0))).y;
    assert!((convergence + 1.5652e-3).abs() < 1e-6, "{convergence}");
}

/// ∂g/∂p, ∂d/∂p = D and the rotation of the level axes by central differences.
#[test]
fn derivatives_are_those_of_differences() {
    for degrees in LATITUDES_DEG {
        let earth = Earth::from(&at(degrees));
        let place = Vector3::new(-30e3, 40e3, 1_500.0);
        let (terms, level) = (earth.terms(place.into()), earth.level(&place.into()));
        let gradient = Matrix3::from(terms.gradient_t.unwrap()).transpose();
        for axis in 0..3 {
            let step = Vector3::from_fn(|k, _| if k == axis { 50.0 } else { 0.0 });
            let (ahead, behind): (Vec3<Tangent>, Vec3<Tangent>) = ((place + step).into(), (place - step).into());
            let slope = (earth.gravity_t_mps2(&ahead) - earth.gravity_t_mps2(&behind)) / 100.0;
            assert!(
                (slope - gradient.column(axis)).amax() < 2e-12,
                "{degrees} {axis}: {slope}"
            );
            let depth = (earth.level(&ahead).depth_m - earth.level(&behind).depth_m) / 100.0;
            assert!((depth - level.down_t()[axis]).abs() < 1e-9);
            let turned = earth.level(&ahead).rotation_t_n * earth.level(&behind).rotation_t_n.transpose();
            // Small enough for its sine to be the angle.
            let twice = turned - turned.transpose();
            let turn = Vector3::new(twice[(2, 1)], twice[(0, 2)], twice[(1, 0)]) / 200.0;
            assert!(
                (turn - level.turn_t.column(axis)).amax() < 1e-6 * level.turn_t.amax(),
                "{degrees} {axis}"
            );
        }
    }
}

/// At the pole itself gravity, its gradient and depth are finite and symmetric about it.
#[test]
fn gravity_is_regular_at_the_pole() {
    let earth = Earth::from(&at(90.0));
    let terms = earth.terms([0.0, 0.0, 0.0]);
    let gradient = Matrix3::from(terms.gradient_t.unwrap());
    assert!((gradient[(0, 0)] / gradient[(1, 1)] - 1.0).abs() < 1e-9 && gradient[(0, 1)].abs() < 1e-15);
    for position in [[2e4, 0.0, 0.0], [0.0, -2e4, 0.0]] {
        let gravity = Vector3::from(earth.terms(position).gravity_t);
        assert!((gravity.norm() - 9.832_184_9).abs() < 1e-4 && gravity.z > 9.83);
        assert!((gravity.xy().norm() - 9.83 * 2e4 / 6.4e6).abs() < 1e-3);
    }
}

/// A plane, and specific forces without gravity, have no gradient; without gravity down is still that of the place.
#[test]
fn plane_and_weightlessness() {
    let plane = Earth::from(&at(45.0).on(EarthModel::TangentPlane));
    let far = Vec3::new(4e4, 3e4, 20.0);
    assert_eq!(plane.level(&far), LocalLevel::of_plane(&far));
    assert!(plane.terms(far.to_array()).gradient_t.is_none());
    let weightless = Earth::from(&Environment {
        gravity_mps2: 0.0,
        ..at(45.0)
    });
    let terms = weightless.terms(far.to_array());
    assert!(terms.gradient_t.is_none() && terms.gravity_t == [0.0; 3]);
    assert!((weightless.level(&far).depth_m + 176.0).abs() < 2.0);
}
