//! One tolerant driver for gauges that answer a request with a line of text.

use std::time::{Duration, Instant};

use super::line_protocol::{LineReply, Pattern, parse_line};
use super::port::{Lines, Port, SerialSettings};
use super::uwave_protocol::Unit;
use super::{AXES, Gauge, GaugeError, Settle, shorten};

/// A kind of gauge that answers a line of text to a request.
#[derive(Clone, Copy, Debug)]
pub struct LineKind {
    /// What its URLs begin with.
    pub scheme: &'static str,
    /// Maker and device.
    pub device: &'static str,
    serial: SerialSettings,
    request: &'static str,
    pattern: &'static str,
}

const fn of(
    scheme: &'static str,
    serial: SerialSettings,
    request: &'static str,
    pattern: &'static str,
    device: &'static str,
) -> LineKind {
    LineKind { scheme, device, serial, request, pattern }
}

/// One line each: scheme, port, request, reply, device. Messages, the help of `trical gauge` and the table of docs/cell.md follow.
/// Baud rates of TESA and Millimar are not known \[I\]: 9600 here, and a setting.
pub const LINE_GAUGES: &[LineKind] = &[
    of("itn", SerialSettings::new(9600), "1\r", "01A{v}", "Mitutoyo USB-ITN"),
    of("opto", SerialSettings { baud: 4800, data_bits: 7, parity: 'E', stop_bits: 2 }, "?\r", "{v}", "Sylvac Opto-RS"),
    of("tesa", SerialSettings::new(9600), "?\r", "{v}", "TESA TT80"),
    of("millimar", SerialSettings::new(9600), "?\r", "{v}", "Mahr Millimar C1208/16/40"),
    of("pico", SerialSettings::new(115_200), "1", "{v}", "Pico Digimatic adaptor"),
    of("line", SerialSettings::new(9600), "?\r", "{v}", "anything else that answers a line"),
];

/// No indicator has a longer stroke, m: a larger reading is in another unit, or is none.
const LONGEST: f64 = 0.1;

/// Settings of a line gauge.
#[derive(Clone, Debug, PartialEq)]
pub struct LineSettings {
    /// Baud rate and framing.
    pub serial: SerialSettings,
    /// What to send for a reading of each axis; on one port, three requests ask for three channels.
    pub requests: [String; 3],
    /// Form of the reply.
    pub pattern: Pattern,
    /// Metres per unit of a value that names no unit. A unit that the reply names goes before it.
    pub scale: f64,
    /// Which axes read with the opposite sign.
    pub flip: [bool; 3],
    /// Time-out of one attempt.
    pub timeout: Duration,
    /// Attempts for each reading.
    pub attempts: u32,
    /// When a reading stands still.
    pub settle: Settle,
    /// Pause before a busy instrument is asked again.
    pub busy_pause: Duration,
    /// How often a busy instrument is asked again.
    pub busy_attempts: u32,
}

impl LineSettings {
    /// Settings for one of [`LINE_GAUGES`] by its scheme.
    #[must_use]
    pub fn preset(name: &str) -> Option<Self> {
        let LineKind { serial, request, pattern, .. } = *LINE_GAUGES.iter().find(|kind| kind.scheme == name)?;
        Some(Self {
            serial,
            requests: std::array::from_fn(|_| request.to_owned()),
            pattern: Pattern::parse(pattern)?,
            scale: 1e-3,
            flip: [false; 3],
            timeout: Duration::from_secs(1),
            attempts: 3,
            settle: Settle::default(),
            busy_pause: Duration::from_millis(50),
            busy_attempts: 5,
        })
    }
}

/// Three line gauges on three ports, or one with three channels, or one that answers three values at once.
///
/// An answer does not say which request it is to. After a time-out, or a line that is no answer, the port has to be silent for as long as an
/// answer may take: what comes meanwhile is no value.
pub struct LineGauge<P> {
    ports: Vec<(P, Lines)>,
    name: String,
    settings: LineSettings,
}

impl<P: Port> LineGauge<P> {
    /// A driver on open ports: one, or three for x, y, z. `name` is for messages.
    ///
    /// # Errors
    /// Another number of ports.
    pub fn new(ports: Vec<P>, name: impl Into<String>, settings: LineSettings) -> Result<Self, GaugeError> {
        let name = name.into();
        if !matches!(ports.len(), 1 | 3) {
            return Err(GaugeError::Open {
                port: name,
                reason: format!("{} ports; expected one, or three for x, y, z", ports.len()),
            });
        }
        Ok(Self { ports: ports.into_iter().map(|port| (port, Lines::default())).collect(), name, settings })
    }

    /// Asks one port once, with patience for a busy instrument.
    fn ask(&mut self, axis: usize) -> Result<Vec<f64>, GaugeError> {
        let port_index = if self.ports.len() == 3 { axis } else { 0 };
        let settings = &self.settings;
        let request = &settings.requests[axis];
        let (gauge, axis) = (self.name.clone(), AXES[axis]);
        let Some((port, lines)) = self.ports.get_mut(port_index) else {
            return Err(GaugeError::Open { port: gauge, reason: "no port".to_owned() });
        };
        let io = |source| GaugeError::Io { gauge: self.name.clone(), source };
        let mut busy = 0;
        let mut attempt = 0;
        let mut garbage: Option<Vec<u8>> = None;
        while attempt < settings.attempts.max(1) {
            lines.drain(port).map_err(io)?;
            while lines.next_line().is_some() {}
            // what a device without a pause has begun to say is no answer, and its rest is no value
            let begun = !lines.rest().is_empty();
            lines.clear();
            port.write_all(request.as_bytes()).and_then(|()| port.flush()).map_err(io)?;
            let deadline = Instant::now() + settings.timeout;
            let mut line = lines.wait(port, deadline).map_err(io)?;
            if begun && line.is_some() {
                line = lines.wait(port, deadline).map_err(io)?;
            }
            let reply = line.as_ref().map(|line| parse_line(line, &settings.pattern));
            // an answer after one that did not come may be that one, and another may follow
            if attempt > 0 || matches!(reply, None | Some(LineReply::Garbage)) {
                lines.fall_silent(port, settings.timeout).map_err(io)?;
            }
            let (Some(line), Some(reply)) = (line, reply) else {
                attempt += 1;
                continue;
            };
            match reply {
                LineReply::Values(values) => {
                    let readings: Vec<f64> = values
                        .into_iter()
                        .map(|(value, unit): (f64, Unit)| value * unit.in_metres().unwrap_or(settings.scale))
                        .collect();
                    if readings.iter().any(|m| m.abs() > LONGEST) {
                        let expected = "a reading within 100 mm; check unit, scale and pattern".to_owned();
                        return Err(GaugeError::Garbage { gauge, axis, found: shorten(&line), expected });
                    }
                    return Ok(readings);
                }
                LineReply::Busy if busy < settings.busy_attempts => {
                    busy += 1;
                    std::thread::sleep(settings.busy_pause);
                }
                reply @ (LineReply::Busy | LineReply::Error(_)) => {
                    let meaning = if let LineReply::Error(meaning) = reply { meaning } else { "busy" };
                    return Err(GaugeError::Instrument { gauge, axis, found: shorten(&line), meaning });
                }
                LineReply::Garbage => {
                    garbage = Some(line);
                    attempt += 1;
                }
            }
        }
        Err(match garbage {
            Some(found) => GaugeError::Garbage {
                gauge,
                axis,
                found: shorten(&found),
                expected: "a line with a value; check baud rate, framing and pattern".to_owned(),
            },
            None => GaugeError::Silent {
                gauge,
                axis,
                request: request.trim_end().to_owned(),
                attempts: settings.attempts.max(1),
                seconds: settings.timeout.as_secs_f64(),
            },
        })
    }
}

impl<P: Port> Gauge for LineGauge<P> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn read(&mut self) -> Result<[f64; 3], GaugeError> {
        let mut reading = [0.0; 3];
        if self.settings.pattern.values() == 3 {
            for (to, from) in reading.iter_mut().zip(self.ask(0)?) {
                *to = from;
            }
        } else {
            for (axis, value) in reading.iter_mut().enumerate() {
                *value = self.ask(axis)?.first().copied().unwrap_or(f64::NAN);
            }
        }
        for (value, flip) in reading.iter_mut().zip(self.settings.flip) {
            if flip {
                *value = -*value;
            }
        }
        Ok(reading)
    }

    fn settle(&self) -> Settle {
        self.settings.settle.clone()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::VecDeque;
    use std::io::{self, Read, Write};

    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(60);

    /// Answers 1.111 to A, 2.222 to B and 3.333 to C: the first time half of it at once and the rest after the time-out, or all of it then.
    struct Late {
        first: usize,
        asked: usize,
        due: VecDeque<(Instant, Vec<u8>)>,
    }

    impl Write for Late {
        fn write(&mut self, request: &[u8]) -> io::Result<usize> {
            let n = f64::from(request[0] - b'A' + 1);
            let reply = format!("+{:08.3}\r", 1.111 * n).into_bytes();
            let (now, rest) = (Instant::now(), reply[self.first..].to_vec());
            self.asked += 1;
            match self.asked {
                1 => self.due.extend([(now, reply[..self.first].to_vec()), (now + TIMEOUT * 3 / 2, rest)]),
                // later than the rest of the first one
                3 => self.due.push_back((now + TIMEOUT * 4 / 5, reply)),
                _ => self.due.push_back((now, reply)),
            }
            self.due.make_contiguous().sort_by_key(|(when, _)| *when);
            Ok(request.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Read for Late {
        fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
            match self.due.pop_front_if(|(when, _)| *when <= Instant::now()) {
                Some((_, bytes)) if !bytes.is_empty() => (&bytes[..]).read(into),
                _ => {
                    std::thread::sleep(Duration::from_millis(1));
                    Err(io::ErrorKind::TimedOut.into())
                }
            }
        }
    }

    impl Port for Late {
        fn waiting(&mut self) -> io::Result<usize> {
            Ok(self.due.iter().filter(|(when, _)| *when <= Instant::now()).map(|(_, bytes)| bytes.len()).sum())
        }
    }

    #[test]
    fn an_answer_that_comes_too_late_is_none_of_another_axis_nor_is_its_second_half() {
        for first in [0, 6] {
            let requests = ["A", "B", "C"].map(str::to_owned);
            let settings = LineSettings { requests, timeout: TIMEOUT, ..LineSettings::preset("line").unwrap() };
            let port = Late { first, asked: 0, due: VecDeque::new() };
            let mut gauge = LineGauge::new(vec![port], "late", settings).unwrap();
            // under load each attempt may be too late
            if let Ok(reading) = gauge.read() {
                assert_eq!(reading.map(|v| (v * 1e6).round()), [1111.0, 2222.0, 3333.0]);
            }
        }
    }

    #[test]
    fn the_rest_of_what_a_device_had_begun_to_say_is_no_value() {
        struct Talks(VecDeque<&'static [u8]>);
        impl Read for Talks {
            fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
                self.0.pop_front().map_or(Err(io::ErrorKind::TimedOut.into()), |mut bytes| bytes.read(into))
            }
        }
        impl Write for Talks {
            fn write(&mut self, request: &[u8]) -> io::Result<usize> {
                self.0.extend([&b"11\r"[..], b"+0002.222\r"]);
                Ok(request.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        impl Port for Talks {
            fn waiting(&mut self) -> io::Result<usize> {
                Ok(self.0.iter().map(|bytes| bytes.len()).sum())
            }
        }
        let settings = LineSettings { timeout: Duration::from_secs(5), ..LineSettings::preset("line").unwrap() };
        let mut gauge = LineGauge::new(vec![Talks([&b"+0001.1"[..]].into())], "talks", settings).unwrap();
        let found = gauge.ask(0).unwrap();
        assert!((found[0] - 2.222e-3).abs() < 1e-12, "{found:?}");
    }
}
