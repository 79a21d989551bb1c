//! Long calls: without the interpreter's lock, with progress, and stopped by Ctrl-C.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use trical_model::Task;

use crate::errors::{Failed, Result};

/// Ctrl-C is looked for this often.
const LOOK: Duration = Duration::from_millis(50);

/// Runs `work` while other threads of Python run too. `progress` is a callable of a fraction and what is being done, or None.
/// Ctrl-C, and whatever `progress` raises, stops the work at its next step.
pub fn interruptible<T: Send, E>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Task<'_>) -> std::result::Result<T, E> + Send,
) -> PyResult<T>
where
    Failed: From<E>,
    E: Send,
{
    // arrays that come of the work need it, and an interrupted import in their midst could not be told
    py.import("numpy")?;
    let run = move || -> Result<T> {
        let raised: Rc<RefCell<Option<PyErr>>> = Rc::default();
        let ask = {
            let raised = Rc::clone(&raised);
            let mut last = Instant::now();
            move || {
                if raised.borrow().is_some() {
                    return true;
                }
                if last.elapsed() < LOOK {
                    return false;
                }
                last = Instant::now();
                let signal = Python::attach(|py| py.check_signals());
                raised.replace(signal.err()).is_some() || raised.borrow().is_some()
            }
        };
        let report = {
            let raised = Rc::clone(&raised);
            move |fraction: f64, what: &str| {
                let Some(callable) = &progress else { return };
                if raised.borrow().is_none()
                    && let Err(e) = Python::attach(|py| callable.call1(py, (fraction, what)))
                {
                    raised.replace(Some(e));
                }
            }
        };
        let result = Task::run(&report, ask, work);
        match raised.take() {
            Some(e) => Err(e.into()),
            None => Ok(result?),
        }
    };
    let done = py.detach(run).map_err(PyErr::from)?;
    // pressed since the work last looked
    py.check_signals()?;
    Ok(done)
}
