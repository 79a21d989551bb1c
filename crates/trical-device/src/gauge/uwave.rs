//! Driver for three indicators with transmitters on one Mitutoyo U-WAVE-R receiver.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use super::port::{Lines, Port, SerialSettings};
use super::uwave_protocol::{self as protocol, Record, Status};
use super::{AXES, Gauge, GaugeError, Settle, shorten};

/// Settings of a U-WAVE-R and its three transmitters.
#[derive(Clone, Debug, PartialEq)]
pub struct UWaveSettings {
    /// Channels of the indicators along x, y, z of the device.
    pub channels: [u8; 3],
    /// Group of each.
    pub groups: [u8; 3],
    /// Which axes read with the opposite sign.
    pub flip: [bool; 3],
    /// Time-out of one attempt. In use elsewhere: 1.1 s to 3 s.
    pub timeout: Duration,
    /// Attempts for each reading.
    pub attempts: u32,
    /// Pause between requests. In use elsewhere: 0.25 s.
    pub interval: Duration,
    /// Make the receiver forget each value that was read (`w` = 1): then only a value that has changed since is
    /// answered, and a spindle that stands still reads as "no data". For looking at a receiver; a measurement, which
    /// waits for readings that repeat, keeps the values.
    pub clear: bool,
    /// When a reading stands still.
    pub settle: Settle,
    /// Take a value without a unit (`0`) as mm. Off: such a value is an error.
    pub assume_mm: bool,
}

impl Default for UWaveSettings {
    fn default() -> Self {
        Self {
            channels: [0, 1, 2],
            groups: [0; 3],
            flip: [false; 3],
            timeout: Duration::from_millis(1500),
            attempts: 3,
            interval: Duration::from_millis(250),
            clear: false,
            settle: Settle::default(),
            assume_mm: false,
        }
    }
}

impl UWaveSettings {
    /// The receiver's port: 57600 8N1.
    #[must_use]
    pub fn serial() -> SerialSettings {
        SerialSettings::new(57600)
    }
}

/// Three indicators behind one receiver.
///
/// The receiver also sends by itself (buttons, batteries), so records are told apart by kind and channel, and what came
/// before a request is no answer to it. Values are read with `w` = 0 unless told otherwise: with `w` = 1 a still spindle may then answer
/// "no data" \[I\]; and "no data" is never taken for zero.
pub struct UWave<P> {
    port: P,
    name: String,
    settings: UWaveSettings,
    lines: Lines,
    warnings: Vec<String>,
    low_batteries: BTreeSet<u8>,
    last_request: Option<Instant>,
}

enum Attempt {
    Value(f64),
    Status(Status),
    Nothing,
    Garbage(Vec<u8>),
}

impl<P: Port> UWave<P> {
    /// A driver on an open port; `name` is for messages.
    pub fn new(port: P, name: impl Into<String>, settings: UWaveSettings) -> Self {
        Self {
            port,
            name: name.into(),
            settings,
            lines: Lines::default(),
            warnings: Vec::new(),
            low_batteries: BTreeSet::new(),
            last_request: None,
        }
    }

    /// What the receiver says of itself.
    ///
    /// # Errors
    /// No or a wrong answer.
    pub fn receiver_information(&mut self, group: u8) -> Result<Record, GaugeError> {
        let request = protocol::receiver_request(group);
        self.information(&request, |record| matches!(record, Record::Receiver { group: g, .. } if *g == group))
    }

    /// What the receiver says of the first transmitter of a group at or after a channel; a status where there is none.
    ///
    /// # Errors
    /// No or a wrong answer.
    pub fn transmitter_information(&mut self, channel: u8, group: u8) -> Result<Record, GaugeError> {
        let request = protocol::transmitter_request(channel, group);
        self.information(&request, |record| match record {
            Record::Transmitter { channel: c, group: g, .. } => *c >= channel && *g == group,
            // batteries and radio faults come unasked
            Record::Status { status, .. } => matches!(status, Status::EndOfSearch | Status::BadRequest),
            _ => false,
        })
    }

    /// All transmitters of a group, by channel.
    ///
    /// # Errors
    /// No or a wrong answer.
    pub fn transmitters(&mut self, group: u8) -> Result<Vec<Record>, GaugeError> {
        let mut found = Vec::new();
        let mut next = 0;
        while next <= 99 {
            let record = self.transmitter_information(next, group)?;
            let Record::Transmitter { channel, .. } = record else { break };
            next = channel + 1;
            found.push(record);
        }
        Ok(found)
    }

    fn information(&mut self, request: &str, wanted: impl Fn(&Record) -> bool) -> Result<Record, GaugeError> {
        for _ in 0..self.settings.attempts.max(1) {
            self.send(request)?;
            let deadline = Instant::now() + self.settings.timeout;
            while let Some(line) = self.wait(deadline)? {
                if let Some(record) = protocol::parse_record(&line) {
                    if wanted(&record) {
                        return Ok(record);
                    }
                    self.note(&record);
                }
            }
        }
        Err(self.silent('-', request))
    }

    fn io(&self, source: std::io::Error) -> GaugeError {
        GaugeError::Io { gauge: self.name.clone(), source }
    }

    fn silent(&self, axis: char, request: &str) -> GaugeError {
        GaugeError::Silent {
            gauge: self.name.clone(),
            axis,
            request: request.trim_end().to_owned(),
            attempts: self.settings.attempts.max(1),
            seconds: self.settings.timeout.as_secs_f64(),
        }
    }

    fn garbage(&self, axis: usize, found: &[u8], expected: &str) -> GaugeError {
        let (gauge, found) = (self.name.clone(), shorten(found));
        GaugeError::Garbage { gauge, axis: AXES[axis], found, expected: expected.to_owned() }
    }

    fn wait(&mut self, deadline: Instant) -> Result<Option<Vec<u8>>, GaugeError> {
        let Self { lines, port, .. } = self;
        let line = lines.wait(port, deadline);
        line.map_err(|source| self.io(source))
    }

    /// Keeps the pause between requests, takes note of what has come meanwhile, then sends.
    fn send(&mut self, request: &str) -> Result<(), GaugeError> {
        if let Some(last) = self.last_request {
            let since = last.elapsed();
            if since < self.settings.interval {
                std::thread::sleep(self.settings.interval - since);
            }
        }
        let drained = self.lines.drain(&mut self.port);
        drained.map_err(|source| self.io(source))?;
        while let Some(line) = self.lines.next_line() {
            if let Some(record) = protocol::parse_record(&line) {
                self.note(&record);
            }
        }
        self.lines.clear();
        let sent = self.port.write_all(request.as_bytes()).and_then(|()| self.port.flush());
        self.last_request = Some(Instant::now());
        sent.map_err(|source| self.io(source))
    }

    /// Takes note of a record that answers nothing: only low batteries matter.
    fn note(&mut self, record: &Record) {
        if let Record::Status { channel: Some(channel), status: Status::BatteryLow, .. } = record
            && self.low_batteries.insert(*channel)
        {
            self.warnings.push(format!(
                "gauge {}: the battery of the transmitter on channel {channel:02} is low; replace it soon",
                self.name
            ));
        }
    }

    fn attempt(&mut self, axis: usize, request: &str) -> Result<Attempt, GaugeError> {
        let (channel, group) = (self.settings.channels[axis], self.settings.groups[axis]);
        self.send(request)?;
        let deadline = Instant::now() + self.settings.timeout;
        let mut garbage = None;
        while let Some(line) = self.wait(deadline)? {
            match protocol::parse_record(&line) {
                Some(Record::Data { group: g, channel: c, value, unit }) if g == group && c == channel => {
                    let in_metres = unit.in_metres().or(self.settings.assume_mm.then_some(1e-3));
                    let expected = "a value with a unit (M or I); unit=mm in the URL takes it as mm";
                    let in_metres = in_metres.ok_or_else(|| self.garbage(axis, &line, expected))?;
                    return Ok(Attempt::Value(value * in_metres));
                }
                // FF: not about one channel; a refused request is then ours, the only one under way
                Some(Record::Status { group: g, channel: c, status, .. })
                    if g.is_none_or(|g| g == group)
                        && c.is_none_or(|c| c == channel)
                        && !matches!(status, Status::BatteryLow | Status::EndOfSearch) =>
                {
                    return Ok(Attempt::Status(status));
                }
                Some(record) => self.note(&record),
                None => garbage = Some(line),
            }
        }
        if garbage.is_none() && !self.lines.rest().is_empty() {
            garbage = Some(self.lines.rest().to_vec());
        }
        Ok(garbage.map_or(Attempt::Nothing, Attempt::Garbage))
    }

    fn read_axis(&mut self, axis: usize) -> Result<f64, GaugeError> {
        let (channel, group) = (self.settings.channels[axis], self.settings.groups[axis]);
        let request = protocol::data_request(channel, group, self.settings.clear);
        let mut error = self.silent(AXES[axis], &request);
        for _ in 0..self.settings.attempts.max(1) {
            error = match self.attempt(axis, &request)? {
                Attempt::Value(value) => return Ok(value),
                Attempt::Status(status) => {
                    let error = GaugeError::Status { gauge: self.name.clone(), axis: AXES[axis], channel, status };
                    if !status.is_worth_a_retry() {
                        return Err(error);
                    }
                    error
                }
                Attempt::Garbage(found) => {
                    self.garbage(axis, &found, "a record of a U-WAVE-R; check that the port is the receiver's")
                }
                Attempt::Nothing => self.silent(AXES[axis], &request),
            };
        }
        Err(error)
    }
}

impl<P: Port> Gauge for UWave<P> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn read(&mut self) -> Result<[f64; 3], GaugeError> {
        let mut reading = [0.0; 3];
        for (axis, to) in reading.iter_mut().enumerate() {
            let value = self.read_axis(axis)?;
            *to = if self.settings.flip[axis] { -value } else { value };
        }
        Ok(reading)
    }

    fn settle(&self) -> Settle {
        self.settings.settle.clone()
    }

    fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn describe(&mut self) -> Result<Vec<String>, GaugeError> {
        let mut lines = Vec::new();
        let groups: BTreeSet<u8> = self.settings.groups.into_iter().collect();
        for group in groups {
            if let Record::Receiver { id, rest, .. } = self.receiver_information(group)? {
                lines.push(format!("receiver of group {group:02}: id {id}, it says {rest:?}"));
            }
            for record in self.transmitters(group)? {
                let Record::Transmitter { state, channel, id, band, event_mode, .. } = record else { continue };
                let axis = (0..3).find(|k| self.settings.channels[*k] == channel && self.settings.groups[*k] == group);
                let axis = axis.map_or_else(|| "not used here".to_owned(), |k| format!("axis {}", AXES[k]));
                let mode = if event_mode { "event mode" } else { "button mode: it sends on its button only" };
                lines.push(format!(
                    "transmitter on channel {group:02}.{channel:02} ({axis}): id {id}, state {state}, band {band}, {mode}"
                ));
            }
        }
        Ok(lines)
    }
}
