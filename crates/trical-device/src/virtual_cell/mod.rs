//! A virtual cell: an arm, balls and indicators that answer the real drivers on a pseudo-terminal and a TCP port; on two TCP ports
//! where there are no pseudo-terminals (Windows).
//!
//! Its clock is simulated and moves on with each motion, so nothing waits and the same seed gives the same answers.

mod arm;
pub mod fault_script;
mod plant;
mod receiver;
mod robot;
pub mod script;
mod wire;
mod world;

use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use thiserror::Error;
use trical_model::Pose;
use trical_model::recording::{Joints, MAX_JOINTS, State};

use crate::gauge::uwave_protocol::Status;
use crate::url::Secret;

pub use arm::ArmPlant;
pub use plant::Plant;
pub use script::{Scheduled, When};

/// What a virtual cell is like. Lengths in m, angles in rad, times in s.
#[derive(Clone, Debug, PartialEq)]
pub struct CellOptions {
    /// TCP port of the controller on 127.0.0.1; 0 = any that is free.
    pub port: u16,
    /// TCP port of the receiver on 127.0.0.1 (0 = any that is free), as of a converter from a serial line to a network; `None` = a
    /// pseudo-terminal, or any TCP port where there are none.
    pub gauge_port: Option<u16>,
    /// What a client has to give first; `None` = whoever comes may command.
    pub secret: Option<Secret>,
    /// Serial number that the controller tells.
    pub serial_number: Option<String>,
    /// Channels of the indicators along x, y, z.
    pub channels: [u8; 3],
    /// Group of the indicators.
    pub group: u8,
    /// Joint limits of the controller, joint 1 first; joints without an entry have none.
    pub limits: Vec<(f64, f64)>,
    /// Largest correction that the controller takes.
    pub correction_limit: f64,
    /// Largest sum of corrections that the controller takes between two joint motions.
    pub correction_sum_limit: f64,
    /// Readings where the indicators end, retracted and extended.
    pub stroke: [f64; 2],
    /// Resolution of the indicators; 0 = what a record can hold (a nanometre).
    pub resolution: f64,
    /// Standard deviation of each indicator's noise, drawn anew for each pose that is reached.
    pub noise: f64,
    /// Standard deviation, on each axis, of where the arm comes to rest (its repeatability).
    pub placement: f64,
    /// Seed of all noise.
    pub seed: u64,
    /// Where the arm stands at first.
    pub start: Joints,
    /// Mass added on the flange, kg.
    pub payload_kg: Option<f64>,
    /// Time that passes at each pose that is reached (settling and reading).
    pub dwell: f64,
    /// Real seconds for each simulated second of motion; 0 = motions take no time, 1 = as long as a real arm's.
    pub pace: f64,
    /// Real seconds until the receiver knows of a new value; it repeats the last one until then.
    pub radio_delay: f64,
    /// Joints and indicators that are read too early, where asked for.
    pub unsettled: Option<Unsettled>,
    /// What goes wrong, and when.
    pub script: Vec<Scheduled>,
}

/// What joints and indicators still lack after a motion; it dies away exponentially.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unsettled {
    /// How far a joint that has just stopped is read short of where it comes to rest, rad.
    pub joint: f64,
    /// How far the indicators are off, m.
    pub indicator: f64,
    /// Time constant in simulated s (real s where motions take no time).
    pub time: f64,
}

impl Default for CellOptions {
    fn default() -> Self {
        Self {
            port: 0,
            gauge_port: None,
            secret: None,
            serial_number: None,
            channels: [0, 1, 2],
            group: 0,
            limits: Vec::new(),
            correction_limit: 5e-3,
            correction_sum_limit: 10e-3,
            stroke: [-6e-3, 6e-3],
            resolution: 1e-6,
            noise: 0.0,
            placement: 0.0,
            seed: 1,
            start: [0.0; MAX_JOINTS],
            payload_kg: None,
            dwell: 2.0,
            pace: 0.0,
            radio_delay: 0.0,
            unsettled: None,
            script: Vec::new(),
        }
    }
}

/// Things that go wrong on request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The transmitter of an axis (0-based) reports a low battery before each value.
    BatteryLow {
        /// Which axis.
        axis: usize,
    },
    /// A request for an axis is answered with a status, so many times.
    Status {
        /// Which axis.
        axis: usize,
        /// What is said.
        status: Status,
        /// How often.
        times: u32,
    },
    /// The transmitter of an axis has died: the receiver repeats the last value.
    Stale {
        /// Which axis.
        axis: usize,
    },
    /// The stem of an axis is stuck: it reads 3 to 5 um, whatever the arm does.
    StuckStem {
        /// Which axis.
        axis: usize,
    },
    /// The stem of an axis sticks while its ball is so near to the tool point, and reads 3 to 5 um there; outside it is free.
    StickingStem {
        /// Which axis.
        axis: usize,
        /// How near, in thousandths of a mm.
        within_um: u32,
    },
    /// A person jogs a joint, once.
    Jogged {
        /// Which joint, counted from 0.
        joint: usize,
        /// By how much, in thousandths of a degree.
        by_mdeg: i32,
    },
    /// The controller's clock is off by so many s.
    ClockJump {
        /// By how much.
        seconds: i64,
    },
    /// The receiver answers nothing.
    Silence,
    /// The receiver answers nonsense.
    Garbage,
    /// Records of other channels come before each value.
    Unsolicited,
    /// Indicators x and y are mixed up.
    SwappedAxes,
    /// An indicator reads with the opposite sign.
    FlippedAxis {
        /// Which axis.
        axis: usize,
    },
    /// The balls are gone.
    BallsRemoved,
    /// The controller refuses motions.
    RefuseMoves,
    /// The controller says that it moved, and does not.
    StuckArm,
    /// The controller closes the connection on the next request.
    DropConnection,
    /// The controller does not answer motions any more.
    Stall,
    /// Receiver and controller answer byte by byte.
    Pieces,
    /// Bytes from the receiver are lost, so many of a thousand.
    DropBytes {
        /// Of a thousand bytes.
        per_mille: u16,
    },
    /// Bytes from the receiver come twice, so many of a thousand.
    DoubleBytes {
        /// Of a thousand bytes.
        per_mille: u16,
    },
    /// Bits of bytes from the receiver are turned, so many bytes of a thousand.
    GarbleBytes {
        /// Of a thousand bytes.
        per_mille: u16,
    },
    /// The receiver answers so many real ms late.
    Late {
        /// By how much.
        milliseconds: u32,
    },
    /// The plate with the balls has slipped along the axes of {w}.
    SlippedPlate {
        /// By how much, in thousandths of a mm.
        by_um: [i32; 3],
    },
}

/// Why a virtual cell did not start.
#[derive(Debug, Error)]
pub enum CellError {
    /// The port is taken.
    #[error("virtual controller: port {address} is in use by another program; choose another port, or 0 for any")]
    PortInUse {
        /// Address that was tried.
        address: SocketAddr,
    },
    /// The port cannot be opened for another reason.
    #[error("virtual controller: port {address} cannot be opened ({reason})")]
    Port {
        /// Address that was tried.
        address: SocketAddr,
        /// What the operating system said.
        reason: String,
    },
    /// No pseudo-terminal, or no TCP port in its place.
    #[error("virtual receiver: no {place} ({reason})")]
    Receiver {
        /// What is missing.
        place: String,
        /// What the operating system said.
        reason: String,
    },
    /// No thread.
    #[error("virtual cell: no thread ({reason})")]
    Thread {
        /// What the operating system said.
        reason: String,
    },
}

/// A running virtual cell; it stops when dropped.
pub struct VirtualCell {
    world: Arc<Mutex<world::World>>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    receiver: String,
    address: SocketAddr,
    gauge_url: String,
    controller_url: String,
}

impl VirtualCell {
    /// Starts a cell.
    ///
    /// # Errors
    /// A port is taken, or there is no pseudo-terminal.
    pub fn start(plant: Box<dyn Plant>, options: CellOptions) -> Result<Self, CellError> {
        let address = SocketAddr::from(([127, 0, 0, 1], options.port));
        let listener = TcpListener::bind(address)
            .and_then(|listener| listener.set_nonblocking(true).map(|()| listener))
            .map_err(|error| match error.kind() {
                std::io::ErrorKind::AddrInUse => CellError::PortInUse { address },
                _ => CellError::Port { address, reason: error.to_string() },
            })?;
        let address = listener.local_addr().unwrap_or(address);
        let (wire, place) = match options.gauge_port {
            None if cfg!(unix) => (wire::terminal(), "pseudo-terminal".to_owned()),
            port => {
                let address = SocketAddr::from(([127, 0, 0, 1], port.unwrap_or(0)));
                (wire::tcp(address), format!("TCP port {address}"))
            }
        };
        let (mut wire, receiver) = wire.map_err(|error| CellError::Receiver { place, reason: error.to_string() })?;

        let [x, y, z] = options.channels;
        let gauge_url = format!(
            "uwave://{receiver}?x={x:02}&y={y:02}&z={z:02}&group={:02}&interval_ms=0&settle_ms={:.0}&repeats=2",
            options.group,
            // readings that agree must not both be older than the motion
            options.radio_delay * 1.5e3
        );
        let secret = options.secret.as_ref().map(|secret| format!("&secret={}", secret.text())).unwrap_or_default();
        let controller_url = format!("rapid://{address}?settle_ms=0{secret}");
        let world = Arc::new(Mutex::new(world::World::new(plant, options)));
        let stop = Arc::new(AtomicBool::new(false));
        let mut cell = Self {
            world: Arc::clone(&world),
            stop: Arc::clone(&stop),
            threads: Vec::new(),
            receiver,
            address,
            gauge_url,
            controller_url,
        };
        let (shared, ends) = (Arc::clone(&world), Arc::clone(&stop));
        cell.spawn("virtual receiver", move || receiver::serve(&mut *wire, &shared, &ends))?;
        cell.spawn("virtual controller", move || robot::serve(&listener, &world, &stop))?;
        Ok(cell)
    }

    fn spawn(&mut self, name: &str, body: impl FnOnce() + Send + 'static) -> Result<(), CellError> {
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(body)
            .map_err(|error| CellError::Thread { reason: error.to_string() })?;
        self.threads.push(thread);
        Ok(())
    }

    /// Where the receiver answers: path of the pseudo-terminal, or host and TCP port.
    #[must_use]
    pub fn receiver(&self) -> &str {
        &self.receiver
    }

    /// Address on which the controller answers.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// URL for [`crate::open_gauge`]; without the pauses that a radio link needs.
    #[must_use]
    pub fn gauge_url(&self) -> String {
        self.gauge_url.clone()
    }

    /// URL for [`crate::open_controller`]; without pauses too. It has the secret.
    #[must_use]
    pub fn controller_url(&self) -> String {
        self.controller_url.clone()
    }

    /// Lets something go wrong from now on.
    pub fn inject(&self, fault: Fault) {
        lock(&self.world).faults.push(fault);
    }

    /// Ends all faults.
    pub fn clear_faults(&self) {
        lock(&self.world).faults.clear();
    }

    /// A person guides the arm by hand to these joints; they do not move by themselves.
    pub fn guide(&self, q: &Joints) {
        lock(&self.world).guide(q);
    }

    /// Where the arm stands and what the plant is told of it.
    #[must_use]
    pub fn state(&self) -> State {
        lock(&self.world).state()
    }

    /// Where the tool truly is, in the world frame; what a perfect tracker would see.
    #[must_use]
    pub fn true_tcp(&self) -> Pose {
        lock(&self.world).true_tcp()
    }

    /// Number of motions so far.
    #[must_use]
    pub fn motions(&self) -> u64 {
        lock(&self.world).motions
    }

    /// Whether both threads still run.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.threads.iter().all(|thread| !thread.is_finished())
    }
}

impl Drop for VirtualCell {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // a thread that panicked has nothing left to say here
            let _ = thread.join();
        }
    }
}

/// A plant that panicked in one thread leaves a state that the other can still read.
fn lock(world: &Mutex<world::World>) -> MutexGuard<'_, world::World> {
    world.lock().unwrap_or_else(PoisonError::into_inner)
}
