//! Layers by hand, and as they move with the depth.

use proptest::prelude::*;

use super::*;

fn layers() -> Layers {
    Layers::new(&LayersPrior::default()).unwrap()
}

fn depths(layers: &Layers) -> Vec<f64> {
    layers.each().map(|layer| layer.depth_m).collect()
}

/// Layers with own parts of 1, 2, 3 and 4 m/s to the north, the uppermost first.
struct Counted {
    layers: Layers,
    own_mps: LayerVector,
}

impl Counted {
    fn at(&self, depth_m: f64) -> CurrentAt {
        self.layers.at(&WaterVector::zeros(), &self.own_mps, depth_m)
    }

    fn north(&self, depth_m: f64) -> (f64, f64) {
        let at = self.at(depth_m);
        (at.water[CURRENT], at.slope_n_per_s.x)
    }

    fn note(&mut self, depth_m: f64) {
        let at = self.at(depth_m);
        self.layers.note(&at);
    }

    /// Moves the layers, and the own parts as a filter does.
    fn enclose(&mut self, upper_m: f64, lower_m: f64) -> Vec<Anew> {
        let anew = self.layers.enclose(upper_m, lower_m);
        for one in &anew {
            for axis in 0..2 {
                self.own_mps[2 * one.place + axis] = one.factor * self.own_mps[2 * one.neighbour + axis];
            }
        }
        anew
    }
}

fn counted(upper_m: f64, lower_m: f64) -> Counted {
    let mut layers = layers();
    layers.enclose(upper_m, lower_m);
    let first = layers.first;
    let mut own_mps = LayerVector::zeros();
    for (number, value) in (first..).zip([1.0, 2.0, 3.0, 4.0]) {
        own_mps[2 * place_of(number)] = value;
    }
    Counted { layers, own_mps }
}

fn places(anew: &[Anew]) -> Vec<usize> {
    anew.iter().map(|one| one.place).collect()
}

#[test]
fn none_where_the_prior_has_none() {
    let none = LayersPrior {
        sd_mps: 0.0,
        ..LayersPrior::default()
    };
    assert_eq!((none.validate(), Layers::new(&none)), (Ok(()), None));
    let at = Water::common(&WaterVector::repeat(0.5)).at(100.0);
    assert_eq!((at.water, at.weights), (WaterVector::repeat(0.5), [0.0; LAYERS]));
    assert_eq!(at.parts(), vec![(block::WATER.first + CURRENT, 1.0)]);
}

/// Between layers the current is interpolated; above and below them it is that of the nearest.
#[test]
fn the_current_between_layers() {
    let layers = counted(12.0, 38.0);
    assert_eq!(depths(&layers.layers), vec![10.0, 20.0, 30.0, 40.0]);
    for (depth_m, expected) in [
        (10.0, (1.0, 0.1)),
        (12.5, (1.25, 0.1)),
        (29.0, (2.9, 0.1)),
        (40.0, (4.0, 0.1)),
        (50.0, (4.0, 0.0)),
        (-5.0, (1.0, 0.0)),
    ] {
        let found = layers.north(depth_m);
        assert!(
            (found.0 - expected.0).abs() < 1e-12 && (found.1 - expected.1).abs() < 1e-12,
            "{depth_m}: {found:?}"
        );
    }
}

/// Deeper by two layers: two begin anew, the others are kept; and the upper depth is enclosed where there is no room for both.
#[test]
fn layers_move_with_the_depth() {
    let mut layers = counted(12.0, 38.0);
    assert_eq!(places(&layers.enclose(31.0, 55.0)), vec![place_of(5), place_of(6)]);
    assert_eq!(depths(&layers.layers), vec![30.0, 40.0, 50.0, 60.0]);
    assert_eq!(
        (layers.north(30.0).0, layers.north(40.0).0, layers.north(55.0).0),
        (3.0, 4.0, 0.0)
    );
    assert_eq!(layers.enclose(31.0, 55.0), Vec::new());
    assert_eq!(layers.enclose(5.0, 500.0).len(), 3);
    assert_eq!(depths(&layers.layers), vec![0.0, 10.0, 20.0, 30.0]);
    assert_eq!(layers.enclose(1e6, 1e6).len(), LAYERS);
    assert_eq!(layers.enclose(f64::MAX, f64::MAX).len(), LAYERS);
    assert_eq!(layers.enclose(-1e300, -1e300).len(), LAYERS);
}

/// The layers of the first measurement are 10 to 40 m, σ² = 0.0016: two beyond them have 3 and 5 σ², and follow from the last, of
/// 4 m/s; back again, that last one keeps a third of its neighbour beyond; among themselves they are independent.
#[test]
fn beyond_the_first_layers_the_current_walks() {
    let mut layers = counted(12.0, 38.0);
    layers.note(25.0);
    let anew = layers.enclose(31.0, 55.0);
    let follows = |place: i64, neighbour: i64, factor: f64, variance: f64| Anew {
        place: place_of(place),
        neighbour: place_of(neighbour),
        factor,
        variance,
    };
    let same = |found: &[Anew], expected: &[Anew]| {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!((found.place, found.neighbour), (expected.place, expected.neighbour));
            assert!((found.factor - expected.factor).abs() < 1e-12, "{found:?}");
            assert!((found.variance - expected.variance).abs() < 1e-15, "{found:?}");
        }
    };
    let unit = 0.04 * 0.04;
    same(&anew, &[follows(5, 4, 1.0, 2.0 * unit), follows(6, 5, 1.0, 2.0 * unit)]);
    assert_eq!((layers.north(50.0).0, layers.north(60.0).0), (4.0, 4.0));
    let processes = layers.layers.processes(0.0);
    for (number, times) in [(3, 1.0), (4, 1.0), (5, 3.0), (6, 5.0)] {
        assert!((processes[2 * place_of(number)].variance - times * unit).abs() < 1e-15);
    }
    layers.enclose(71.0, 95.0);
    same(
        &layers.enclose(61.0, 85.0),
        &[follows(6, 7, 5.0 / 7.0, 5.0 * unit * (1.0 - 5.0 / 7.0))],
    );
    layers.enclose(51.0, 75.0);
    same(
        &layers.enclose(41.0, 65.0),
        &[follows(4, 5, 1.0 / 3.0, unit * (1.0 - 1.0 / 3.0))],
    );
    same(&layers.enclose(31.0, 55.0), &[follows(3, 4, 0.0, unit)]);
    // Far off nothing follows from what was.
    let far = layers.enclose(2010.0, 2015.0);
    assert_eq!((far.len(), far[0].factor), (4, 0.0));
    assert!(far[1..].iter().all(|one| one.factor == 1.0));
}

/// Half an hour leaves 1/e of what a layer has to itself, and so do 5 km; ages count from the last measurement.
#[test]
fn layers_age() {
    let mut layers = counted(12.0, 38.0);
    let e = std::f64::consts::E;
    let left = |speed_mps: f64, duration_s: f64| layers.layers.processes(speed_mps)[3].left(duration_s);
    assert!((left(0.0, 1800.0) * e - 1.0).abs() < 1e-12);
    assert!((left(5e6, 1e-3) * e - 1.0).abs() < 1e-6);
    layers.note(25.0);
    layers.layers.wait(60.0);
    let ages: Vec<f64> = layers.layers.each().map(|layer| layer.age_s).collect();
    assert_eq!(ages, vec![f64::INFINITY, 60.0, 60.0, f64::INFINITY]);
}

/// A quarter turn of the estimated north turns every layer.
#[test]
fn layers_turn_with_the_yaw() {
    let counted = counted(12.0, 38.0);
    let mut water = Water::common(&WaterVector::zeros()).with(&counted.layers, &counted.own_mps);
    water.inject(
        std::f64::consts::FRAC_PI_2,
        &WaterVector::zeros(),
        &LayerVector::zeros(),
    );
    let at = water.at(30.0);
    assert!((at.water[CURRENT + 1] - 3.0).abs() < 1e-12 && at.water[CURRENT].abs() < 1e-12);
}

proptest! {
    /// However the layers move, each keeps the variance of its depth while nothing is measured, and they stay jointly possible.
    #[test]
    fn moves_keep_the_variance_of_each_depth(moves in prop::collection::vec((-300.0..300.0_f64, 0.0..35.0_f64), 1..20)) {
        let mut layers = counted(0.0, 5.0);
        layers.note(3.0);
        let mut covariance = nalgebra::DMatrix::from_diagonal_element(LAYERS, LAYERS, 0.04 * 0.04);
        for (upper_m, span_m) in moves {
            for one in layers.enclose(upper_m, upper_m + span_m) {
                let mut map = nalgebra::DMatrix::identity(LAYERS, LAYERS);
                let followed = map.row(one.neighbour) * one.factor;
                map.set_row(one.place, &followed);
                covariance = &map * covariance * map.transpose();
                covariance[(one.place, one.place)] += one.variance;
            }
            let expected = layers.layers.processes(0.0);
            for place in 0..LAYERS {
                prop_assert!((covariance[(place, place)] / expected[2 * place].variance - 1.0).abs() < 1e-9);
            }
            prop_assert!(covariance.clone().symmetric_eigenvalues().min() > 0.0);
        }
    }

    /// Both depths lie between layers wherever there is room, weights add up to one, and what is kept is kept.
    #[test]
    fn encloses_what_it_can(moves in prop::collection::vec((-300.0..300.0_f64, 0.0..35.0_f64), 1..20)) {
        let mut layers = counted(0.0, 5.0);
        for (upper_m, span_m) in moves {
            let before = layers.own_mps;
            let lower_m = upper_m + span_m;
            let anew = places(&layers.enclose(upper_m, lower_m));
            let (first, last) = (depths(&layers.layers)[0], depths(&layers.layers)[LAYERS - 1]);
            prop_assert!(first <= upper_m.max(0.0) && upper_m <= last);
            if span_m <= 20.0 {
                prop_assert!(lower_m <= last);
            }
            let weights = layers.at(upper_m).weights;
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && weights.iter().all(|&w| w >= 0.0));
            for place in (0..LAYERS).filter(|place| !anew.contains(place)) {
                prop_assert_eq!(layers.own_mps[2 * place], before[2 * place]);
            }
        }
    }
}
