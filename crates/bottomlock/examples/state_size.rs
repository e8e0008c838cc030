//! Memory of a run in progress, in bytes.

use std::mem::size_of;

use bottomlock::error_model::Interval;
use bottomlock::filter::Eskf;
use bottomlock::filter::options::Options;
use bottomlock::mechanisation::ImuSample;
use bottomlock::navigator::Navigator;
use bottomlock::simulation::monte_carlo_run::MonteCarloRun;
use bottomlock::state::NavState;

fn main() {
    let rows = [
        ("filter", size_of::<Eskf>()),
        ("  of it covariance: the lower triangle", 210 * 8),
        ("  of it interval since the last propagation", size_of::<Interval>()),
        ("  of it state", size_of::<NavState>()),
        ("  of it options", size_of::<Options>()),
        ("navigator around it", size_of::<Navigator>() - size_of::<Eskf>()),
        (
            "a run's sensors and handles, without the methods",
            size_of::<MonteCarloRun>(),
        ),
        (
            "256 samples drawn ahead, once for all methods of a run",
            257 * size_of::<ImuSample>(),
        ),
    ];
    for (what, bytes) in rows {
        println!("{what:55}{bytes:8}");
    }
}
