//! Reading of recordings, whole or cut.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde_json::Value;
use trical_model::recording::{MAX_JOINTS, Recording, Row};

use super::cdr::JointState;
use super::{Attachment, IndicatorSample, ReadRecording, RecordError, json, schema};
use crate::motion::{JointSample, MotionSense};

/// A message as it stands in the file.
pub(super) struct RawMessage {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
    pub(super) data: Vec<u8>,
}

/// A channel as it stands in the file.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct RawChannel {
    pub(super) topic: String,
    pub(super) encoding: String,
    pub(super) metadata: BTreeMap<String, String>,
    pub(super) schema: Option<(String, String, Vec<u8>)>,
}

/// All that is whole in a file.
#[derive(Default)]
pub(super) struct RawFile {
    pub(super) channels: BTreeMap<u16, RawChannel>,
    pub(super) messages: Vec<RawMessage>,
    pub(super) attachments: Vec<Attachment>,
    pub(super) metadata: Vec<(String, BTreeMap<String, String>)>,
    pub(super) lost: Option<String>,
}

const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

/// Reads a recording, whole or cut anywhere.
///
/// The sense of each joint's last motion is derived from `/joint_states` where a measurement does not say it.
///
/// # Errors
/// The file cannot be read, is no MCAP file, or has a message that makes no sense.
pub fn read_recording(path: &Path) -> Result<ReadRecording, RecordError> {
    interpret(path, read_raw(path)?)
}

/// Takes all whole records out of a file, up to the first that is not.
pub(super) fn read_raw(path: &Path) -> Result<RawFile, RecordError> {
    let file = File::open(path).map_err(RecordError::io(path, "open"))?;
    let size = file
        .metadata()
        .map_err(RecordError::io(path, "read"))?
        .len();
    let mut source = BufReader::new(file);
    check_magic(path, &mut source)?;

    let limit = usize::try_from(size).unwrap_or(usize::MAX).max(1 << 16);
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_record_length_limit(limit);
    let mut reader = LinearReader::new_with_options(options);
    let mut raw = RawFile::default();
    let mut schemas: HashMap<u16, (String, String, Vec<u8>)> = HashMap::new();
    let mut ended = false;
    let mut problem = None;
    while let Some(event) = reader.next_event() {
        let record = match event {
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let read = read_some(&mut source, reader.insert(need))
                    .map_err(RecordError::io(path, "read"))?;
                reader.notify_read(read);
                continue;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => mcap::parse_record(opcode, data),
            Err(error) => Err(error),
        };
        match record {
            Ok(Record::Schema { header, data }) => {
                schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Ok(Record::Channel(channel)) => {
                let schema = schemas.get(&channel.schema_id).cloned();
                raw.channels.insert(
                    channel.id,
                    RawChannel {
                        topic: channel.topic,
                        encoding: channel.message_encoding,
                        metadata: channel.metadata,
                        schema,
                    },
                );
            }
            Ok(Record::Message { header, data }) => {
                if !raw.channels.contains_key(&header.channel_id) {
                    problem = Some(format!(
                        "a message on the unknown channel {}",
                        header.channel_id
                    ));
                    break;
                }
                raw.messages.push(RawMessage {
                    channel: header.channel_id,
                    sequence: header.sequence,
                    log_time: header.log_time,
                    publish_time: header.publish_time,
                    data: data.into_owned(),
                });
            }
            Ok(Record::Attachment { header, data, .. }) => raw.attachments.push(Attachment {
                name: header.name,
                media_type: header.media_type,
                data: data.into_owned(),
            }),
            Ok(Record::Metadata(metadata)) => raw.metadata.push((metadata.name, metadata.metadata)),
            Ok(Record::DataEnd(_) | Record::Footer(_)) => ended = true,
            Ok(_) => {}
            // what follows the data repeats it
            Err(_) if ended => break,
            Err(error) => {
                problem = Some(error.to_string());
                break;
            }
        }
    }
    if !ended {
        let why = problem.unwrap_or_else(|| "it has no end record".to_owned());
        raw.lost = Some(format!(
            "{}: the recording was cut ({why}); {} whole messages were recovered, what came after them is lost",
            path.display(),
            raw.messages.len()
        ));
    }
    Ok(raw)
}

fn check_magic(path: &Path, source: &mut impl Read) -> Result<(), RecordError> {
    let mut begin = Vec::with_capacity(MAGIC.len());
    source
        .take(MAGIC.len() as u64)
        .read_to_end(&mut begin)
        .map_err(RecordError::io(path, "read"))?;
    if begin == MAGIC {
        return Ok(());
    }
    let found = if begin.is_empty() {
        "nothing".to_owned()
    } else {
        format!("\"{}\"", begin.escape_ascii())
    };
    Err(RecordError::NotMcap {
        path: path.to_owned(),
        found,
    })
}

fn read_some(source: &mut impl Read, into: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match source.read(into) {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

/// Makes sense of the messages.
pub(super) fn interpret(path: &Path, raw: RawFile) -> Result<ReadRecording, RecordError> {
    let metadata: BTreeMap<_, _> = raw.metadata.into_iter().collect();
    let start_ns = metadata
        .get("trical")
        .and_then(|settings| settings.get("start_ns"))
        .and_then(|text| text.parse().ok())
        .or_else(|| raw.messages.iter().map(|message| message.log_time).min())
        .unwrap_or(0);

    let mut messages = raw.messages;
    messages.sort_by_key(|message| message.log_time);

    let mut joints: Option<usize> = None;
    let mut rows: Vec<Row> = Vec::new();
    let mut joint_states = Vec::new();
    let mut indicators = Vec::new();
    let mut motion = MotionSense::default();
    let mut numbers: BTreeMap<u16, usize> = BTreeMap::new();
    for message in &messages {
        let Some(channel) = raw.channels.get(&message.channel) else {
            continue;
        };
        let number = numbers.entry(message.channel).or_insert(0);
        *number += 1;
        let wrong = |problem: String| RecordError::Message {
            path: path.to_owned(),
            topic: channel.topic.clone(),
            number: *number,
            problem,
        };
        match channel.topic.as_str() {
            schema::JOINT_STATES => {
                if channel.encoding != "cdr" {
                    return Err(wrong(format!(
                        "encoding {:?}; expected \"cdr\"",
                        channel.encoding
                    )));
                }
                let state = JointState::from_cdr(&message.data).ok_or_else(|| {
                    wrong("no sensor_msgs/msg/JointState in little-endian CDR".to_owned())
                })?;
                let mut q = [0.0; MAX_JOINTS];
                for (to, from) in q.iter_mut().zip(&state.position) {
                    *to = *from;
                }
                motion.push(&q);
                joint_states.push(JointSample {
                    t: seconds_since(start_ns, message.log_time),
                    q,
                });
            }
            schema::MEASUREMENT => {
                let (mut row, count) = json::row_from_json(&message.data).map_err(wrong)?;
                match joints {
                    Some(before) if before != count => {
                        return Err(wrong(format!(
                            "{count} joints; expected {before} as before"
                        )));
                    }
                    _ => joints = Some(count),
                }
                if row.state.dir.is_none() && !joint_states.is_empty() {
                    row.state.dir = Some(motion.sense());
                }
                rows.push(row);
            }
            schema::INDICATORS => indicators.push(read_indicators(&message.data).map_err(wrong)?),
            _ => {}
        }
    }
    let recording = Recording {
        name: path.display().to_string(),
        joints: joints.unwrap_or(0),
        rows,
    };
    Ok(ReadRecording {
        recording,
        attachments: raw.attachments,
        metadata,
        joint_states,
        indicators,
        start_ns,
        lost: raw.lost,
    })
}

fn seconds_since(start_ns: u64, log_time: u64) -> f64 {
    if log_time >= start_ns {
        (log_time - start_ns) as f64 * 1e-9
    } else {
        -((start_ns - log_time) as f64) * 1e-9
    }
}

fn read_indicators(data: &[u8]) -> Result<IndicatorSample, String> {
    let value: Value =
        serde_json::from_slice(data).map_err(|error| format!("no JSON ({error})"))?;
    let number = |key: &str| {
        value
            .get(key)
            .and_then(Value::as_f64)
            .ok_or_else(|| format!("key {key:?}; expected a number"))
    };
    Ok(IndicatorSample {
        t: number("t_s")?,
        reading: [
            number("ix_mm")? * 1e-3,
            number("iy_mm")? * 1e-3,
            number("iz_mm")? * 1e-3,
        ],
        settled: value
            .get("settled")
            .and_then(Value::as_bool)
            .unwrap_or(false),
    })
}
