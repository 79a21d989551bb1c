//! Records of the Mitutoyo U-WAVE-R receiver: what goes over the wire, both ways.
//!
//! Requests have 9 characters and CR, `c` channel, `g` group, `w` 1 = clear after read, `m` method:
//! `DR1ccggwm` reads data, `IR1dccggm` reads information (`d` 0 receiver, 1 transmitter).
//! Replies end with CR too: `DT` data, `ST` status, `RI` receiver, `TI` transmitter. Requests name the channel before
//! the group; `DT` and `ST` name the group before the channel.

use std::fmt;

/// Unit of a data record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// `M`
    Millimetre,
    /// `I`
    Inch,
    /// `0`: the instrument did not say.
    None,
}

/// How records say a unit.
const UNITS: [(Unit, char); 3] = [(Unit::Millimetre, 'M'), (Unit::Inch, 'I'), (Unit::None, '0')];

impl Unit {
    /// Metres per unit, where the unit is known.
    #[must_use]
    pub fn in_metres(self) -> Option<f64> {
        match self {
            Self::Millimetre => Some(1e-3),
            Self::Inch => Some(25.4e-3),
            Self::None => None,
        }
    }
}

/// What a status record says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// 00
    BatteryLow,
    /// 01
    InstrumentSilent,
    /// 02
    Unregistered,
    /// 03
    DataLost,
    /// 04
    Disconnected,
    /// 05
    NoData,
    /// 50
    BadRequest,
    /// 51, no alarm
    EndOfSearch,
    /// 99
    CancelledByOperator,
    /// Any other number.
    Unknown(u8),
}

/// Those that are known: number and words.
const STATUSES: [(Status, u8, &str); 9] = [
    (Status::BatteryLow, 0, "the transmitter's battery is low"),
    (Status::InstrumentSilent, 1, "the indicator does not answer its transmitter; check its plug and that it is on"),
    (Status::Unregistered, 2, "no transmitter is registered on this channel; check the channel numbers"),
    (Status::DataLost, 3, "data were lost on the radio link; check distance and interference"),
    (Status::Disconnected, 4, "the transmitter is disconnected; check its battery and distance"),
    (Status::NoData, 5, "the receiver has no value of this channel yet; move the stem or press the data button once"),
    (Status::BadRequest, 50, "the receiver refused the request as wrong"),
    (Status::EndOfSearch, 51, "end of search"),
    (Status::CancelledByOperator, 99, "the operator cancelled the reading at the transmitter"),
];

impl Status {
    /// The status with this number.
    #[must_use]
    pub fn from_code(code: u8) -> Self {
        STATUSES.iter().find(|known| known.1 == code).map_or(Self::Unknown(code), |known| known.0)
    }

    /// Its number, and what it says.
    fn code_and_words(self) -> (u8, &'static str) {
        let unknown = if let Self::Unknown(code) = self { code } else { u8::MAX };
        let known = STATUSES.iter().find(|known| known.0 == self);
        known.map_or((unknown, "unknown status"), |(_, code, words)| (*code, words))
    }

    /// The number of the status.
    #[must_use]
    pub fn code(self) -> u8 {
        self.code_and_words().0
    }

    /// Whether asking again may help. A request is also refused when it came behind half of another one.
    #[must_use]
    pub fn is_worth_a_retry(self) -> bool {
        matches!(
            self,
            Self::InstrumentSilent | Self::DataLost | Self::NoData | Self::BadRequest | Self::CancelledByOperator
        )
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (code, says) = self.code_and_words();
        write!(f, "{says} (status {code:02})")
    }
}

/// A record from the receiver.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// `DT1ggcc+ddddddddddd u`
    Data {
        /// Group 0 to 99.
        group: u8,
        /// Channel 0 to 99.
        channel: u8,
        /// The number as it stands, in `unit`.
        value: f64,
        /// Its unit.
        unit: Unit,
    },
    /// `ST1ggccIIIIIIIIIIss`; `None` where the record says FF.
    Status {
        /// Group 0 to 99.
        group: Option<u8>,
        /// Channel 0 to 99.
        channel: Option<u8>,
        /// Identification of the transmitter, 10 digits.
        id: Option<u64>,
        /// What it says.
        status: Status,
    },
    /// `RI1ggIIIIIIIIIIbbLD...`
    Receiver {
        /// Group 0 to 99.
        group: u8,
        /// Identification, as it stands.
        id: String,
        /// All that follows the identification, as it stands: band, mode and registrations.
        rest: String,
    },
    /// `TI1sccggIIIIIIIIIIbbM`
    Transmitter {
        /// State, as it stands.
        state: char,
        /// Channel 0 to 99.
        channel: u8,
        /// Group 0 to 99.
        group: u8,
        /// Identification, as it stands.
        id: String,
        /// Band, as it stands.
        band: String,
        /// Whether it sends by itself when the value changes (event mode); else on its button.
        event_mode: bool,
    },
}

/// A request for the value of a channel; `clear` makes the receiver forget it afterwards.
#[must_use]
pub fn data_request(channel: u8, group: u8, clear: bool) -> String {
    format!("DR1{:02}{:02}{}0\r", channel.min(99), group.min(99), u8::from(clear))
}

/// A request for information on the receiver.
#[must_use]
pub fn receiver_request(group: u8) -> String {
    format!("IR1000{:02}0\r", group.min(99))
}

/// A request for information on the first transmitter at or after a channel.
#[must_use]
pub fn transmitter_request(channel: u8, group: u8) -> String {
    format!("IR11{:02}{:02}1\r", channel.min(99), group.min(99))
}

/// A data record as the receiver sends it, without CR. `value` in `unit`; six digits before the point at most.
#[must_use]
pub fn data_record(group: u8, channel: u8, value: f64, decimals: usize, unit: Unit) -> String {
    let sign = if value < 0.0 { '-' } else { '+' };
    let decimals = decimals.min(9);
    let letter = UNITS.iter().find(|known| known.0 == unit).map_or('0', |known| known.1);
    format!("DT1{group:02}{channel:02}{sign}{:011.decimals$}{letter}", value.abs())
}

/// A status record as the receiver sends it, without CR.
#[must_use]
pub fn status_record(group: u8, channel: u8, status: Status) -> String {
    format!("ST1{group:02}{channel:02}FFFFFFFFFF{:02}", status.code())
}

/// Takes a record apart; `None` is garbage. The record comes without its CR.
#[must_use]
pub fn parse_record(line: &[u8]) -> Option<Record> {
    let text = std::str::from_utf8(line).ok().filter(|text| text.is_ascii())?;
    let (kind, body) = text.split_at_checked(3)?;
    match kind {
        "DT1" if text.len() == 20 => {
            let (group, channel) = (two_digits(body.get(0..2)?)?, two_digits(body.get(2..4)?)?);
            let (sign, digits) = body.get(4..16)?.split_at_checked(1)?;
            let digits_are_plain = digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
            let magnitude: f64 = digits.parse().ok().filter(|_| digits_are_plain)?;
            let value = match sign {
                "+" => magnitude,
                "-" => -magnitude,
                _ => return None,
            };
            let (unit, _) = *UNITS.iter().find(|known| body.get(16..) == Some(known.1.encode_utf8(&mut [0; 4])))?;
            Some(Record::Data { group, channel, value, unit })
        }
        "ST1" if text.len() == 19 => {
            let id = body.get(4..14)?;
            let id = if id == "FFFFFFFFFF" { None } else { Some(all_digits(id)?.parse().ok()?) };
            Some(Record::Status {
                group: two_digits_or_ff(body.get(0..2)?)?,
                channel: two_digits_or_ff(body.get(2..4)?)?,
                id,
                status: Status::from_code(two_digits(body.get(14..16)?)?),
            })
        }
        "RI1" if text.len() == 67 => Some(Record::Receiver {
            group: two_digits(body.get(0..2)?)?,
            id: body.get(2..12)?.to_owned(),
            rest: body.get(12..)?.to_owned(),
        }),
        "TI1" if text.len() == 21 => Some(Record::Transmitter {
            state: body.chars().next()?,
            channel: two_digits(body.get(1..3)?)?,
            group: two_digits(body.get(3..5)?)?,
            id: body.get(5..15)?.to_owned(),
            band: body.get(15..17)?.to_owned(),
            event_mode: yes_or_no(body.get(17..)?)?,
        }),
        _ => None,
    }
}

/// A request as the receiver sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Read data; `None` channel is FF.
    Data {
        /// Channel, or all.
        channel: Option<u8>,
        /// Group.
        group: u8,
        /// Forget the value afterwards.
        clear: bool,
    },
    /// Information on the receiver.
    Receiver {
        /// Group.
        group: u8,
    },
    /// Information on the first transmitter at or after the channel.
    Transmitter {
        /// Channel.
        channel: u8,
        /// Group.
        group: u8,
    },
}

/// Takes a request apart; `None` is a bad request. The request comes without its CR.
#[must_use]
pub fn parse_request(line: &[u8]) -> Option<Request> {
    let text = std::str::from_utf8(line).ok().filter(|text| text.is_ascii() && text.len() == 9)?;
    let (kind, body) = text.split_at_checked(3)?;
    match kind {
        "DR1" => Some(Request::Data {
            channel: two_digits_or_ff(body.get(0..2)?)?,
            group: two_digits(body.get(2..4)?)?,
            clear: yes_or_no(body.get(4..5)?)?,
        }),
        "IR1" => {
            let (channel, group) = (two_digits(body.get(1..3)?)?, two_digits(body.get(3..5)?)?);
            let of_transmitter = yes_or_no(body.get(0..1)?)?;
            Some(if of_transmitter { Request::Transmitter { channel, group } } else { Request::Receiver { group } })
        }
        _ => None,
    }
}

fn yes_or_no(text: &str) -> Option<bool> {
    match text {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    }
}

fn all_digits(text: &str) -> Option<&str> {
    (!text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())).then_some(text)
}

fn two_digits(text: &str) -> Option<u8> {
    all_digits(text)?.parse().ok()
}

fn two_digits_or_ff(text: &str) -> Option<Option<u8>> {
    if text == "FF" { Some(None) } else { two_digits(text).map(Some) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_capture_of_the_manual() {
        let record = parse_record(b"DT10002-0000000.001M").unwrap();
        assert_eq!(record, Record::Data { group: 0, channel: 2, value: -0.001, unit: Unit::Millimetre });
    }

    #[test]
    fn requests_have_the_forms_of_the_manual() {
        assert_eq!(data_request(0, 0, false), "DR1000000\r");
        assert_eq!(data_request(1, 0, false), "DR1010000\r");
        assert_eq!(receiver_request(0), "IR1000000\r");
        assert_eq!(transmitter_request(0, 0), "IR1100001\r");
        assert_eq!(parse_request(b"DR1FF0010"), Some(Request::Data { channel: None, group: 0, clear: true }));
    }

    #[test]
    fn group_comes_before_channel_in_replies() {
        let record = parse_record(b"ST10305FFFFFFFFFF04").unwrap();
        let expected = Record::Status { group: Some(3), channel: Some(5), id: None, status: Status::Disconnected };
        assert_eq!(record, expected);
        assert_eq!(
            parse_record(b"ST1FFFF123456789050").unwrap(),
            Record::Status { group: None, channel: None, id: Some(1_234_567_890), status: Status::BadRequest }
        );
    }

    #[test]
    fn information_records() {
        let receiver = format!("RI100123456789002{}", "0".repeat(50));
        assert!(matches!(parse_record(receiver.as_bytes()), Some(Record::Receiver { group: 0, .. })));
        let transmitter = parse_record(b"TI100200123456789002" as &[u8]);
        assert_eq!(transmitter, None, "one character short");
        assert!(matches!(
            parse_record(b"TI1002001234567890021"),
            Some(Record::Transmitter { channel: 2, group: 0, event_mode: true, .. })
        ));
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..80)) {
            let _ = parse_record(&bytes);
            let _ = parse_request(&bytes);
        }

        #[test]
        fn broken_records_never_panic(text in "(DT1|ST1|RI1|TI1|DR1|IR1)[0-9F+\\-.MI]{0,64}") {
            let _ = parse_record(text.as_bytes());
            let _ = parse_request(text.as_bytes());
        }

        #[test]
        fn data_records_come_back(group in 0_u8..100, channel in 0_u8..100, micrometres in -99_999_999_i64..99_999_999) {
            let value = micrometres as f64 / 1000.0;
            let text = data_record(group, channel, value, 3, Unit::Millimetre);
            prop_assert_eq!(text.len(), 20);
            let back = parse_record(text.as_bytes());
            prop_assert_eq!(back, Some(Record::Data { group, channel, value, unit: Unit::Millimetre }));
        }

        #[test]
        fn requests_come_back(channel in 0_u8..100, group in 0_u8..100, clear: bool) {
            let text = data_request(channel, group, clear);
            let expected = Request::Data { channel: Some(channel), group, clear };
            prop_assert_eq!(parse_request(text.trim_end().as_bytes()), Some(expected));
        }
    }
}
