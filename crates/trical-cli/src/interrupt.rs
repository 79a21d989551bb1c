//! Ctrl-C or Ctrl-\\, a request to terminate, a terminal that was closed: the first asks for an orderly end, a second one ends the
//! program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use trical_device::controller::StopCount;

use crate::error::{CliError, Result};

/// Exit code after a second Ctrl-C, as shells have it.
const INTERRUPTED: i32 = 130;

/// After a second Ctrl-C the program ends when a motion under way has been told to stop, or at the latest after this: a service may
/// take its time-out for an answer, and be asked again.
const STOP_FIRST: Duration = Duration::from_secs(20);

/// So long it then has to say what it has done.
const SAY: Duration = Duration::from_millis(200);

/// What Ctrl-C does while the arm may move.
#[derive(Clone, Default)]
pub struct Interrupt {
    /// Set by the first one: the work ends in order.
    pub asked: Arc<AtomicBool>,
    /// How many there were: each stops the motion under way.
    pub stops: StopCount,
}

/// Watches for Ctrl-C, a request to terminate, and the end of the terminal.
pub fn watch() -> Result<Interrupt> {
    let interrupt = Interrupt { asked: Arc::default(), stops: Arc::default() };
    let failed = |e: std::io::Error| CliError::Failed(format!("Ctrl-C cannot be watched: {e}"));
    let mut signals = Signals::new([SIGINT, SIGQUIT, SIGTERM, SIGHUP]).map_err(failed)?;
    let told = interrupt.clone();
    let listen = move || {
        let mut first = None;
        for signal in signals.forever() {
            told.asked.store(true, Ordering::Relaxed);
            // at the end of a login session a terminal's end and a request to terminate come together: one request
            let by_hand = [SIGINT, SIGQUIT].contains(&signal);
            if !by_hand && *first.get_or_insert(signal) != signal {
                continue;
            }
            if told.stops.ask() > 0 {
                let begin = Instant::now();
                while told.stops.is_moving() && begin.elapsed() < STOP_FIRST {
                    std::thread::sleep(Duration::from_millis(10));
                }
                std::thread::sleep(SAY);
                crate::note!(
                    "trical: ended at once by a second request; the arm stays where it is, perhaps at a ball. What was recorded is kept"
                );
                std::process::exit(INTERRUPTED);
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(listen).map_err(failed)?;
    Ok(interrupt)
}
