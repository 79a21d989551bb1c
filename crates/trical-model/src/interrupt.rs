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

use std::cell::RefCell;

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
