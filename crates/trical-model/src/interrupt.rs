//! Long work that can be asked to stop. Whoever starts it says how to ask ([`stoppable`]); the work looks between its steps
//! ([`checkpoint`]) and ends with [`ModelError::Stopped`]. Work that nobody can stop never asks.
//!
//! ```
//! use trical_model::interrupt::{checkpoint, stoppable};
//! let mut asked = 0;
//! let done = stoppable(move || { asked += 1; asked > 2 }, || (0..10).take_while(|_| checkpoint().is_ok()).count());
//! assert_eq!(done, 2);
//! assert!(checkpoint().is_ok());
//! ```
//!
//! Work that is shared among threads is watched from outside: [`shared`] asks meanwhile, and its parts look as all work does.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use crate::error::{ModelError, Result};

struct Asker {
    ask: Box<dyn FnMut() -> bool>,
    stopped: bool,
}

thread_local! {
    static ASKER: RefCell<Option<Asker>> = const { RefCell::new(None) };
}

/// Puts back what was there, also where the work ends early.
struct Before(Option<Asker>);

impl Drop for Before {
    fn drop(&mut self) {
        ASKER.set(self.0.take());
    }
}

/// Runs `work` on this thread; it stops soon after `ask` says true, and `ask` is not called again then.
pub fn stoppable<T>(ask: impl FnMut() -> bool + 'static, work: impl FnOnce() -> T) -> T {
    let _before = Before(ASKER.replace(Some(Asker { ask: Box::new(ask), stopped: false })));
    work()
}

/// Whether the work of this thread is to stop.
#[must_use]
pub fn stop_wanted() -> bool {
    // taken out meanwhile: the asker may run anything
    let Some(mut asker) = ASKER.take() else { return false };
    asker.stopped = asker.stopped || (asker.ask)();
    let stopped = asker.stopped;
    ASKER.set(Some(asker));
    stopped
}

/// For loops of long work: go on, or end.
///
/// # Errors
/// [`ModelError::Stopped`].
pub fn checkpoint() -> Result<()> {
    if stop_wanted() { Err(ModelError::Stopped) } else { Ok(()) }
}

/// Whether work that is shared among threads is to stop.
#[derive(Clone, Debug, Default)]
pub struct Shared(Arc<AtomicBool>);

impl Shared {
    /// A part of the work, on whichever thread: [`checkpoint`] in it ends it when the whole is to stop.
    pub fn part<T>(&self, work: impl FnOnce() -> T) -> T {
        let stop = Arc::clone(&self.0);
        stoppable(move || stop.load(Ordering::Relaxed), work)
    }
}

/// Runs `work`, which gives its parts to other threads, while this thread asks whether it is still wanted.
pub fn shared<T: Send>(work: impl FnOnce(&Shared) -> T + Send) -> T {
    /// Asked this often.
    const LOOK: Duration = Duration::from_millis(20);
    let stop = &Shared::default();
    if ASKER.with_borrow(Option::is_none) {
        return work(stop);
    }
    std::thread::scope(|scope| {
        let (ended, end) = channel::<()>();
        let worker = scope.spawn(move || {
            let _ended = ended;
            work(stop)
        });
        while matches!(end.recv_timeout(LOOK), Err(RecvTimeoutError::Timeout)) {
            if stop_wanted() {
                stop.0.store(true, Ordering::Relaxed);
            }
        }
        match worker.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_on_other_threads_stop_when_the_whole_is_to() {
        let until = || {
            (0..).find(|_| {
                std::thread::sleep(Duration::from_millis(1));
                checkpoint().is_err()
            })
        };
        let parts = |stop: &Shared| {
            std::thread::scope(|s| {
                let all: Vec<_> = (0..3).map(|_| s.spawn(|| stop.part(until))).collect();
                all.into_iter().filter_map(|part| part.join().ok().flatten()).count()
            })
        };
        let mut asked = 0;
        let ask = move || {
            asked += 1;
            asked > 2
        };
        assert_eq!(stoppable(ask, || shared(parts)), 3);
        assert!(checkpoint().is_ok());
    }

    #[test]
    fn work_that_nobody_can_stop_stays_on_its_thread() {
        let here = std::thread::current().id();
        assert_eq!(shared(|_| std::thread::current().id()), here);
    }
}
