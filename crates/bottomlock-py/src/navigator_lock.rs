//! The whole state of a navigator, and what is pushed into it.

use bottomlock::navigator::events::Event;
use bottomlock::navigator::{LiveNavigator, Navigator as Filters, Snapshot};

use super::Navigator;
use crate::prelude::*;
use crate::report::Report;
use crate::shared::Shared;

const BROKEN: &str = "this navigator has met an internal error before: start a new one, or load a saved one";

/// Horizon without a statement, ns: longer than the latency of a DVL or of a serial line.
const HORIZON_NS: i64 = 2_000_000_000;

/// The horizon of an argument, ns; the default for `None`.
pub(super) fn horizon(value: Option<Argument>) -> PyResult<i64> {
    let Some(value) = value else {
        return Ok(HORIZON_NS);
    };
    value.extract().map_err(|_| {
        let given = value
            .repr()
            .map_or_else(|_| "something else".into(), |text| text.to_string());
        invalid(format!(
            "horizon_ns is {given}, expected a whole number of nanoseconds, 0 to 10000000000 (ten seconds)"
        ))
    })
}

impl Navigator {
    pub(super) fn of(snapshot: Snapshot) -> Self {
        Self {
            beams: snapshot.live.navigator().geometry().beams(),
            inner: Shared::new(snapshot.live, BROKEN),
            sensors: snapshot.sensors,
        }
    }

    /// Calls the navigator, when no other thread does.
    pub(super) fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut LiveNavigator) -> T + Send,
    ) -> PyResult<T> {
        self.inner.with(py, |inner| Ok(work(inner)))
    }

    pub(super) fn snapshot(&self, py: Python<'_>) -> PyResult<Snapshot> {
        Ok(Snapshot {
            live: self.with(py, |inner| inner.clone())?,
            sensors: self.sensors,
        })
    }

    /// Takes events one after another, and returns what they completed; an error has the reports of those before it.
    pub(super) fn push(&self, py: Python<'_>, events: impl IntoIterator<Item = Event> + Send) -> PyResult<Vec<Report>> {
        let (mut pushed, mut taken) = (Vec::new(), 0);
        let outcome = self.with(py, |inner| {
            events.into_iter().try_for_each(|event| {
                inner.push(&event, &mut |notice| pushed.push(notice.clone()))?;
                taken += 1;
                Ok(())
            })
        })?;
        let reports = pushed.iter().map(|notice| Report::of(py, notice, self.beams));
        let reports = reports.collect::<PyResult<Vec<_>>>()?;
        let Err(error) = outcome else {
            return Ok(reports);
        };
        let error = raise(error);
        error.value(py).setattr("taken", taken)?;
        error.value(py).setattr("reports", reports)?;
        Err(error)
    }

    /// A dict that `fill` makes of what `of` takes of the navigator.
    pub(super) fn estimate<'py, T: Send>(
        &self,
        py: Python<'py>,
        of: impl FnOnce(&Filters) -> Option<T> + Send,
        fill: impl FnOnce(&Bound<'py, PyDict>, T) -> PyResult<()>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(estimated) = self.with(py, |inner| of(inner.navigator()))? else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        fill(&out, estimated)?;
        Ok(Some(out))
    }
}
