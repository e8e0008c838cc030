use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::saved::CONTENT_AT;
use crate::testing::*;

/// A navigator at rest on the equator, where no number needs a sine, with a ping and a depth that wait.
fn waiting(method: usize) -> Snapshot {
    let mut model = Model::table_2();
    model.environment = crate::earth::Environment {
        latitude_rad: 0.0,
        gravity_mps2: 9.78,
        earth_rate_radps: 7.25e-5,
        earth: crate::earth::EarthModel::TangentPlane,
    };
    model.sensors.depth.bias_sd_m = 0.25;
    let direction = |x, y, z| Vec3::new(x, y, z);
    let beams = [
        direction(1.0, 0.0, 0.0),
        direction(0.0, 1.0, 0.0),
        direction(0.0, 0.0, 1.0),
    ];
    let geometry = BeamGeometry::from_directions(&beams).unwrap();
    let initial = NavState::at_rest(0);
    let (aiding, options) = (METHODS[method].aiding, Options::default());
    let mut live = LiveNavigator::new(initial, &geometry, aiding, &model, &options, 2_000_000_000).unwrap();
    let ping = ping_of(7, [0.25; MAX_BEAMS], 0.5, BeamMask::all(2));
    let depth = DepthSample {
        time_ns: 5,
        depth_m: 0.125,
        sd_m: 0.5,
    };
    for event in [Event::Beams(ping), depth.into()] {
        live.push(&event, &mut |_| {}).unwrap();
    }
    let sensors = model.sensors;
    Snapshot { live, sensors }
}

/// The same, some readings later.
fn under_way(method: usize) -> Snapshot {
    let mut snapshot = waiting(method);
    for k in 0..25 {
        let reading = imu(k * 10_000_000, [0.01, -0.02, 0.03], [0.1, 0.2, -9.78]);
        snapshot.live.push(&Event::Imu(reading), &mut |_| {}).unwrap();
    }
    snapshot
}

/// What was saved is what is restored, byte for byte.
#[test]
fn restored_bytes_are_those_saved() {
    for method in 0..METHODS.len() {
        for snapshot in [waiting(method), under_way(method)] {
            let bytes = snapshot.to_bytes().unwrap();
            assert_eq!(Snapshot::from_bytes(&bytes).unwrap().to_bytes().unwrap(), bytes);
        }
    }
}

/// Bytes of another layout must have another format: where this test fails, raise `saved::FORMAT`, then put the new length and
/// sum here.
#[test]
fn the_layout_is_that_of_the_format() {
    let bytes = waiting(METHODS.len() - 1).to_bytes().unwrap();
    let sum: u64 = bytes[CONTENT_AT..]
        .iter()
        .zip(1..)
        .map(|(&byte, k)| u64::from(byte) * k)
        .sum();
    assert_eq!((crate::saved::FORMAT, bytes.len(), sum), (30, 14_212, 1_219_135_171));
}

/// Each fault of the frame has its words.
#[test]
fn faults_of_the_frame_are_named() {
    let bytes = waiting(2).to_bytes().unwrap();
    let words = |bytes: &[u8]| Snapshot::from_bytes(bytes).unwrap_err().to_string();
    assert!(words(b"PAR1").contains("the bytes begin otherwise"));
    assert!(words(&bytes[..20]).contains("20 bytes are too few"));
    assert!(words(&bytes[..bytes.len() - 1]).contains("damaged or were cut short"));
    let mut other = bytes.clone();
    other[8] = 77;
    assert!(words(&other).contains("format 77, expected 30"), "{}", words(&other));
    let longer = NAVIGATOR.frame(&[&bytes[CONTENT_AT..], &[0]].concat());
    assert!(words(&longer).contains("another layout"));
    let janus = BeamGeometry::janus(Janus::X, 0.5).unwrap().to_bytes().unwrap();
    assert!(words(&janus).contains("navigator not restored"));
}

/// Even bytes whose digest was made anew give no navigator that holds a NaN, and no panic.
#[test]
fn no_bytes_give_a_navigator_with_nan() {
    let count = if std::env::var_os("BOTTOMLOCK_LONG").is_some() {
        300_000
    } else {
        10_000
    };
    let mut random = ChaCha8Rng::seed_from_u64(15);
    let contents: Vec<Vec<u8>> = [0, 2, 3, 10]
        .into_iter()
        .flat_map(|method| [waiting(method), under_way(method)])
        .map(|snapshot| snapshot.to_bytes().unwrap()[CONTENT_AT..].to_vec())
        .collect();
    let mut restored = 0;
    for _ in 0..count {
        let mut content = contents[random.random_range(0..contents.len())].clone();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..content.len());
            match random.random_range(0..6) {
                0 => content.truncate(at.max(1)),
                1 => content.insert(at, random.random()),
                // The exponents of infinities and NaN.
                2 => content[at..].iter_mut().take(8).for_each(|byte| *byte = 0xff),
                _ => content[at] = random.random(),
            }
        }
        if let Ok(snapshot) = Snapshot::from_bytes(&NAVIGATOR.frame(&content)) {
            restored += 1;
            let set = snapshot.live.navigator();
            assert_eq!(set.state().validate(), Ok(()));
            assert!(set.covariance().iter().all(|number| number.is_finite()));
        }
    }
    assert!(
        restored > count / 20,
        "{restored} of {count} restored: the mutants test nothing"
    );
}
