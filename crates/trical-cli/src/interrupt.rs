//! Ctrl-C or Ctrl-\\ (Ctrl-Break on Windows), a request to terminate, a terminal that was closed: the first asks for an orderly end, a
//! second one ends the program at once.

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
    let requests = system::Requests::watch().map_err(failed)?;
    let told = interrupt.clone();
    let listen = move || {
        let mut first = None;
        requests.each(|request| {
            told.asked.store(true, Ordering::Relaxed);
            // at the end of a login session a terminal's end and a request to terminate come together: one request
            if !system::BY_HAND.contains(&request) && *first.get_or_insert(request) != request {
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
        });
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(listen).map_err(failed)?;
    Ok(interrupt)
}

#[cfg(unix)]
mod system {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    use signal_hook::iterator::Signals;

    /// Keys: each press is a request.
    pub const BY_HAND: [i32; 2] = [SIGINT, SIGQUIT];

    pub struct Requests(Signals);

    impl Requests {
        pub fn watch() -> std::io::Result<Self> {
            Signals::new([SIGINT, SIGQUIT, SIGTERM, SIGHUP]).map(Self)
        }

        /// Tells each request, for ever.
        pub fn each(mut self, told: impl FnMut(i32)) {
            self.0.forever().for_each(told);
        }
    }
}

/// Windows ends the program as soon as its window is closed: nothing is heard of that in time.
#[cfg(windows)]
mod system {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use signal_hook::consts::{SIGBREAK, SIGINT, SIGTERM};

    /// Keys: each press is a request.
    pub const BY_HAND: [i32; 2] = [SIGINT, SIGBREAK];

    /// So often is looked for a request.
    const EVERY: Duration = Duration::from_millis(10);

    pub struct Requests([(i32, Arc<AtomicBool>); 3]);

    impl Requests {
        pub fn watch() -> std::io::Result<Self> {
            let flags = [SIGINT, SIGBREAK, SIGTERM].map(|signal| (signal, Arc::new(AtomicBool::new(false))));
            for (signal, flag) in &flags {
                signal_hook::flag::register(*signal, Arc::clone(flag))?;
            }
            Ok(Self(flags))
        }

        /// Tells each request, for ever.
        pub fn each(self, mut told: impl FnMut(i32)) {
            loop {
                for (signal, flag) in &self.0 {
                    if flag.swap(false, Ordering::Relaxed) {
                        told(*signal);
                    }
                }
                std::thread::sleep(EVERY);
            }
        }
    }
}
