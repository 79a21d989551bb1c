//! Writing of recordings, and taking up one that was broken off.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use trical_model::recording::{Recording, Row};

use super::cdr::{self, JointState};
use super::lock::{Locked, has_a_name, is_at, lock, lock_existing};
use super::read::{interpret, read_raw};
use super::records::{RawFile, RawMessage};
use super::{Header, ReadRecording, RunLog, schema};
use crate::error::RecordError;
use crate::json;
use crate::motion::JointSample;
use crate::shared::{Places, Shared};
use crate::whole::{Part, ReadFrom, behind_links, folder, sync_folder};

/// Where the metadata hold the plan's hash.
const PLAN: &str = "plan_sha256";

type Mcap = mcap::Writer<BufWriter<File>>;

/// Writes a recording; every accepted measurement is on disk before [`RunLog::measurement`] returns.
pub struct RecordingWriter {
    mcap: Mcap,
    // dropped after what writes to it
    file: Locked,
    path: PathBuf,
    joint_names: Vec<String>,
    shared: Shared,
    start_ns: u64,
    channels: Channels,
    sequences: BTreeMap<u16, u32>,
    last_t: f64,
    /// Whether it was told that the file has lost its name, and what was written is in another file or has another name.
    told: bool,
    /// Where the last measurement ended, and the bytes before that.
    written: (u64, [u8; PROBE]),
}

/// So many bytes before the end are read again at the next measurement: another program may have emptied the file in its place.
const PROBE: usize = 64;
/// So many names are tried for what is rescued.
const MOST_RESCUED: usize = 100;

struct Channels {
    joint_states: u16,
    indicators: u16,
    temperature: u16,
    measurement: u16,
}

impl Channels {
    fn open(mcap: &mut Mcap, shared: &Shared) -> mcap::McapResult<Self> {
        let joint_states = ros_channel(mcap, schema::JOINT_STATES, schema::JOINT_STATE_NAME, schema::JOINT_STATE_TEXT)?;
        let mut json = |topic: &str, (name, text): (&str, String)| {
            let id = mcap.add_schema(name, "jsonschema", text.as_bytes())?;
            mcap.add_channel(id, topic, "json", &BTreeMap::new())
        };
        Ok(Self {
            joint_states,
            indicators: json(schema::INDICATORS, schema::indicators())?,
            temperature: json(schema::TEMPERATURE, schema::temperature())?,
            measurement: json(schema::MEASUREMENT, schema::measurement(shared))?,
        })
    }
}

fn ros_channel(mcap: &mut Mcap, topic: &str, name: &str, text: &str) -> mcap::McapResult<u16> {
    let id = mcap.add_schema(name, "ros2msg", text.as_bytes())?;
    mcap.add_channel(id, topic, "cdr", &BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]))
}

/// Those of a recording that is taken up, and behind them how it is taken up.
fn write_metadata(mcap: &mut Mcap, header: &Header, before: Option<&RawFile>) -> mcap::McapResult<()> {
    let mut metadata = header.settings.clone();
    metadata.insert("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    metadata.insert("start_ns".to_owned(), header.start_ns.to_string());
    metadata.extend(header.plan_sha256.iter().map(|hash| (PLAN.to_owned(), hash.clone())));
    let mut records = before.map(|raw| raw.metadata.clone()).unwrap_or_default();
    if before.is_some() {
        let times = records.iter().filter(|(name, _)| name.starts_with("trical.resumed")).count();
        records.push((format!("trical.resumed.{}", times + 1), metadata));
    } else {
        records.push(("trical".to_owned(), metadata));
    }
    records.into_iter().try_for_each(|(name, metadata)| mcap.write_metadata(&Metadata { name, metadata }))
}

/// Those of a recording that is taken up, and what is new.
fn write_attachments(mcap: &mut Mcap, header: &Header, before: Option<&RawFile>) -> mcap::McapResult<()> {
    let mut attachments = before.map(|raw| raw.attachments.clone()).unwrap_or_default();
    for ours in &header.attachments {
        if !attachments.iter().any(|theirs| theirs.name == ours.name) {
            attachments.push(ours.clone());
        }
    }
    attachments.into_iter().try_for_each(|attachment| {
        mcap.attach(&mcap::Attachment {
            log_time: header.start_ns,
            create_time: header.start_ns,
            name: attachment.name,
            media_type: attachment.media_type,
            data: attachment.data.into(),
        })
    })
}

/// Says whether a recording may be taken up, and writes nothing.
///
/// # Errors
/// As of [`RecordingWriter::resume`].
pub fn check_same(path: &Path, header: &Header) -> Result<ReadRecording, RecordError> {
    read_same(path, header).map(|(_, read)| read)
}

/// A recording that was made with the same robot, cell, plan and joints.
fn read_same(path: &Path, header: &Header) -> Result<(RawFile, ReadRecording), RecordError> {
    let raw = read_raw(path)?;
    let read = interpret(path, &raw)?;
    let different = |what: &str| RecordError::Different { path: path.to_owned(), what: what.to_owned() };
    for ours in &header.attachments {
        if read.attachments.iter().any(|theirs| theirs.name == ours.name && theirs.data != ours.data) {
            return Err(different(&ours.name));
        }
    }
    let plan = read.metadata.get("trical").and_then(|settings| settings.get(PLAN));
    if !raw.messages.is_empty() && plan != header.plan_sha256.as_ref() {
        return Err(different("plan, or does not say with which"));
    }
    if !read.recording.rows.is_empty() && read.recording.joints != header.joint_names.len() {
        return Err(different("number of joints"));
    }
    if read.recording.prismatic.is_some_and(|slides| !read.recording.rows.is_empty() && slides != header.prismatic) {
        return Err(different("unit of a joint"));
    }
    Ok((raw, read))
}

impl RecordingWriter {
    /// Begins a recording in a new file.
    ///
    /// # Errors
    /// The file exists or cannot be written.
    pub fn create(path: &Path, header: &Header) -> Result<Self, RecordError> {
        let path = &behind_links(path).map_err(RecordError::io(path, "follow the links"))?;
        let exists = || RecordError::Exists { path: path.to_owned() };
        lock_existing(path)?.map_or(Ok(()), |_| Err(exists()))?;
        if path.exists() {
            return Err(exists());
        }
        Self::begin(path, header, None, None)
    }

    /// Takes up a recording: everything whole in it is kept, in a new file that then takes its name.
    ///
    /// Gives the writer and what the recording held; `None` where there was no file yet. Times of the recording go on
    /// counting from its own beginning ([`ReadRecording::start_ns`]).
    ///
    /// # Errors
    /// The file cannot be read or written, is no recording, or was made with another robot, cell, plan or number of joints.
    pub fn resume(path: &Path, header: &Header) -> Result<(Self, Option<ReadRecording>), RecordError> {
        let path = &behind_links(path).map_err(RecordError::io(path, "follow the links"))?;
        if !path.exists() {
            return Ok((Self::begin(path, header, None, None)?, None));
        }
        // until the new file has its name
        let old = lock_existing(path)?;
        let (raw, read) = read_same(path, header)?;
        // a file that was cut before its first message says nothing of when it began either
        if raw.messages.is_empty() {
            return Ok((Self::begin(path, header, None, old)?, Some(read)));
        }
        let mut header = header.clone();
        header.start_ns = read.start_ns;
        if let Some(lost) = &read.lost {
            // what could not be taken over is said in the recording itself
            header.settings.insert("recovered".to_owned(), lost.clone());
        }
        let writer = Self::begin(path, &header, Some(&raw), old)?;
        Ok((writer, Some(read)))
    }

    /// Begins in a file beside, which takes the name (of the old one) once its head is whole; nothing is left of one that could not be written.
    fn begin(path: &Path, header: &Header, before: Option<&RawFile>, old: Option<Locked>) -> Result<Self, RecordError> {
        let shared = Shared { prismatic: header.prismatic, ..Shared::for_joints(header.joint_names.len()) };
        let (mut writer, part) = Self::begin_beside(path, header, shared, before)?;
        if let Some(raw) = before {
            writer.copy(raw)?;
        }
        writer.sync()?;
        publish(part, path, old)?;
        writer.file.keep_name(path);
        Ok(writer)
    }

    fn begin_beside(
        path: &Path,
        header: &Header,
        shared: Shared,
        before: Option<&RawFile>,
    ) -> Result<(Self, Part), RecordError> {
        let (part, file) = Part::of(path).map_err(RecordError::io(path, "create"))?;
        let file = lock(file, path)?;
        let failed = || RecordError::mcap(path);
        let stream = file.try_clone().map_err(RecordError::io(path, "write"))?;
        // not compressed: a chunk that was cut still gives its messages, and the files are small
        let mut mcap = mcap::WriteOptions::new()
            .compression(None)
            .profile("ros2")
            .library(format!("trical {}", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::new(stream))
            .map_err(failed())?;

        write_metadata(&mut mcap, header, before).map_err(failed())?;
        write_attachments(&mut mcap, header, before).map_err(failed())?;
        let channels = Channels::open(&mut mcap, &shared).map_err(failed())?;
        let description = match (&header.robot_description, before) {
            (Some(text), None) => {
                let id = ros_channel(&mut mcap, schema::ROBOT_DESCRIPTION, schema::STRING_NAME, schema::STRING_TEXT)
                    .map_err(failed())?;
                Some((id, cdr::string_to_cdr(text)))
            }
            _ => None,
        };
        let mut writer = Self {
            mcap,
            file,
            path: path.to_owned(),
            joint_names: header.joint_names.clone(),
            shared,
            start_ns: header.start_ns,
            channels,
            sequences: BTreeMap::new(),
            last_t: 0.0,
            told: false,
            written: (0, [0; PROBE]),
        };
        if let Some((id, data)) = description {
            writer.message(id, 0.0, &data)?;
        }
        Ok((writer, part))
    }

    /// Copies all messages of an older file, with their times and numbers.
    fn copy(&mut self, raw: &RawFile) -> Result<(), RecordError> {
        let mut ids: BTreeMap<u16, u16> = BTreeMap::new();
        for (old, channel) in &raw.channels {
            let schema = channel.schema.as_ref();
            let schema = schema.map(|s| self.mcap.add_schema(&s.name, &s.encoding, &s.data)).transpose();
            let schema = schema.map_err(RecordError::mcap(&self.path))?.unwrap_or(0);
            let id = self.mcap.add_channel(schema, &channel.topic, &channel.encoding, &channel.metadata);
            ids.insert(*old, id.map_err(RecordError::mcap(&self.path))?);
        }
        for message in &raw.messages {
            let Some(channel_id) = ids.get(&message.channel).copied() else { continue };
            let RawMessage { sequence, log_time, publish_time, .. } = *message;
            let header = MessageHeader { channel_id, sequence, log_time, publish_time };
            self.mcap.write_to_known_channel(&header, &message.data).map_err(RecordError::mcap(&self.path))?;
            let next = self.sequences.entry(channel_id).or_insert(0);
            *next = (*next).max(message.sequence.saturating_add(1));
            self.last_t = self.last_t.max(message.log_time.saturating_sub(self.start_ns) as f64 * 1e-9);
        }
        Ok(())
    }

    /// Time of the last message, in s since the recording began.
    #[must_use]
    pub fn last_t(&self) -> f64 {
        self.last_t
    }

    /// When the recording began, in ns since 1970.
    #[must_use]
    pub fn start_ns(&self) -> u64 {
        self.start_ns
    }

    /// Writes the index and ends the file.
    ///
    /// # Errors
    /// The file cannot be written, or has no name any more.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.end()?;
        self.check_there()
    }

    /// What is written into a file that was removed is lost when it is closed: it is written again. A file that was moved still holds it.
    fn check_there(&mut self) -> Result<(), RecordError> {
        let path = behind_links(&self.path).unwrap_or_else(|_| self.path.clone());
        if let Err(why) = self.check_as_written() {
            return Err(RecordError::Removed { path, saved: Err(why) });
        }
        if self.told || is_at(&self.file, &path) {
            return Ok(());
        }
        if has_a_name(&self.file) {
            self.told = true;
            return Err(RecordError::Moved { path });
        }
        let saved = self.rescue(&path);
        self.told = saved.is_ok();
        Err(RecordError::Removed { path, saved })
    }

    /// Copies what was written under the name that it had, or under a free one where another file has that by now.
    fn rescue(&self, path: &Path) -> std::io::Result<PathBuf> {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut to = path.to_owned();
        let mut copy = File::create_new(&to);
        for number in 1..=MOST_RESCUED {
            if !copy.as_ref().is_err_and(|e| e.kind() == ErrorKind::AlreadyExists) {
                break;
            }
            to = path.with_file_name(format!("{stem}.rescued-{number}.mcap"));
            copy = File::create_new(&to);
        }
        let mut copy = copy?;
        std::io::copy(&mut ReadFrom::new(&self.file, 0), &mut copy)
            .and_then(|_| copy.sync_all())
            // of a disk that is full: a part of a recording under that name would be taken for all of it
            .inspect_err(|_| drop(std::fs::remove_file(&to)))?;
        Ok(to)
    }

    /// What stood before the end at the last measurement has to stand there still; what stands before the end now is kept for the next time.
    fn check_as_written(&mut self) -> std::io::Result<()> {
        let mut file: &File = &self.file;
        let end = file.stream_position()?;
        let read = |to: u64| {
            let mut bytes = [0; PROBE];
            let from = to.saturating_sub(PROBE as u64);
            ReadFrom::new(file, from).read_exact(&mut bytes).map(|()| bytes)
        };
        let (before, bytes) = self.written;
        if before > 0 && read(before).ok() != Some(bytes) {
            return Err(std::io::Error::other("another program has written into it"));
        }
        self.written = (end, read(end)?);
        Ok(())
    }

    fn end(&mut self) -> Result<(), RecordError> {
        self.mcap.finish().map_err(RecordError::mcap(&self.path))?;
        self.file.sync_all().map_err(RecordError::io(&self.path, "write to the disk"))
    }

    fn message(&mut self, channel_id: u16, t: f64, data: &[u8]) -> Result<(), RecordError> {
        self.published(channel_id, t, t, data)
    }

    /// Writes a message logged at `t` of what was at `published` (s since the recording began).
    fn published(&mut self, channel_id: u16, t: f64, published: f64, data: &[u8]) -> Result<(), RecordError> {
        self.last_t = self.last_t.max(t);
        let [log_time, publish_time] = [t, published].map(|t| self.log_time(t));
        let next = self.sequences.entry(channel_id).or_insert(0);
        let header = MessageHeader { channel_id, sequence: *next, log_time, publish_time };
        *next = next.wrapping_add(1);
        self.mcap.write_to_known_channel(&header, data).map_err(RecordError::mcap(&self.path))
    }

    fn log_time(&self, t: f64) -> u64 {
        self.start_ns.saturating_add((t.max(0.0) * 1e9).round() as u64)
    }

    fn sync(&mut self) -> Result<(), RecordError> {
        self.mcap.flush().map_err(RecordError::mcap(&self.path))?;
        self.file.sync_data().map_err(RecordError::io(&self.path, "write to the disk"))
    }
}

impl RunLog for RecordingWriter {
    fn joint_state(&mut self, sample: &JointSample) -> Result<(), RecordError> {
        let stamp = self.log_time(sample.t);
        let message = JointState {
            seconds: (stamp / 1_000_000_000) as i32,
            nanoseconds: (stamp % 1_000_000_000) as u32,
            frame: "base_link".to_owned(),
            names: self.joint_names.clone(),
            position: sample.q.iter().take(self.joint_names.len()).copied().collect(),
            velocity: Vec::new(),
            effort: Vec::new(),
        };
        self.message(self.channels.joint_states, sample.t, &message.to_cdr())
    }

    fn indicators(&mut self, t: f64, reading: &[f64; 3], settled: bool) -> Result<(), RecordError> {
        let text = json::indicators_to_json(t, reading, settled);
        self.message(self.channels.indicators, t, text.as_bytes())
    }

    fn temperature(&mut self, t: f64, temp_c: f64) -> Result<(), RecordError> {
        let text = json::temperature_to_json(t, temp_c);
        self.message(self.channels.temperature, t, text.as_bytes())
    }

    fn measurement(&mut self, row: &Row) -> Result<(), RecordError> {
        let text = json::row_to_json(row, &self.shared);
        // a row that the reader refuses would take those before it along
        json::row_from_json(text.as_bytes(), &mut Places::default())
            .map_err(|problem| RecordError::NotReadable { path: self.path.clone(), problem })?;
        // what the recording holds stands in the order of time; published is when it was measured, though it is accepted later
        let measured = row.state.t.unwrap_or(self.last_t);
        self.published(self.channels.measurement, self.last_t.max(measured), measured, text.as_bytes())?;
        self.sync()?;
        self.check_there()
    }
}

/// Writes a recording that is whole already, e.g. one that was read from CSV. A file of that name is replaced, once the
/// new one is whole.
///
/// # Errors
/// The file cannot be written.
pub fn write_recording(path: &Path, recording: &Recording, header: &Header) -> Result<(), RecordError> {
    let path = &behind_links(path).map_err(RecordError::io(path, "follow the links"))?;
    let (mut writer, part) = RecordingWriter::begin_beside(path, header, Shared::of(recording), None)?;
    for row in &recording.rows {
        let text = json::row_to_json(row, &writer.shared);
        let t = row.state.t.unwrap_or(writer.last_t);
        writer.message(writer.channels.measurement, t, text.as_bytes())?;
    }
    // a recording that another program writes is not replaced
    let old = lock_existing(path)?;
    writer.end()?;
    drop(writer);
    publish(part, path, old)
}

/// Gives the file beside its name, that of an old one perhaps.
fn publish(part: Part, path: &Path, old: Option<Locked>) -> Result<(), RecordError> {
    // a file that is open is replaced by Windows on few file systems
    #[cfg(windows)]
    drop(old);
    part.put().map_err(RecordError::io(path, "put the new file there"))?;
    // so that the rename lasts
    let folder = folder(path);
    sync_folder(folder).map_err(RecordError::io(folder, "write to the disk"))?;
    #[cfg(not(windows))]
    drop(old);
    Ok(())
}
