//! Byte ports under gauges and controllers: serial ports, TCP, and whatever a test puts in their place.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

use super::GaugeError;
use crate::connection::connected;

/// A read ends after this, whether something came or not.
const READ_WITHIN: Duration = Duration::from_millis(20);

/// A serial device server answers within this.
const CONNECT_WITHIN: Duration = Duration::from_secs(5);

/// A two-way byte port with a short read time-out of its own.
///
/// `read` returns what is there, or an error of kind `TimedOut` or `WouldBlock` after a few milliseconds.
pub trait Port: Read + Write + Send {
    /// Number of bytes that wait to be read, without blocking.
    ///
    /// # Errors
    /// The port is gone.
    fn waiting(&mut self) -> io::Result<usize>;
}

impl Port for Box<dyn serialport::SerialPort> {
    fn waiting(&mut self) -> io::Result<usize> {
        Ok(self.bytes_to_read()? as usize)
    }
}

/// Tells no more than whether bytes wait: 1, or 0.
impl Port for std::net::TcpStream {
    fn waiting(&mut self) -> io::Result<usize> {
        self.set_nonblocking(true)?;
        let found = self.peek(&mut [0]);
        self.set_nonblocking(false)?;
        match found {
            Err(error) if is_not_yet(&error) => Ok(0),
            // the end of the stream is told by who reads it
            found => found,
        }
    }
}

impl<P: Port + ?Sized> Port for Box<P> {
    fn waiting(&mut self) -> io::Result<usize> {
        (**self).waiting()
    }
}

/// Baud rate and framing of a serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialSettings {
    /// Bits per second.
    pub baud: u32,
    /// Data bits, 5 to 8.
    pub data_bits: u8,
    /// `N`, `E` or `O`.
    pub parity: char,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

impl SerialSettings {
    /// 8 data bits, no parity, 1 stop bit.
    #[must_use]
    pub const fn new(baud: u32) -> Self {
        Self { baud, data_bits: 8, parity: 'N', stop_bits: 1 }
    }

    /// Takes a framing such as `8N1` or `7E2`.
    #[must_use]
    pub fn with_framing(self, framing: &str) -> Option<Self> {
        let mut letters = framing.chars();
        let data_bits = letters.next()?.to_digit(10).filter(|bits| (5..=8).contains(bits))?;
        let parity = letters.next()?.to_ascii_uppercase();
        let stop_bits = letters.next()?.to_digit(10).filter(|bits| (1..=2).contains(bits))?;
        if letters.next().is_some() || !"NEO".contains(parity) {
            return None;
        }
        Some(Self { data_bits: data_bits as u8, parity, stop_bits: stop_bits as u8, ..self })
    }
}

/// Opens the place of a gauge's URL: `HOST:PORT`, a serial device server, in which baud rate and framing are set; or else a serial port of this
/// computer.
///
/// # Errors
/// As of [`open_serial`], or nothing answers at the address.
pub(super) fn open_port(place: &str, settings: &SerialSettings) -> Result<Box<dyn Port>, GaugeError> {
    if !is_address(place) {
        return Ok(Box::new(open_serial(place, settings)?));
    }
    let failed = |reason| GaugeError::Open { port: place.to_owned(), reason };
    Ok(Box::new(connected(place, CONNECT_WITHIN, READ_WITHIN).map_err(failed)?))
}

/// Whether a place is `HOST:PORT`: no path, as those of serial ports are (`/dev/serial/by-path/pci-0000:00:14.0`).
fn is_address(place: &str) -> bool {
    let port = |(host, port): (&str, &str)| !host.is_empty() && port.parse::<u16>().is_ok();
    !place.contains(['/', '\\']) && place.rsplit_once(':').is_some_and(port)
}

/// Opens a serial port with DTR and RTS high and no handshake.
///
/// A real port is opened exclusively: there can be one reader only. A pseudo-terminal is not, since the lock of a
/// reader that was killed would outlive it there.
///
/// # Errors
/// The port is missing, in use, or not permitted.
pub fn open_serial(path: &str, settings: &SerialSettings) -> Result<Box<dyn serialport::SerialPort>, GaugeError> {
    use serialport::{DataBits, FlowControl, Parity, SerialPort, StopBits};
    let failed = |error: &dyn std::fmt::Display| GaugeError::Open { port: path.to_owned(), reason: error.to_string() };
    // the lock is of the device, whatever link leads to it; `COM3` is no file
    #[cfg(unix)]
    let path = std::fs::canonicalize(path).map_err(|error| failed(&error))?.display().to_string();
    let is_pseudo = cfg!(unix) && path.starts_with("/dev/pts/");
    let builder = serialport::new(path, settings.baud)
        .data_bits(match settings.data_bits {
            5 => DataBits::Five,
            6 => DataBits::Six,
            7 => DataBits::Seven,
            _ => DataBits::Eight,
        })
        .parity(match settings.parity {
            'E' => Parity::Even,
            'O' => Parity::Odd,
            _ => Parity::None,
        })
        .stop_bits(if settings.stop_bits == 2 { StopBits::Two } else { StopBits::One })
        .flow_control(FlowControl::None)
        .dtr_on_open(true)
        .timeout(READ_WITHIN);
    #[cfg(unix)]
    let mut port = builder.exclusive(!is_pseudo).open_native().map_err(|error| failed(&error))?;
    #[cfg(not(unix))]
    let mut port = builder.open_native().map_err(|error| failed(&error))?;
    // a pseudo-terminal has no such lines
    if !is_pseudo {
        port.write_request_to_send(true).map_err(|error| failed(&error))?;
    }
    Ok(Box::new(port))
}

/// A serial port of this computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// Its path, as it stands in a URL.
    pub path: String,
    /// What hangs on it, as far as the operating system knows.
    pub device: String,
    /// The URL to try, where the device is known.
    pub url: Option<String>,
}

/// The serial ports of this computer, by path; known gauges are recognized by their USB identification.
///
/// # Errors
/// The operating system does not say.
pub fn list_ports() -> Result<Vec<PortInfo>, GaugeError> {
    // listing panics where this folder is missing
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/class/tty").is_dir() {
        return Ok(Vec::new());
    }
    let failed = |e: serialport::Error| GaugeError::Open { port: "list".to_owned(), reason: e.to_string() };
    let mut ports: Vec<PortInfo> = serialport::available_ports().map_err(failed)?.iter().map(known_port).collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

fn known_port(port: &serialport::SerialPortInfo) -> PortInfo {
    let path = port.port_name.clone();
    let (device, url) = match &port.port_type {
        serialport::SerialPortType::UsbPort(usb) => match (usb.vid, usb.pid) {
            (0x0FE7, 0x2002) => ("Mitutoyo U-WAVE-R".to_owned(), Some(format!("uwave://{path}?x=00&y=01&z=02"))),
            (0x0FE7, 0x4001) => ("Mitutoyo USB-ITN".to_owned(), Some(format!("itn://{path},PORT_OF_Y,PORT_OF_Z"))),
            (vid, pid) => {
                let name = usb.product.clone().or_else(|| usb.manufacturer.clone()).unwrap_or_default();
                (format!("USB {vid:04X}:{pid:04X} {name}").trim_end().to_owned(), None)
            }
        },
        serialport::SerialPortType::PciPort => ("serial port of the computer".to_owned(), None),
        serialport::SerialPortType::BluetoothPort => ("Bluetooth".to_owned(), None),
        serialport::SerialPortType::Unknown => ("not known".to_owned(), None),
    };
    PortInfo { path, device, url }
}

/// Whether a read says only that nothing has come so far.
pub(crate) fn is_not_yet(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Splits what a port sends into records that end with CR or LF.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    buffer: Vec<u8>,
}

impl Lines {
    /// No device here sends longer records; more without an end is garbage.
    const LONGEST: usize = 512;

    /// The next whole record, without its end; empty records (the LF of CR LF) are skipped. Records without an end are
    /// handed out when they grow too long.
    pub(crate) fn next_line(&mut self) -> Option<Vec<u8>> {
        loop {
            let end = self.buffer.iter().position(|byte| matches!(byte, b'\r' | b'\n'));
            let line: Vec<u8> = match end {
                Some(end) => self.buffer.drain(..=end).take(end).collect(),
                None if self.buffer.len() >= Self::LONGEST => self.buffer.drain(..).collect(),
                None => return None,
            };
            if !line.is_empty() {
                return Some(line);
            }
        }
    }

    /// What came since the last whole record.
    pub(crate) fn rest(&self) -> &[u8] {
        &self.buffer
    }

    /// Forgets what has come so far.
    pub(crate) fn clear(&mut self) {
        self.buffer.clear();
    }

    /// Reads once from the port; a time-out is no error. Gives whether something came.
    pub(crate) fn fill(&mut self, port: &mut dyn Port) -> io::Result<bool> {
        let mut bytes = [0_u8; 256];
        match port.read(&mut bytes) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the port was closed at its other end")),
            Ok(count) => {
                self.buffer.extend_from_slice(bytes.get(..count).unwrap_or_default());
                Ok(true)
            }
            Err(error) if is_not_yet(&error) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// More than any device has said meanwhile; of one that never ends sending no more is taken in.
    const MOST_WAITING: usize = 65_536;

    /// Records that came in time are looked at so long after the deadline, and those of a device that never ends sending not for ever.
    const LATE: Duration = Duration::from_secs(1);

    /// Takes in all that waits already, without blocking.
    pub(crate) fn drain(&mut self, port: &mut dyn Port) -> io::Result<()> {
        while self.buffer.len() < Self::MOST_WAITING && port.waiting()? > 0 {
            if !self.fill(port)? {
                break;
            }
        }
        Ok(())
    }

    /// Forgets what comes until nothing has come for so long: answers that come too late. A device that never ends sending is not
    /// waited for.
    pub(crate) fn fall_silent(&mut self, port: &mut dyn Port, quiet: Duration) -> io::Result<()> {
        let begin = Instant::now();
        let mut heard = begin;
        loop {
            // looked at before it is read: what came meanwhile is read all the same
            let silent = heard.elapsed() >= quiet;
            if self.fill(port)? {
                heard = Instant::now();
            } else if silent {
                return Ok(());
            }
            self.clear();
            if begin.elapsed() >= 4 * quiet {
                return Ok(());
            }
        }
    }

    /// Waits for a whole record until the deadline.
    pub(crate) fn wait(&mut self, port: &mut dyn Port, deadline: Instant) -> io::Result<Option<Vec<u8>>> {
        loop {
            if Instant::now() >= deadline + Self::LATE {
                return Ok(None);
            }
            if let Some(line) = self.next_line() {
                return Ok(Some(line));
            }
            if Instant::now() >= deadline {
                return Ok(None);
            }
            self.fill(port)?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauges_are_known_by_their_usb_identification() {
        let port = |vid, pid| serialport::SerialPortInfo {
            port_name: "/dev/ttyUSB3".to_owned(),
            port_type: serialport::SerialPortType::UsbPort(serialport::UsbPortInfo {
                vid,
                pid,
                serial_number: None,
                manufacturer: Some("FTDI".to_owned()),
                product: None,
            }),
        };
        let known = known_port(&port(0x0FE7, 0x2002));
        assert_eq!(known.url.as_deref(), Some("uwave:///dev/ttyUSB3?x=00&y=01&z=02"));
        assert_eq!(known_port(&port(0x0403, 0x6001)).device, "USB 0403:6001 FTDI");
        assert!(list_ports().is_ok());
    }

    #[test]
    fn a_place_in_the_network_is_told_from_a_path_and_a_port_of_windows() {
        assert!(["192.168.1.20:4001", "moxa:4001", "[::1]:4001"].into_iter().all(is_address));
        let ports = [
            "/dev/ttyUSB0",
            "/dev/serial/by-path/pci-0000:00:14",
            r"\\.\COM12",
            "COM3",
            ":4001",
            "moxa:",
            "moxa:70000",
        ];
        assert!(!ports.into_iter().any(is_address));
    }

    #[test]
    fn framings() {
        let opto = SerialSettings::new(4800).with_framing("7E2");
        assert_eq!(opto, Some(SerialSettings { baud: 4800, data_bits: 7, parity: 'E', stop_bits: 2 }));
        for bad in ["", "8N", "9N1", "8X1", "8N3", "8N11"] {
            assert_eq!(SerialSettings::new(9600).with_framing(bad), None, "{bad}");
        }
    }

    #[test]
    fn records_end_with_cr_or_lf_or_both() {
        let mut lines = Lines { buffer: b"a\r\nb\rc\n\r\nd".to_vec() };
        let mut seen = Vec::new();
        while let Some(line) = lines.next_line() {
            seen.push(line);
        }
        assert_eq!(seen, [b"a", b"b", b"c"]);
        assert_eq!(lines.rest(), b"d");
    }

    #[test]
    fn endless_garbage_does_not_grow_without_limit() {
        let mut lines = Lines { buffer: vec![b'x'; 600] };
        assert_eq!(lines.next_line().map(|line| line.len()), Some(600));
        assert!(lines.rest().is_empty());
    }
}
