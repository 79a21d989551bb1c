//! Ctrl-C or Ctrl-\\, a request to terminate, a terminal that was closed: the first asks for an orderly end, a second one ends the
//! program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
    let told = interrupt.clone();
    let mut first = None;
    let listen = listener(move |signal| {
        told.asked.store(true, Ordering::Relaxed);
        // at the end of a login session a terminal's end and a request to terminate come together: one request
        if !BY_HAND.contains(&signal) && *first.get_or_insert(signal) != signal {
            return;
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
    })
    .map_err(failed)?;
    std::thread::Builder::new().name("signals".to_owned()).spawn(listen).map_err(failed)?;
    Ok(interrupt)
}

/// Those of Ctrl-C and Ctrl-\\.
#[cfg(unix)]
const BY_HAND: &[i32] = &[signal_hook::consts::SIGINT, signal_hook::consts::SIGQUIT];
#[cfg(not(unix))]
const BY_HAND: &[i32] = &[signal_hook::consts::SIGINT];

/// What waits for the signals that ask for an end, and handles each.
#[cfg(unix)]
fn listener(handle: impl FnMut(i32) + Send + 'static) -> std::io::Result<impl FnOnce() + Send + 'static> {
    use signal_hook::consts::{SIGHUP, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([BY_HAND, &[SIGTERM, SIGHUP]].concat())?;
    Ok(move || signals.forever().for_each(handle))
}

/// What waits for the signals that ask for an end, and handles each. Windows has Ctrl-C and a request to terminate, and nothing to wait for them
/// with.
#[cfg(not(unix))]
fn listener(mut handle: impl FnMut(i32) + Send + 'static) -> std::io::Result<impl FnOnce() + Send + 'static> {
    let mut flags = Vec::new();
    for signal in BY_HAND.iter().copied().chain([signal_hook::consts::SIGTERM]) {
        let flag = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(signal, Arc::clone(&flag))?;
        flags.push((signal, flag));
    }
    Ok(move || {
        loop {
            flags
                .iter()
                .filter(|(_, flag)| flag.swap(false, Ordering::Relaxed))
                .for_each(|(signal, _)| handle(*signal));
            std::thread::sleep(Duration::from_millis(10));
        }
    })
}
