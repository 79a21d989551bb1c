//! `sensor_msgs/msg/JointState` in CDR, by hand: the one message type here needs no ROS.
//!
//! Little-endian; four bytes of header, alignment counted after them; a string is its length with NUL, the bytes, NUL; a
//! sequence is its count and its elements; `f64` is aligned to 8.

/// A joint state message.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointState {
    /// Seconds of the stamp.
    pub seconds: i32,
    /// Nanoseconds of the stamp.
    pub nanoseconds: u32,
    /// Frame of the header.
    pub frame: String,
    /// Names of the joints.
    pub names: Vec<String>,
    /// Positions, rad or m.
    pub position: Vec<f64>,
    /// Velocities, rad/s or m/s; may be empty.
    pub velocity: Vec<f64>,
    /// Efforts, N m or N; may be empty.
    pub effort: Vec<f64>,
}

/// Header of little-endian CDR.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

impl JointState {
    /// The message as bytes.
    #[must_use]
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut out = Encoder(LITTLE_ENDIAN.to_vec());
        out.u32(self.seconds.cast_unsigned());
        out.u32(self.nanoseconds);
        out.string(&self.frame);
        out.u32(self.names.len() as u32);
        for name in &self.names {
            out.string(name);
        }
        for values in [&self.position, &self.velocity, &self.effort] {
            out.u32(values.len() as u32);
            for value in values {
                out.f64(*value);
            }
        }
        out.0
    }

    /// Reads the bytes of a message; `None` where they are too short or not little-endian CDR.
    #[must_use]
    pub fn from_cdr(bytes: &[u8]) -> Option<Self> {
        let mut from = Decoder::of(bytes)?;
        let seconds = from.u32()?.cast_signed();
        let nanoseconds = from.u32()?;
        let frame = from.string()?;
        let count = from.count(5)?;
        let names = (0..count).map(|_| from.string()).collect::<Option<Vec<_>>>()?;
        let position = from.sequence()?;
        let velocity = from.sequence()?;
        let effort = from.sequence()?;
        Some(Self { seconds, nanoseconds, frame, names, position, velocity, effort })
    }
}

impl JointState {
    /// The stamp, s.
    #[must_use]
    pub fn stamp(&self) -> f64 {
        f64::from(self.seconds) + f64::from(self.nanoseconds) * 1e-9
    }
}

/// Which of the stamped messages of `geometry_msgs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampedKind {
    /// `PoseStamped`
    Pose,
    /// `PointStamped`
    Point,
    /// `TransformStamped`
    Transform,
    /// `TFMessage` of tf2: transforms of several frames
    Tree,
}

impl StampedKind {
    /// The kind of a schema, by its name.
    #[must_use]
    pub fn of(schema: &str) -> Option<Self> {
        match schema {
            "geometry_msgs/msg/PoseStamped" => Some(Self::Pose),
            "geometry_msgs/msg/PointStamped" => Some(Self::Point),
            "geometry_msgs/msg/TransformStamped" => Some(Self::Transform),
            "tf2_msgs/msg/TFMessage" => Some(Self::Tree),
            _ => None,
        }
    }
}

/// Whether messages of a schema are read; others of a bag (pictures, clouds) need not be kept.
pub fn is_read(schema: &str) -> bool {
    [super::schema::JOINT_STATE_NAME, super::schema::STRING_NAME].contains(&schema) || StampedKind::of(schema).is_some()
}

/// What an instrument saw: a pose, a point or a transform of `geometry_msgs`.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamped {
    seconds: i32,
    nanoseconds: u32,
    /// Frame of the header, in which it was seen.
    pub frame: String,
    /// Frame of what was seen, of a transform; else empty.
    pub child: String,
    /// Position, m.
    pub position: [f64; 3],
    /// Unit quaternion w, x, y, z, where there is one; NaN where that of the message is none.
    pub quaternion: Option<[f64; 4]>,
}

impl Stamped {
    /// Reads the bytes of a message, which holds one, or, of [`StampedKind::Tree`], any number; `None` where they are too short, not
    /// little-endian CDR.
    #[must_use]
    pub fn from_cdr(bytes: &[u8], kind: StampedKind) -> Option<Vec<Self>> {
        let mut from = Decoder::of(bytes)?;
        if kind != StampedKind::Tree {
            return Some(vec![Self::one(&mut from, kind)?]);
        }
        // a transform takes 72 bytes at least
        let count = from.count(72)?;
        (0..count).map(|_| Self::one(&mut from, StampedKind::Transform)).collect()
    }

    /// Whether it holds finite numbers and, where it has one, a unit quaternion: an instrument that lost sight sends others.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.position.iter().chain(self.quaternion.iter().flatten()).all(|x| x.is_finite())
    }

    fn one(from: &mut Decoder<'_>, kind: StampedKind) -> Option<Self> {
        let (seconds, nanoseconds) = (from.u32()?.cast_signed(), from.u32()?);
        let frame = from.string()?;
        let child = if kind == StampedKind::Transform { from.string()? } else { String::new() };
        let mut number = || from.take().map(f64::from_le_bytes);
        let position = [number()?, number()?, number()?];
        let quaternion = if kind == StampedKind::Point {
            None
        } else {
            let [x, y, z, w] = [number()?, number()?, number()?, number()?];
            let length = (x * x + y * y + z * z + w * w).sqrt();
            Some([w, x, y, z].map(|v| if (length - 1.0).abs() > 1e-2 { f64::NAN } else { v / length }))
        };
        Some(Self { seconds, nanoseconds, frame, child, position, quaternion })
    }

    /// The stamp, s.
    #[must_use]
    pub fn stamp(&self) -> f64 {
        f64::from(self.seconds) + f64::from(self.nanoseconds) * 1e-9
    }
}

/// The text of a `std_msgs/msg/String`.
#[must_use]
pub fn string_from_cdr(bytes: &[u8]) -> Option<String> {
    Decoder::of(bytes)?.string()
}

struct Encoder(Vec<u8>);

impl Encoder {
    fn align(&mut self, to: usize) {
        while !(self.0.len() - LITTLE_ENDIAN.len()).is_multiple_of(to) {
            self.0.push(0);
        }
    }

    fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.align(8);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.0.extend_from_slice(text.as_bytes());
        self.0.push(0);
    }
}

struct Decoder<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> Decoder<'a> {
    /// Behind the header, which must be that of little-endian CDR.
    fn of(bytes: &'a [u8]) -> Option<Self> {
        let (header, body) = bytes.split_at_checked(4)?;
        (header.get(..2)? == LITTLE_ENDIAN.get(..2)?).then_some(Decoder { body, at: 0 })
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.checked_next_multiple_of(N)?;
        let bytes = self.body.get(self.at..self.at.checked_add(N)?)?;
        self.at += N;
        bytes.try_into().ok()
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// A count of elements that take so many bytes at least; more than there can be is refused before memory is taken.
    fn count(&mut self, least: usize) -> Option<usize> {
        let count = self.u32()? as usize;
        (count.checked_mul(least)? <= self.body.len().saturating_sub(self.at)).then_some(count)
    }

    fn string(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.body.get(self.at..self.at.checked_add(length)?)?;
        self.at += length;
        let (nul, text) = bytes.split_last()?;
        if *nul != 0 {
            return None;
        }
        String::from_utf8(text.to_vec()).ok()
    }

    fn sequence(&mut self) -> Option<Vec<f64>> {
        let count = self.count(8)?;
        (0..count).map(|_| self.take().map(f64::from_le_bytes)).collect()
    }
}

/// `std_msgs/msg/String` in CDR.
#[must_use]
pub fn string_to_cdr(text: &str) -> Vec<u8> {
    let mut out = Encoder(LITTLE_ENDIAN.to_vec());
    out.string(text);
    out.0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    /// Bytes that a ROS 2 middleware writes for this message.
    const REFERENCE: &str = "00010000 00f15365 15cd5b07 0a000000 62617365 5f6c696e 6b000000 02000000 08000000 \
                             6a6f696e 745f3100 08000000 6a6f696e 745f3200 02000000 00000000 0000e03f 00000000 \
                             0000f4bf 00000000 00000000";

    fn reference() -> JointState {
        JointState {
            seconds: 1_700_000_000,
            nanoseconds: 123_456_789,
            frame: "base_link".to_owned(),
            names: vec!["joint_1".to_owned(), "joint_2".to_owned()],
            position: vec![0.5, -1.25],
            velocity: vec![],
            effort: vec![],
        }
    }

    #[test]
    fn the_84_bytes_of_the_reference() {
        let digits: String = REFERENCE.split_whitespace().collect();
        let bytes: Vec<u8> =
            (0..digits.len() / 2).map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).unwrap()).collect();
        assert_eq!(bytes.len(), 84);
        assert_eq!(reference().to_cdr(), bytes);
        assert_eq!(JointState::from_cdr(&bytes), Some(reference()));
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = JointState::from_cdr(&bytes);
            let mut headed = vec![0, 1, 0, 0];
            headed.extend(bytes);
            let _ = JointState::from_cdr(&headed);
        }

        #[test]
        fn messages_come_back(names in proptest::collection::vec("[a-z0-9_]{0,9}", 0..9), position in proptest::collection::vec(-10.0_f64..10.0, 0..9)) {
            let message = JointState { names, velocity: position.clone(), position, ..reference() };
            prop_assert_eq!(JointState::from_cdr(&message.to_cdr()), Some(message));
        }
    }

    #[test]
    fn pictures_of_a_bag_are_not_kept() {
        assert!(is_read("tf2_msgs/msg/TFMessage") && is_read("std_msgs/msg/String"));
        assert!(!is_read("sensor_msgs/msg/Image"));
    }
}
