//! Late measurements: back to the checkpoint before it, then every event after that checkpoint again, in the order of a log.
//!
//! The replay makes the very calls that an ordered log makes, so it ends in the same bits. It works on a copy: where it fails,
//! nothing has changed.

use std::sync::Arc;

use super::checked::Checked;
use super::history::{History, due_after};
use super::imu_check::Judged;
use super::notice::{Finding, Notice, Standing};
use crate::error::NavError;
use crate::navigator::events::Event;

/// What a replay ends in.
pub(super) struct Replayed {
    /// The navigator after all events.
    pub(super) now: Checked,
    checkpoints: Vec<Arc<Checked>>,
    found: Vec<Finding>,
    /// Times of the last good and of the last inertial reading before the replay.
    from_ns: (Option<i64>, Option<i64>),
    /// Number of the checkpoint at or before it.
    after: usize,
}

impl History {
    /// Feeds a copy of a navigator with the events from the place `first` on that it has not been fed; `after` is the
    /// number of the checkpoint that it is, or that it comes after.
    ///
    /// # Errors
    /// As [`Checked::take`] and [`Checked::judge`].
    pub(super) fn replay(&self, from: &Checked, after: usize, first: usize) -> Result<Replayed, NavError> {
        let from_ns = (from.good_ns(), from.seen_ns());
        let (mut now, mut checkpoints, mut found) = (from.clone(), Vec::new(), Vec::new());
        let mut due_ns = due_after(&self.checkpoints[after]);
        // The next event, and the first measurement that waits for a good reading.
        let (mut next, mut unfed) = (first, first);
        let mut run = Vec::new();
        while let Some(event) = self.events.get(next) {
            next += 1;
            let Event::Imu(sample) = event else {
                if Some(event.time_ns()) == now.good_ns() {
                    now.aid(event, &mut found)?;
                    unfed = next;
                }
                continue;
            };
            if Some(sample.time_ns) <= from_ns.1 {
                continue;
            }
            now.navigator.require_plausible_motion()?;
            let is_plain = unfed + 1 == next && now.is_plain(sample);
            let judged = if is_plain {
                Judged::Good(None)
            } else {
                now.judge(sample)?
            };
            let is_good = matches!(judged, Judged::Good(_));
            if is_good && now.now_ns() >= due_ns {
                checkpoints.push(Arc::new(now.clone()));
                due_ns = due_after(&now);
            }
            if is_plain {
                next += now.take_plain_run(sample, self.events.range(next..), due_ns, &mut run)?;
            } else {
                let waiting = self.events.range(unfed..next - 1);
                let measurements = waiting.filter(|event| !matches!(event, Event::Imu(_)));
                now.take(sample, &judged, measurements, &mut found)?;
            }
            if is_good {
                unfed = next;
            }
        }
        Ok(Replayed {
            now,
            checkpoints,
            found,
            from_ns,
            after,
        })
    }

    /// Keeps the checkpoints of a replay from the last one kept, and reports what differs from what was reported before, in the
    /// order of the replay.
    pub(super) fn settle(&mut self, replayed: Replayed, tell: &mut dyn FnMut(&Notice)) -> Checked {
        let Replayed {
            now,
            checkpoints,
            found,
            from_ns: (good_ns, seen_ns),
            after,
        } = replayed;
        self.return_to(after);
        checkpoints.into_iter().for_each(|checkpoint| self.keep(checkpoint));
        let first_ns = good_ns.map_or(i64::MIN, |good_ns| good_ns.saturating_add(1));
        let mut before = self.findings.split_off(&(first_ns, None));
        let is_replayed =
            |finding: &Finding| !matches!(finding, Finding::Rejected { time_ns, .. } if Some(*time_ns) <= seen_ns);
        for finding in found {
            let standing = match before.remove(&finding.key()) {
                None => Some(Standing::New),
                Some(reported) if reported.is_same(&finding) => None,
                Some(_) => Some(Standing::Revised),
            };
            let finding = match standing {
                Some(standing) => report_as(standing, finding, tell),
                None => finding,
            };
            self.findings.insert(finding.key(), finding);
        }
        let earlier = before.into_iter().filter(|(_, finding)| !is_replayed(finding));
        self.findings.extend(earlier);
        self.forget(&now);
        now
    }

    /// Reports findings of which nothing was reported before.
    pub(super) fn tell_new(&mut self, found: Vec<Finding>, tell: &mut dyn FnMut(&Notice)) {
        for finding in found {
            let finding = report_as(Standing::New, finding, tell);
            self.findings.insert(finding.key(), finding);
        }
    }
}

/// Tells a finding, and gives it back.
fn report_as(standing: Standing, finding: Finding, tell: &mut dyn FnMut(&Notice)) -> Finding {
    let notice = Notice { finding, standing };
    tell(&notice);
    notice.finding
}
