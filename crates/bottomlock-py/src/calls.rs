//! Calls of the kernel without the GIL: errors mapped, signals answered, and no panic to a caller.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::sync::mpsc::RecvTimeoutError;
use std::thread;
use std::time::Duration;

use bottomlock::error::internal;
use bottomlock::{NavError, Stop};

use crate::prelude::*;

/// Time between two looks at signals.
const LOOK: Duration = Duration::from_millis(100);

/// A call that takes no time to speak of.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, NavError> + Send) -> PyResult<T> {
    // What the work changes is not used again after a panic: the locks of a navigator are poisoned by it.
    py.detach(|| catch_unwind(AssertUnwindSafe(work)))
        .map_err(|panic| invalid(internal(panic.as_ref())))?
        .map_err(raise)
}

/// A call that may take long, on a thread of its own, while this one looks at signals and at `stop`, a
/// `threading.Event`; the bits are those of [`detached`].
///
/// The exception of a signal is raised; a set `stop` ends the work with KernelError.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    stop: Option<Argument>,
    work: impl FnOnce(&Stop) -> Result<T, NavError> + Send,
) -> PyResult<T> {
    let (request, asked) = (Stop::new(), stop.map(|stop| stop.clone().unbind()));
    let (raised, outcome) = py.detach(|| {
        thread::scope(|scope| {
            let (alive, ended) = mpsc::channel::<()>();
            let work = || {
                let _alive = alive;
                work(&request)
            };
            let worker = thread::Builder::new().spawn_scoped(scope, work);
            let mut raised = None;
            while worker.is_ok() && ended.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                match Python::attach(|py| is_asked(py, asked.as_ref())) {
                    Ok(false) => continue,
                    Ok(true) => {}
                    Err(error) => raised = raised.or(Some(error)),
                }
                request.request();
            }
            (raised, worker.map(thread::ScopedJoinHandle::join))
        })
    });
    if let Some(error) = raised {
        return Err(error);
    }
    let outcome = outcome.map_err(|error| invalid(format!("no thread could be started: {error}")))?;
    let outcome = outcome.map_err(|panic| invalid(internal(panic.as_ref())))?;
    outcome.map_err(raise)
}

/// Raises what a signal raises; true where the event is set.
fn is_asked(py: Python<'_>, stop: Option<&Py<PyAny>>) -> PyResult<bool> {
    py.check_signals()?;
    stop.map_or(Ok(false), |stop| stop.bind(py).call_method0("is_set")?.is_truthy())
}
