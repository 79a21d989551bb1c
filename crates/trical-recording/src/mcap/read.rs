//! Reading of recordings, whole or cut.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use serde_json::Value;
use trical_model::recording::{MAX_JOINTS, Recording, Row};

use super::bag;
use super::cdr::JointState;
use super::records::{Channels, MAGIC, RawFile, RawMessage, read_in_pieces, read_records};
use super::{IndicatorSample, ReadRecording, schema};
use crate::columns::{Field, Unit, column};
use crate::error::RecordError;
use crate::expected::Expected;
use crate::json;
use crate::motion::{JointSample, MotionSense};
use crate::shared::{Places, Shared};

/// Reads a recording, whole or cut anywhere.
///
/// The sense of each joint's last motion is derived from `/joint_states` where a measurement does not say it.
///
/// # Errors
/// The file cannot be read, is no MCAP file, or has a message that makes no sense.
pub fn read_recording(path: &Path) -> Result<ReadRecording, RecordError> {
    interpret(path, &read_raw(path)?)
}

/// As [`read_recording`]; a ROS 2 bag of others is a recording too: its joint states, and what was seen on `topic`, matched by time. The arm is
/// the `expected` one.
///
/// # Errors
/// As there; a bag in which nothing can be matched.
pub fn read_any<'a>(
    path: &Path,
    expected: impl Into<Expected<'a>>,
    topic: Option<&str>,
) -> Result<ReadRecording, RecordError> {
    crate::bounds::check_file(path, true)?;
    let bytes = std::fs::read(path).map_err(RecordError::io(path, "open"))?;
    let raw = raw_of(path, &bytes, true)?;
    drop(bytes);
    if !bag::is_bag(&raw) {
        if let Some(topic) = topic {
            let problem = format!(
                "has its measurements on /measurement, as TriCal writes them; expected the file without '#{topic}'"
            );
            return Err(RecordError::File { file: path.display().to_string(), problem });
        }
        return interpret(path, &raw);
    }
    let recording = bag::recording(path, &raw, expected.into(), topic)?;
    let metadata = raw.metadata.iter().cloned().collect();
    let start_ns = raw.messages.iter().map(|message| message.log_time).min().unwrap_or(0);
    let (joint_states, indicators, attachments) = (Vec::new(), Vec::new(), Vec::new());
    Ok(ReadRecording { recording, attachments, metadata, joint_states, indicators, start_ns, lost: lost(path, &raw) })
}

/// As [`read_recording`], of bytes; `name` is for messages.
///
/// # Errors
/// As there.
pub fn read_bytes(name: &Path, bytes: &[u8]) -> Result<ReadRecording, RecordError> {
    interpret(name, &raw_of(name, bytes, false)?)
}

/// Takes all whole records out of a file.
pub(super) fn read_raw(path: &Path) -> Result<RawFile, RecordError> {
    crate::bounds::check_file(path, true)?;
    let bytes = std::fs::read(path).map_err(RecordError::io(path, "open"))?;
    raw_of(path, &bytes, false)
}

fn raw_of(path: &Path, bytes: &[u8], only_read: bool) -> Result<RawFile, RecordError> {
    let Some(body) = bytes.strip_prefix(&MAGIC) else { return Err(not_mcap(path, bytes)) };
    read_records(body, only_read).map_err(|problem| RecordError::Unreadable { path: path.to_owned(), problem })
}

/// What stands where the magic bytes should.
fn not_mcap(path: &Path, bytes: &[u8]) -> RecordError {
    let begin = bytes.get(..MAGIC.len()).unwrap_or(bytes);
    let found = if begin.is_empty() { "nothing".to_owned() } else { format!("\"{}\"", begin.escape_ascii()) };
    RecordError::NotMcap { path: path.to_owned(), found }
}

/// What was lost of a file, as one sentence.
fn lost(path: &Path, raw: &RawFile) -> Option<String> {
    (!raw.losses.is_empty()).then(|| {
        format!(
            "{}: the recording is damaged or incomplete ({}); {} recovered",
            path.display(),
            raw.losses.join("; "),
            match raw.messages.len() {
                1 => "1 message was".to_owned(),
                n => format!("{n} messages were"),
            }
        )
    })
}

/// Makes sense of the messages.
pub(super) fn interpret(path: &Path, raw: &RawFile) -> Result<ReadRecording, RecordError> {
    let lost = lost(path, raw);
    let metadata: BTreeMap<_, _> = raw.metadata.iter().cloned().collect();
    let start_ns = metadata
        .get("trical")
        .and_then(|settings| settings.get("start_ns"))
        .and_then(|text| text.parse().ok())
        .or_else(|| raw.messages.iter().map(|message| message.log_time).min())
        .unwrap_or(0);

    let mut messages: Vec<&RawMessage> = raw.messages.iter().collect();
    messages.sort_by_key(|message| message.log_time);

    let mut rows: Vec<Row> = Vec::new();
    let mut joint_states = Vec::new();
    let mut indicators = Vec::new();
    let mut reader = Interpreter::new(path);
    for message in messages {
        match reader.read(&raw.channels, message)? {
            Said::Row(row) => rows.push(*row),
            Said::Joints(q) => joint_states.push(JointSample { t: seconds_since(start_ns, message.log_time), q }),
            Said::Indicators(sample) => indicators.push(sample),
            Said::Nothing => {}
        }
    }
    let Shared { joints, prismatic, places } = reader.shared();
    let prismatic = Some(prismatic);
    let recording = Recording { name: path.display().to_string(), joints, prismatic, places, rows, notes: Vec::new() };
    Ok(ReadRecording {
        recording,
        attachments: raw.attachments.clone(),
        metadata,
        joint_states,
        indicators,
        start_ns,
        lost,
    })
}

/// Hands the measurements of a recording to `take` one after the other, in memory that does not grow with the file. Returns
/// what the rows share.
///
/// # Errors
/// As [`read_recording`]; a recording that is not whole, or whose messages do not stand in the order of time; what `take` returns.
pub fn each_row(path: &Path, take: &mut dyn FnMut(Row) -> Result<(), RecordError>) -> Result<Shared, RecordError> {
    let file = File::open(path).map_err(RecordError::io(path, "open"))?;
    let mut file = BufReader::with_capacity(1 << 20, file);
    let mut magic = Vec::new();
    (&mut file).take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(RecordError::io(path, "read"))?;
    if magic != MAGIC {
        return Err(not_mcap(path, &magic));
    }
    let unreadable = |problem: String| RecordError::Unreadable { path: path.to_owned(), problem };
    let io = |source: std::io::Error| RecordError::io(path, "read")(source);
    let mut reader = Interpreter::new(path);
    let mut last = 0;
    let mut each = |channels: &Channels, message: RawMessage| {
        let said = reader.read(channels, &message)?;
        // the sense of motion of a measurement comes from the joints before it
        if !matches!(said, Said::Nothing) {
            if message.log_time < last {
                return Err(unreadable(
                    "its messages do not stand in the order of time, and are to be read piece by piece; expected a recording \
                     as TriCal writes it, or one that fits into the memory"
                        .into(),
                ));
            }
            last = message.log_time;
        }
        if let Said::Row(row) = said { take(*row) } else { Ok(()) }
    };
    read_in_pieces(&mut file, &mut each, &unreadable, &io)?;
    Ok(reader.shared())
}

/// What a message says.
enum Said {
    Row(Box<Row>),
    Joints([f64; MAX_JOINTS]),
    Indicators(IndicatorSample),
    Nothing,
}

/// Makes sense of messages in the order of time.
struct Interpreter<'a> {
    path: &'a Path,
    joints: Option<(usize, [bool; MAX_JOINTS])>,
    places: Places,
    fields: json::Fields,
    moved: bool,
    motion: MotionSense,
    /// Messages so far of each channel.
    numbers: BTreeMap<u16, usize>,
}

impl<'a> Interpreter<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            joints: None,
            places: Places::default(),
            fields: json::Fields::default(),
            moved: false,
            motion: MotionSense::default(),
            numbers: BTreeMap::new(),
        }
    }

    /// What the rows share, after the last one.
    fn shared(self) -> Shared {
        let (joints, prismatic) = self.joints.unwrap_or_default();
        Shared { joints, prismatic, places: self.places.into_names() }
    }

    fn read(&mut self, channels: &Channels, message: &RawMessage) -> Result<Said, RecordError> {
        let Some(channel) = channels.get(&message.channel) else { return Ok(Said::Nothing) };
        let number = self.numbers.entry(message.channel).or_insert(0);
        *number += 1;
        let wrong = |problem: String| RecordError::Message {
            path: self.path.to_owned(),
            topic: channel.topic.clone(),
            number: *number,
            problem,
        };
        match channel.topic.as_str() {
            schema::JOINT_STATES => {
                if channel.encoding != "cdr" {
                    return Err(wrong(format!("encoding {:?}; expected \"cdr\"", channel.encoding)));
                }
                let state = JointState::from_cdr(&message.data)
                    .ok_or_else(|| wrong("no sensor_msgs/msg/JointState in little-endian CDR".to_owned()))?;
                let mut q = [0.0; MAX_JOINTS];
                for (to, from) in q.iter_mut().zip(&state.position) {
                    *to = *from;
                }
                self.motion.push(&q);
                self.moved = true;
                Ok(Said::Joints(q))
            }
            schema::MEASUREMENT => {
                let read = self.fields.row(&message.data, &mut self.places).map_err(wrong)?;
                let (mut row, count) = (read.row, read.joints);
                match self.joints {
                    Some((before, _)) if before != count => {
                        return Err(wrong(format!("{count} joints; expected {before} as before")));
                    }
                    Some((_, before)) if before != read.prismatic => {
                        return Err(wrong("joints in other units than before; expected the same".to_owned()));
                    }
                    _ => self.joints = Some((count, read.prismatic)),
                }
                // that of the CSV which `trical convert` makes of it
                row.line = *number + 1;
                if row.state.dir.is_none() && self.moved {
                    row.state.dir = Some(self.motion.sense());
                }
                Ok(Said::Row(Box::new(row)))
            }
            schema::INDICATORS => Ok(Said::Indicators(read_indicators(&message.data).map_err(wrong)?)),
            _ => Ok(Said::Nothing),
        }
    }
}

fn seconds_since(start_ns: u64, log_time: u64) -> f64 {
    if log_time >= start_ns { (log_time - start_ns) as f64 * 1e-9 } else { -((start_ns - log_time) as f64) * 1e-9 }
}

fn read_indicators(data: &[u8]) -> Result<IndicatorSample, String> {
    let value: Value = serde_json::from_slice(data).map_err(|error| format!("no JSON ({error})"))?;
    let number =
        |key: &str| value.get(key).and_then(Value::as_f64).ok_or_else(|| format!("key {key:?}; expected a number"));
    let mut reading = [0.0; 3];
    for (to, key) in reading.iter_mut().zip(column(Field::Indicators).names.fixed()) {
        *to = Unit::Millimetre.to_si(number(key)?);
    }
    Ok(IndicatorSample {
        t: number("t_s")?,
        reading,
        settled: value.get("settled").and_then(Value::as_bool).unwrap_or(false),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_recorded_before_the_start_has_a_time_below_zero() {
        let seconds = [9_500_000_000, 10_000_000_000, 12_000_000_000].map(|t| seconds_since(10_000_000_000, t));
        assert_eq!(seconds, [-0.5, 0.0, 2.0]);
    }
}
