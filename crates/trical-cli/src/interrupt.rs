//! Ctrl-C: the first asks for an orderly end, a second one ends the program at once.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::error::{CliError, Result};

/// Exit code after a second Ctrl-C, as shells have it.
const INTERRUPTED: i32 = 130;

/// A flag that Ctrl-C (or a request to terminate) sets; when it is set already, the program ends at once.
pub fn flag() -> Result<Arc<AtomicBool>> {
    let wanted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // in this order, or the first one would end the program already
        flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(&wanted))
            .and_then(|_| flag::register(signal, Arc::clone(&wanted)))
            .map_err(|e| CliError::Failed(format!("Ctrl-C cannot be watched: {e}")))?;
    }
    Ok(wanted)
}
