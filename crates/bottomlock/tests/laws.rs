//! Laws of runs: pieces and wholes, threads, streams, streaming = batch, perfect sensors.

// Helpers outside `#[test]` functions fail loudly too.
#![allow(clippy::unwrap_used)]

mod support;

use bottomlock::aiding::registry::SensorKind;
use bottomlock::dvl::geometry::{BeamMask, BeamSample};
use bottomlock::filter::options::Options;
use bottomlock::mechanisation::Sampling;
use bottomlock::model::*;
use bottomlock::navigator::NavigatorSet;
use bottomlock::navigator::events::{AttitudeSample, DepthSample, Event, GpsSample};
use bottomlock::navigator::{METHODS, Method};
use bottomlock::simulation::batch::{Batch, run_batch};
use bottomlock::simulation::closed_loop::{ClosedLoop, ClosedLoopSetup, TruthSegment, VehicleStart};
use bottomlock::simulation::schedule::Schedule;
use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams::simulate;
use bottomlock::simulation::truth::true_state;
use support::*;

/// The truth in pieces, as a vehicle that flies on its estimate hands it out, yields the bits of the whole.
#[test]
fn pieces_of_the_truth_yield_the_bits_of_the_whole() {
    let (turn, epochs, model, geometry) = (Turn::new(8, 0.05), Epochs::new(8), Model::table_2(), janus());
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            sampling,
            ..Options::default()
        };
        let schedules = [epochs.schedule()];
        let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
        let common = ClosedLoopSetup {
            geometry: &geometry,
            simulated: &model,
            assumed: &model,
            options: &options,
            seed: whole.seed,
            trajectory_key: whole.trajectory_key,
        };
        let truth = turn.truth();
        let departure = |run| VehicleStart {
            run,
            start: true_state(&truth, 0),
            methods: &METHODS,
        };
        let departures: Vec<_> = (0..whole.runs as u64).map(departure).collect();
        let mut pieces = ClosedLoop::new(&common, &departures, 2).unwrap();
        let ends = [0, 1, 7, 300, 301, 900, truth.time_ns.len() - 1];
        for pair in ends.windows(2) {
            let within = |times: &[i64]| -> Vec<i64> {
                let (first, last) = (truth.time_ns[pair[0]], truth.time_ns[pair[1]]);
                times.iter().copied().filter(|&t| t > first && t <= last).collect()
            };
            let (dvl, depth) = (within(&epochs.dvl), within(&epochs.depth));
            let (magnetometer, gps) = (within(&epochs.magnetometer), within(&epochs.gps));
            let skipped = epochs.dvl.iter().take_while(|&&t| t <= truth.time_ns[pair[0]]).count();
            let schedule = Schedule {
                dvl_time_ns: &dvl,
                beam_valid: &epochs.masks[skipped..skipped + dvl.len()],
                ..Schedule::default()
            }
            .with(SensorKind::Depth, &depth, &[])
            .with(SensorKind::Attitude, &magnetometer, &[])
            .with(SensorKind::Gps, &gps, &[]);
            let segment = TruthSegment {
                truth: truth.slice(pair[0]..pair[1] + 1),
                schedule,
            };
            pieces
                .advance(&vec![segment; whole.runs], &within(&epochs.samples))
                .unwrap();
        }
        assert_eq!(bits(&run_batch(&whole, 1).unwrap()), bits(&pieces.records()));
        let lost = pieces.advance(&[], &[]).unwrap_err();
        assert!(lost.to_string().contains("one per vehicle"), "{lost}");
    }
}

/// What the surroundings add moves the reading by just that, and no other stream.
#[test]
fn offsets_move_their_own_reading_alone() {
    let (turn, epochs, model, geometry) = (Turn::new(8, 0.05), Epochs::new(8), Model::table_2(), janus());
    let key = RunKey {
        seed: 1,
        trajectory: 2,
        run: 3,
    };
    let (depth, yaw) = (vec![0.5; epochs.depth.len()], vec![0.1; epochs.magnetometer.len()]);
    let off = epochs.schedule().with(SensorKind::Depth, &epochs.depth, &depth).with(
        SensorKind::Attitude,
        &epochs.magnetometer,
        &yaw,
    );
    let draw = |schedule: &Schedule<'_>| {
        let options = Options::default();
        simulate(&turn.truth(), &geometry, &model, &model, schedule, &options, &key)
    };
    let (ideal, moved) = (draw(&epochs.schedule()).unwrap(), draw(&off).unwrap());
    for (a, b) in ideal.of::<DepthSample>().zip(moved.of::<DepthSample>()) {
        assert!((b.depth_m - a.depth_m - 0.5).abs() < 1e-12);
    }
    for (a, b) in ideal.of::<AttitudeSample>().zip(moved.of::<AttitudeSample>()) {
        let [roll, pitch, turned] = b.attitude_t_p.to_euler_rad();
        let [roll_0, pitch_0, yaw_0] = a.attitude_t_p.to_euler_rad();
        let apart = [roll - roll_0, pitch - pitch_0, turned - yaw_0 - 0.1];
        assert!(apart.iter().all(|angle| angle.abs() < 1e-12), "{apart:?}");
    }
    assert!(
        ideal.imu == moved.imu
            && ideal.of::<GpsSample>().eq(moved.of::<GpsSample>())
            && ideal.scale_factor == moved.scale_factor
    );
    let short = epochs.schedule().with(SensorKind::Depth, &epochs.depth, &depth[1..]);
    assert!(draw(&short).unwrap_err().to_string().contains("depth_offset_m"));
}

/// Same seed, same bits: one thread, two threads, and any cutting into chunks.
#[test]
fn bits_do_not_depend_on_threads_or_chunks() {
    let (turn, epochs, model, options, geometry) = (
        Turn::new(8, 0.05),
        Epochs::new(8),
        Model::table_2(),
        Options::default(),
        janus(),
    );
    let schedules = [epochs.schedule()];
    let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
    let one = run_batch(&whole, 1).unwrap();
    assert_eq!(bits(&one), bits(&run_batch(&whole, 2).unwrap()));
    let mut chunks = run_batch(
        &Batch {
            first_run: 0,
            runs: 1,
            ..whole
        },
        2,
    )
    .unwrap();
    chunks.extend(
        run_batch(
            &Batch {
                first_run: 1,
                runs: 3,
                ..whole
            },
            1,
        )
        .unwrap(),
    );
    assert_eq!(bits(&one), bits(&chunks));
    let other = run_batch(&Batch { seed: 2018, ..whole }, 1).unwrap();
    assert_ne!(bits(&one), bits(&other), "the seed counts");
}

/// Switching a sensor off shifts no other stream, and a lost beam is drawn like the others.
#[test]
fn streams_are_independent() {
    let (turn, mut epochs, model, geometry) = (Turn::new(5, 0.05), Epochs::new(5), Model::table_2(), janus());
    let key = RunKey {
        seed: 1,
        trajectory: 2,
        run: 3,
    };
    let draw = |epochs: &Epochs| {
        simulate(
            &turn.truth(),
            &geometry,
            &model,
            &model,
            &epochs.schedule(),
            &Options::default(),
            &key,
        )
        .unwrap()
    };
    let all = draw(&epochs);
    epochs.depth.clear();
    epochs.masks = vec![BeamMask::NONE; epochs.dvl.len()];
    let fewer = draw(&epochs);
    assert_eq!(all.imu, fewer.imu);
    assert!(all.of::<AttitudeSample>().eq(fewer.of::<AttitudeSample>()));
    for (a, b) in all.pings.iter().zip(&fewer.pings) {
        assert_eq!(a.velocity_mps[..4], b.velocity_mps[..4]);
    }
}

/// A navigator fed a sample at a time, asked for its state and covariance all the while, gives the batch's bits.
#[test]
fn streaming_is_batch_bit_for_bit() {
    let (turn, epochs, model, options, geometry) = (
        Turn::new(8, 0.05),
        Epochs::new(8),
        Model::table_2(),
        Options::default(),
        janus(),
    );
    let schedules = [epochs.schedule()];
    let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
    let records = run_batch(&whole, 1).unwrap();
    for (index, method) in METHODS.iter().enumerate() {
        let key = RunKey {
            seed: 2017,
            trajectory: 7,
            run: 2,
        };
        let streams = simulate(
            &turn.truth(),
            &geometry,
            &model,
            &model,
            &epochs.schedule(),
            &Options::default(),
            &key,
        )
        .unwrap();
        let mut navigator = NavigatorSet::new(streams.initial, &geometry, method.aiding, &model, &options).unwrap();
        let mut events: Vec<Event> = streams.imu.iter().copied().map(Event::Imu).collect();
        let all = BeamMask::all(4);
        events.extend(streams.pings.iter().map(|p| {
            Event::Beams(BeamSample {
                valid: if method.all_beams { all } else { p.valid },
                ..*p
            })
        }));
        events.extend(streams.sensors.iter().flatten().copied().map(Event::Aiding));
        events.sort_by_key(Event::time_ns);
        let last_ns = turn.time_ns[turn.time_ns.len() - 1];
        for event in events.iter().filter(|event| event.time_ns() <= last_ns) {
            navigator.push(event, &mut |_| {}).unwrap();
            let _ = (navigator.state(), navigator.covariance());
        }
        let expected = records[2][index].sd.last().unwrap();
        let covariance = navigator.covariance();
        for k in 0..9 {
            assert_eq!(
                covariance[(k, k)].sqrt().to_bits(),
                expected[k].to_bits(),
                "{} state {k}",
                method.name
            );
        }
    }
}

/// Perfect sensors return the truth, for both meanings of an IMU sample, with aids at odd times splitting the steps.
#[test]
fn perfect_sensors_return_the_truth() {
    let (turn, epochs, assumed, geometry) = (Turn::new(60, 0.05), Epochs::new(60), Model::table_2(), janus());
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            sampling,
            ..Options::default()
        };
        let simulated = perfect();
        let methods = [Method::named("ins").unwrap(), Method::named("tc").unwrap()];
        let schedules = [epochs.schedule()];
        let whole = Batch {
            simulated: &simulated,
            methods: &methods,
            runs: 1,
            ..batch(&turn, &epochs, &schedules, &assumed, &options, &geometry)
        };
        for record in &run_batch(&whole, 1).unwrap()[0] {
            let last = record.error.last().unwrap();
            assert!(
                last[..3].iter().all(|e| e.abs() < 1e-3),
                "{sampling:?} position {last:?}"
            );
            assert!(
                last[3..6].iter().all(|e| e.abs() < 1e-6),
                "{sampling:?} attitude {last:?}"
            );
        }
    }
}
