//! A pool of threads whose number does not change the results.

use crate::error::NavError;

/// Most threads for each core: more only take turns.
const MOST_PER_CORE: usize = 16;

/// Checks a number of threads; 0 stands for one per core.
fn check(threads: usize) -> Result<(), NavError> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let most = MOST_PER_CORE * cores;
    if threads <= most {
        return Ok(());
    }
    Err(NavError::WrongCount {
        field: "threads",
        got: threads,
        expected: format!("0 (one per core) to {most} on this machine of {cores} cores"),
    })
}

/// A pool of threads; with one thread, or without the feature `parallel`, work runs on the caller's thread.
#[derive(Debug)]
pub(crate) struct Workers {
    #[cfg(feature = "parallel")]
    pool: Option<rayon::ThreadPool>,
}

#[cfg(feature = "parallel")]
impl Workers {
    /// A pool of `threads` threads; 0 stands for one per core.
    ///
    /// # Errors
    /// [`NavError::WrongCount`] for more than [`MOST_PER_CORE`] threads for each core; [`NavError::OutOfRange`] where the
    /// system cannot start so many threads.
    pub(crate) fn new(threads: usize) -> Result<Self, NavError> {
        check(threads)?;
        if threads == 1 {
            return Ok(Self { pool: None });
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        Ok(Self {
            pool: Some(pool.map_err(|_| NavError::OutOfRange {
                field: "threads",
                value: threads as f64,
                expected: "a number of threads that the system can start",
            })?),
        })
    }

    /// Number of threads.
    pub(crate) fn threads(&self) -> usize {
        self.pool.as_ref().map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// Calls `work` on every item; results keep the order of the items, and of several errors the first item's is
    /// returned.
    ///
    /// # Errors
    /// As `work`.
    pub(crate) fn each<I: Send, T: Send>(
        &self,
        items: &mut [I],
        work: impl Fn(usize, &mut I) -> Result<T, NavError> + Sync + Send,
    ) -> Result<Vec<T>, NavError> {
        use rayon::prelude::*;
        let Some(pool) = &self.pool else {
            return items.iter_mut().enumerate().map(|(k, item)| work(k, item)).collect();
        };
        let parallel = || {
            items
                .par_iter_mut()
                .enumerate()
                .map(|(k, item)| work(k, item))
                .collect()
        };
        let results: Vec<Result<T, NavError>> = pool.install(parallel);
        results.into_iter().collect()
    }
}

#[cfg(not(feature = "parallel"))]
impl Workers {
    pub(crate) fn new(threads: usize) -> Result<Self, NavError> {
        check(threads)?;
        Ok(Self {})
    }

    pub(crate) fn threads(&self) -> usize {
        1
    }

    pub(crate) fn each<I, T>(
        &self,
        items: &mut [I],
        work: impl Fn(usize, &mut I) -> Result<T, NavError>,
    ) -> Result<Vec<T>, NavError> {
        items.iter_mut().enumerate().map(|(k, item)| work(k, item)).collect()
    }
}
