//! TriCal's own times on the tasks in a folder that `arm.py` and `scene.py` have written, one JSON object a line:
//! `trical-bench FOLDER [row ...]`. CPU time of the process, median over batches; `measure.py` does the same for the peers.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program, of no use to anybody when it fails"
)]

mod identification;
mod kinematics;
mod planning;
mod scale;

use std::hint::black_box;
use std::path::{Path, PathBuf};

use serde_json::json;
use trical_model::{Cell, Joints, MAX_JOINTS, Model, Robot};

/// Where the task is, and which rows are wanted.
struct Task {
    folder: PathBuf,
    rows: Vec<String>,
}

impl Task {
    fn wants(&self, row: &str) -> bool {
        self.rows.is_empty() || self.rows.iter().any(|r| r == row)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn nominal(&self, cell: &str) -> Model {
        let robot = Robot::load(&self.path("robot.toml")).unwrap();
        Model::nominal(robot, Cell::load(&self.path(cell)).unwrap())
    }

    /// The joint values of `joints.txt`.
    fn joints(&self) -> Vec<Joints> {
        let text = std::fs::read_to_string(self.path("joints.txt")).unwrap();
        let row = |line: &str| {
            let mut q = [0.0; MAX_JOINTS];
            line.split_whitespace().zip(&mut q).for_each(|(from, to)| *to = from.parse().unwrap());
            q
        };
        text.lines().map(row).collect()
    }
}

/// CPU time of the process, s.
#[cfg(unix)]
fn cpu() -> f64 {
    use nix::time::{ClockId, clock_gettime};
    let t = clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID).unwrap();
    #[expect(clippy::cast_precision_loss, reason = "nanoseconds of a run")]
    let seconds = t.tv_sec() as f64 + 1e-9 * t.tv_nsec() as f64;
    seconds
}

/// Windows does not tell it to safe code: the time of day, on a machine that does nothing else.
#[cfg(not(unix))]
fn cpu() -> f64 {
    static BEGIN: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    BEGIN.elapsed().as_secs_f64()
}

/// Median CPU time of a call over `batches` batches of at least 50 ms each, s. `f` is given a running number.
fn time<T>(batches: usize, mut f: impl FnMut(usize) -> T) -> f64 {
    let (mut count, mut k) = (1_u32, 0);
    let mut batch = |count: u32| {
        let start = cpu();
        for _ in 0..count {
            k += 1;
            black_box(f(k));
        }
        (cpu() - start) / f64::from(count)
    };
    batch(1);
    while batch(count) * f64::from(count) < 0.05 && count < 1 << 28 {
        count *= 2;
    }
    let mut all: Vec<f64> = (0..batches).map(|_| batch(count)).collect();
    all.sort_by(f64::total_cmp);
    all[batches / 2]
}

/// One line of the table.
fn report(row: &str, who: &str, seconds: f64, accuracy: &str) {
    println!(
        "{}",
        json!({ "row": row, "who": who, "ours": true, "version": env!("CARGO_PKG_VERSION"), "seconds": seconds, "accuracy": accuracy })
    );
}

fn main() {
    let mut args = std::env::args().skip(1);
    let folder = args.next().unwrap();
    let task = Task { folder: Path::new(&folder).to_owned(), rows: args.collect() };
    if let [first, what, n] = task.rows.as_slice()
        && first == "scale"
    {
        scale::run(&task, what, n.parse().unwrap());
        return;
    }
    kinematics::run(&task);
    identification::run(&task);
    planning::run(&task);
}
