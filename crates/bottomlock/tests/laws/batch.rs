//! Batches: threads, chunks, segments and single events give the same results; perfect sensors return the truth.

use crate::common::*;
use bottomlock::Stop;
use bottomlock::aiding::registry::SensorModels;
use bottomlock::model::{ImuModel, InitialModel};
use bottomlock::simulation::batch::run_batch;
use bottomlock::simulation::closed_loop::{ClosedLoop, ClosedLoopSetup, TruthSegment, VehicleStart};
use bottomlock::simulation::truth::true_state;

/// A truth in segments, as in a closed loop, gives the results of the whole truth, bit for bit.
#[test]
fn segments_give_the_results_of_the_whole_truth() {
    let (turn, epochs, model, geometry) = (Turn::new(8, 0.05), Epochs::new(8), Model::table_2(), janus());
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            imu_sampling: sampling,
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
        let mut segments = ClosedLoop::new(&common, &departures, 2).unwrap();
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
            segments
                .advance(&vec![segment; whole.runs], &within(&epochs.samples), &Stop::new())
                .unwrap();
        }
        assert_eq!(bits(&run_batch(&whole, 1).unwrap()), bits(&segments.records()));
        let lost = segments.advance(&[], &[], &Stop::new()).unwrap_err();
        assert!(lost.to_string().contains("one per vehicle"), "{lost}");
    }
}

/// The results depend on the seed alone, not on threads or chunks, bit for bit.
#[test]
fn bits_do_not_depend_on_threads_or_chunks() {
    let (turn, epochs, model, options, geometry) = eight_seconds();
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
    assert_ne!(bits(&one), bits(&other), "another seed gives other results");
}

/// A navigator fed event by event, and read after each, gives the results of the batch, bit for bit.
#[test]
fn streaming_is_batch_bit_for_bit() {
    let (turn, epochs, model, options, geometry) = eight_seconds();
    let schedules = [epochs.schedule()];
    let whole = batch(&turn, &epochs, &schedules, &model, &options, &geometry);
    let records = run_batch(&whole, 1).unwrap();
    for (index, method) in METHODS.iter().enumerate() {
        let streams = draw(&turn, &epochs.schedule(), 2017, 7, 2).unwrap();
        let mut navigator = Navigator::new(streams.initial, geometry.clone(), method.aiding, &model, &options).unwrap();
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

fn perfect() -> Model {
    Model {
        imu: ImuModel::default(),
        initial: InitialModel::default(),
        sensors: SensorModels::default(),
        ..Model::table_2()
    }
}

/// Perfect sensors return the truth, for instantaneous and averaged IMU samples, with measurements between IMU samples.
#[test]
fn perfect_sensors_return_the_truth() {
    let (turn, epochs, assumed, geometry) = (Turn::new(60, 0.05), Epochs::new(60), Model::table_2(), janus());
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        let options = Options {
            imu_sampling: sampling,
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
