//! Calls that wait for machines: without the interpreter's lock, with progress, and ended in order by Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use trical_device::controller::StopCount;

use crate::errors::Result;

/// Ctrl-C is looked for this often.
const LOOK: Duration = Duration::from_millis(50);

/// How work says how far it is.
pub type Tell<'a> = &'a mut dyn FnMut(f64, String);

/// How the work learns that it is to end.
#[derive(Default)]
pub struct End {
    /// Set once: the work ends in order.
    pub asked: AtomicBool,
    /// How often Ctrl-C was pressed: each stops a motion under way through the controller.
    pub stops: StopCount,
}

/// Runs `work` on a thread of its own, while this one hears its progress for `progress` (a callable of a fraction and what is
/// being done, or None) and looks for Ctrl-C. Ctrl-C, and whatever `progress` raises, tell `work` to end, and each Ctrl-C to stop
/// the motion under way; the call returns when `work` has ended, in order, and raises that. How it ended then is the cause of what is raised.
pub fn supervised<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&End, Tell<'_>) -> Result<T> + Send,
) -> PyResult<T> {
    let end = &End::default();
    let stop = || {
        end.stops.ask();
    };
    let (result, raised) = py.detach(move || {
        std::thread::scope(|scope| {
            let (tell, hear) = channel::<(f64, String)>();
            let worker = scope.spawn(move || {
                work(end, &mut |fraction, what| {
                    // nobody hears any more: the other side has panicked
                    let _ = tell.send((fraction, what));
                })
            });
            let mut raised: Option<PyErr> = None;
            loop {
                let said = match hear.recv_timeout(LOOK) {
                    Ok(said) => Some(said),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if raised.is_some() {
                    // pressed again: the end is on its way, and shall not be interrupted a second time where it is caught
                    if Python::attach(|py| py.check_signals().is_err()) {
                        stop();
                    }
                    continue;
                }
                let heard = Python::attach(|py| {
                    py.check_signals()?;
                    match (said, &progress) {
                        (Some((fraction, what)), Some(callable)) => callable.call1(py, (fraction, what)).map(drop),
                        _ => Ok(()),
                    }
                });
                if let Err(e) = heard {
                    end.asked.store(true, Ordering::Relaxed);
                    if Python::attach(|py| e.is_instance_of::<PyKeyboardInterrupt>(py)) {
                        stop();
                    }
                    raised = Some(e);
                }
            }
            match worker.join() {
                Ok(result) => (result.map_err(PyErr::from), raised),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    });
    // pressed since the work last looked
    let raised = raised.or_else(|| py.check_signals().err());
    match (raised, result) {
        (None, result) => result,
        (Some(e), Ok(_)) => Err(e),
        (Some(e), Err(end)) => {
            e.set_cause(py, Some(end));
            Err(e)
        }
    }
}
