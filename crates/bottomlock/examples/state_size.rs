//! What a run in flight holds, in bytes.

use std::mem::size_of;

use bottomlock::bank::Guide;
use bottomlock::error_model::Interval;
use bottomlock::filter::Eskf;
use bottomlock::imu::ImuSample;
use bottomlock::model::Options;
use bottomlock::run::Navigator;
use bottomlock::state::NavState;
use bottomlock::voyage::Voyage;

fn main() {
    let rows = [
        ("filter", size_of::<Eskf>()),
        ("  of it covariance: the lower triangle", 210 * 8),
        ("  of it interval since the last propagation", size_of::<Interval>()),
        ("  of it state", size_of::<NavState>()),
        ("  of it options", size_of::<Options>()),
        ("navigator around it", size_of::<Navigator>() - size_of::<Eskf>()),
        ("arm's handle", size_of::<Guide>()),
        ("a run's sensors and handles, without the arms", size_of::<Voyage>()),
        (
            "256 samples drawn ahead, once for all arms of a run",
            257 * size_of::<ImuSample>(),
        ),
    ];
    for (what, bytes) in rows {
        println!("{what:55}{bytes:8}");
    }
}
