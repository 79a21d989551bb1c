//! Joints from a file that grows: what `ros2 topic echo /joint_states > joints.txt` writes, or a CSV with the columns `q1_deg` ... (or `_rad`).

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use thiserror::Error;
use trical_model::{JointKind, Joints, MAX_JOINTS, Robot};
use trical_recording::Expected;
use trical_recording::mcap::joint_order;

/// A sample has to come within this.
const WAIT: Duration = Duration::from_secs(5);
/// Joints are watched for so long, and averaged.
const WATCH: Duration = Duration::from_millis(400);
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(50);
/// An arm that is held by hand stands still within this, rad.
const STILL: f64 = 0.05_f64.to_radians();
/// What is read at one time, at most: a topic writes some hundred kB a second.
const MOST: u64 = 4 << 20;

/// Why no joints could be taken.
#[derive(Debug, Error)]
pub enum FeedError {
    /// The file cannot be read.
    #[error("{}: cannot be read ({source})", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Nothing new came.
    #[error("{}: nothing was added within {seconds} s; does whoever writes it still run?", path.display())]
    Silent {
        /// The file.
        path: PathBuf,
        /// How long was waited.
        seconds: f64,
    },
    /// What came is no sample.
    #[error(
        "{}: {bytes} bytes came, but no whole sample; expected a CSV with a header (q1_deg, ...), or the output of `ros2 topic echo`",
        path.display()
    )]
    NoSample {
        /// The file.
        path: PathBuf,
        /// How much came.
        bytes: usize,
    },
    /// The arm moves.
    #[error("joint {joint} moved by {moved_deg:.2} deg within {seconds} s; hold the arm still")]
    Moves {
        /// 1-based.
        joint: usize,
        /// From end to end; mm/1000 as rad of a sliding joint.
        moved_deg: f64,
        /// How long it was watched.
        seconds: f64,
    },
    /// What stands there is not understood.
    #[error("{}: {problem}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
    },
}

/// Columns of a CSV.
#[derive(Debug)]
struct Columns {
    /// How many there are.
    count: usize,
    /// Where each joint stands, and its factor to SI.
    joints: Vec<(usize, f64)>,
}

/// A file to which somebody adds joints.
#[derive(Debug)]
pub struct JointFeed {
    path: PathBuf,
    kinds: Vec<JointKind>,
    /// What the arm's description calls them.
    names: Vec<String>,
    /// Of a CSV; nothing where it is a topic.
    columns: Option<Columns>,
    /// The names of a message's joints, once one was seen, and where each joint of the arm stands among them.
    order: Option<(Vec<String>, Vec<usize>)>,
    /// Why the last message that was not of the arm's joints is none.
    others: Option<String>,
    notes: Vec<String>,
}

impl JointFeed {
    /// Looks at the beginning of a file, which must be there.
    ///
    /// # Errors
    /// It cannot be read; it is a CSV without a column for every joint.
    pub fn open(path: &Path, robot: &Robot) -> Result<Self, FeedError> {
        let kinds: Vec<JointKind> = robot.joints.iter().map(|j| j.kind).collect();
        let names = robot.joint_names.clone();
        let mut feed =
            Self { path: path.to_owned(), kinds, names, columns: None, order: None, others: None, notes: Vec::new() };
        feed.look_for_columns()?;
        Ok(feed)
    }

    /// Reads the header, where the file has one by now: whoever writes it may have begun after it was opened.
    fn look_for_columns(&mut self) -> Result<(), FeedError> {
        let path = &self.path;
        let io = |source| FeedError::Io { path: path.to_owned(), source };
        let mut head = Vec::new();
        File::open(path).and_then(|f| f.take(4096).read_to_end(&mut head)).map_err(io)?;
        let head = String::from_utf8_lossy(&head);
        let Some((first, _)) = head.split_once('\n') else { return Ok(()) };
        let first = first.trim_start_matches('\u{feff}').trim().to_lowercase();
        if first.contains("q1_") {
            let names: Vec<&str> = first.split(',').map(str::trim).collect();
            let column = |k: usize| {
                let units = match self.kinds.get(k) {
                    Some(JointKind::Prismatic) => [("mm", 1e-3), ("m", 1.0)],
                    _ => [("deg", 1.0_f64.to_radians()), ("rad", 1.0)],
                };
                units.iter().find_map(|(unit, factor)| {
                    let at = names.iter().position(|n| *n == format!("q{}_{unit}", k + 1))?;
                    Some((at, *factor))
                })
            };
            if let Some(twice) =
                (1..names.len()).find(|k| names[*k].starts_with('q') && names[..*k].contains(&names[*k]))
            {
                let problem = format!("header: found column {} twice, expected it once", names[twice]);
                return Err(FeedError::Wrong { path: path.to_owned(), problem });
            }
            let all: Option<Vec<(usize, f64)>> = (0..self.kinds.len()).map(column).collect();
            let beyond = format!("q{}_", self.kinds.len() + 1);
            let all = all.filter(|_| !names.iter().any(|n| n.starts_with(&beyond)));
            let expected = |(k, kind): (usize, &JointKind)| match kind {
                JointKind::Revolute => format!("q{}_deg (or _rad)", k + 1),
                JointKind::Prismatic => format!("q{}_mm (or _m)", k + 1),
            };
            let joints = all.ok_or_else(|| FeedError::Wrong {
                path: path.to_owned(),
                problem: format!(
                    "header: found {first:?}, expected {}, one for each joint of the robot",
                    self.kinds.iter().enumerate().map(expected).collect::<Vec<_>>().join(", ")
                ),
            })?;
            self.columns = Some(Columns { count: names.len(), joints });
        }
        Ok(())
    }

    /// Where the arm stands: the mean of what comes in for 0.4 s, SI.
    ///
    /// # Errors
    /// Nothing comes, the arm moves, or what comes is not understood.
    pub fn joints(&mut self) -> Result<Joints, FeedError> {
        let io = |source| FeedError::Io { path: self.path.clone(), source };
        let begin = File::open(&self.path).and_then(|mut f| f.seek(SeekFrom::End(0))).map_err(io)?;
        let started = Instant::now();
        let mut first: Option<Instant> = None;
        loop {
            std::thread::sleep(LOOK);
            let mut bytes = Vec::new();
            let read = File::open(&self.path).and_then(|mut f| {
                f.seek(SeekFrom::Start(begin))?;
                f.take(MOST).read_to_end(&mut bytes)
            });
            read.map_err(|source| FeedError::Io { path: self.path.clone(), source })?;
            if self.columns.is_none() && self.order.is_none() {
                self.look_for_columns()?;
            }
            let samples = self.samples(&String::from_utf8_lossy(&bytes))?;
            if !samples.is_empty() {
                let since = *first.get_or_insert_with(Instant::now);
                if since.elapsed() >= WATCH || bytes.len() as u64 == MOST {
                    return self.mean(&samples);
                }
            } else if started.elapsed() > WAIT {
                let path = self.path.clone();
                return Err(match bytes.len() {
                    _ if self.order.is_none()
                        && let Some(problem) = self.others.take() =>
                    {
                        FeedError::Wrong { path, problem }
                    }
                    0 => FeedError::Silent { path, seconds: WAIT.as_secs_f64() },
                    bytes => FeedError::NoSample { path, bytes },
                });
            }
        }
    }

    /// What was assumed of the order of the joints, once.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn mean(&self, samples: &[Vec<f64>]) -> Result<Joints, FeedError> {
        let mut out = [0.0; MAX_JOINTS];
        for (k, to) in out.iter_mut().enumerate().take(self.kinds.len()) {
            let of = |s: &Vec<f64>| s.get(k).copied().unwrap_or(0.0);
            let [low, high] =
                samples.iter().map(of).fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], q| [l.min(q), h.max(q)]);
            if high - low > STILL {
                let moved_deg = (high - low).to_degrees();
                return Err(FeedError::Moves { joint: k + 1, moved_deg, seconds: WATCH.as_secs_f64() });
            }
            *to = samples.iter().map(of).sum::<f64>() / samples.len() as f64;
        }
        Ok(out)
    }

    /// The samples that stand whole in a text which may begin and end in the middle of one.
    fn samples(&mut self, text: &str) -> Result<Vec<Vec<f64>>, FeedError> {
        let wrong = |path: &Path, problem: String| FeedError::Wrong { path: path.to_owned(), problem };
        if let Some(columns) = &self.columns {
            let lines: Vec<&str> = text.split('\n').collect();
            let whole = lines.get(1..lines.len().saturating_sub(1)).unwrap_or(&[]);
            let sample = |line: &&str| -> Result<Vec<f64>, FeedError> {
                let cells: Vec<&str> = line.split(',').map(str::trim).collect();
                let value = |(at, factor): &(usize, f64)| {
                    cells.get(*at).and_then(|c| c.parse::<f64>().ok()).filter(|v| v.is_finite()).map(|v| v * factor)
                };
                // a decimal comma makes two cells of a number, and shifts those behind it
                if cells.len() != columns.count {
                    let (found, expected) = (cells.len(), columns.count);
                    let problem = format!("found {line:?} with {found} cells, expected {expected} as in the header");
                    return Err(wrong(&self.path, problem));
                }
                let all: Option<Vec<f64>> = columns.joints.iter().map(value).collect();
                all.ok_or_else(|| wrong(&self.path, format!("found {line:?}, expected a number for every joint")))
            };
            return whole.iter().filter(|l| !l.trim().is_empty()).map(sample).collect();
        }
        let messages: Vec<&str> = text.split("\n---").collect();
        let whole = messages.get(1..messages.len().saturating_sub(1)).unwrap_or(&[]);
        let mut out = Vec::new();
        for message in whole {
            let (names, positions) = (list(message, "name"), list(message, "position"));
            let values: Option<Vec<f64>> = positions.iter().map(|p| p.parse().ok()).collect();
            let whole = |v: &Vec<f64>| !v.is_empty() && v.len() == names.len() && v.iter().all(|v| v.is_finite());
            let Some(values) = values.filter(whole) else {
                let problem =
                    "a message has no name and number for every joint; expected what ros2 topic echo writes of a \
                               sensor_msgs/msg/JointState"
                        .to_owned();
                return Err(wrong(&self.path, problem));
            };
            // another order, or another publisher (a gripper) between
            if self.order.as_ref().is_none_or(|(of, _)| *of != names) {
                let found = joint_order(&names, Expected { joints: Some(self.kinds.len()), names: &self.names });
                match found {
                    Ok((order, notes)) => {
                        self.notes.extend(notes);
                        self.order = Some((names, order));
                    }
                    // this message has no joint of the arm, or not all: others may
                    Err(e) => {
                        self.others = Some(e);
                        continue;
                    }
                }
            }
            let order = self.order.as_ref().map_or(&[][..], |(_, order)| order);
            out.push(order.iter().filter_map(|k| values.get(*k).copied()).collect());
        }
        Ok(out)
    }
}

/// A list of YAML, as `- a` on lines of their own or as `[a, b]`.
fn list(message: &str, key: &str) -> Vec<String> {
    let tidy = |item: &str| item.trim().trim_matches(['"', '\'']).to_owned();
    let mut lines = message.lines();
    let Some(rest) = lines.by_ref().find_map(|l| l.trim_start().strip_prefix(key)?.trim_start().strip_prefix(':'))
    else {
        return Vec::new();
    };
    if let Some(inside) = rest.trim().strip_prefix('[').and_then(|r| r.strip_suffix(']')) {
        return inside.split(',').map(tidy).filter(|i| !i.is_empty()).collect();
    }
    lines.map_while(|l| l.trim_start().strip_prefix("- ").map(tidy)).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn lines_of_a_csv_have_as_many_cells_as_its_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joints.csv");
        // as spreadsheets begin a file
        let header = "\u{feff}q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\r\n";
        std::fs::write(&path, header).unwrap();
        let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let mut feed = JointFeed::open(&path, &robot).unwrap();
        let samples = feed.samples(&format!("{header}180,2,3,4,5,6\r\n")).unwrap();
        assert!(samples.len() == 1 && (samples[0][0] - std::f64::consts::PI).abs() < 1e-12, "{samples:?}");
        for line in ["1,5,2,0,3,0,4,0,5,0,6,0", "1,2,3,4,5"] {
            let error = feed.samples(&format!("{header}{line}\n")).unwrap_err().to_string();
            assert!(error.contains(" cells, expected 6 as in the header"), "{error}");
        }
    }
}
