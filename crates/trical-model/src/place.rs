//! Places of a machine as people and files name them: coarser than a [`Site`], which says along or about which axis too.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::axis::Axis;
use crate::term::{Parameter, Site};

/// A place of the machine. Joints, links, targets, balls, frames and anchors are counted from 1.
///
/// Serialized as files have it: `{"joint": 3}`, `{"tool": true}`, `{"axis": "x"}`; displayed in words: "joint 3", "tool", "axis x".
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Place {
    /// A joint.
    Joint(usize),
    /// A joint that another joint moves.
    Coupling {
        /// The joint that moves.
        joint: usize,
        /// The joint that moves it.
        from: usize,
    },
    /// All joints alike.
    Joints,
    /// The link between two joints.
    Link(usize),
    /// All links alike.
    Links,
    /// The base.
    Base,
    /// The tool on the flange.
    Tool,
    /// An optical target on the tool.
    Target(usize),
    /// The fixture that carries the balls.
    Fixture,
    /// A ball.
    Ball(usize),
    /// An axis of the gauge.
    Axis(Axis),
    /// The frame of a measuring instrument, with its number where there may be several.
    Frame(Option<usize>),
    /// The anchor of a length.
    Anchor(usize),
    /// Everywhere: what cannot be asked of any place.
    All,
}

/// What stands behind a key of a place.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Value {
    True,
    Number(usize),
    Name(&'static str),
}

impl Place {
    /// The place of a site.
    #[must_use]
    pub fn of(site: &Site) -> Self {
        match *site {
            Site::Link { link, parameter: Parameter::Theta } => Self::Joint(link),
            Site::Link { link, .. } => Self::Link(link),
            Site::Joint { joint } | Site::Tilt { joint, .. } | Site::Across { joint } => Self::Joint(joint),
            Site::AllJoints => Self::Joints,
            Site::Links => Self::Links,
            Site::Base(_) | Site::Gravity(_) => Self::Base,
            Site::Tool(_) | Site::Payload(_) => Self::Tool,
            Site::Target { target, .. } => Self::Target(target),
            Site::Fixture(_) => Self::Fixture,
            Site::Ball { ball, .. } => Self::Ball(ball),
            Site::Frame { frame, .. } => Self::Frame(Some(frame)),
            Site::Anchor { anchor, .. } | Site::LengthZero { anchor } => Self::Anchor(anchor),
        }
    }

    /// The joint at which it is, if it is at one.
    #[must_use]
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Joint(joint) | Self::Coupling { joint, .. } => Some(joint),
            _ => None,
        }
    }

    /// The part of the arm that would be seen to move: a coupling moves its first joint, a target is on the tool. `None` where
    /// nothing of the arm moves alone (base, balls, the gauge and its frame).
    #[must_use]
    pub fn part(self) -> Option<Self> {
        match self {
            Self::Joint(joint) | Self::Coupling { joint, .. } => Some(Self::Joint(joint)),
            Self::Tool | Self::Target(_) => Some(Self::Tool),
            Self::Fixture | Self::Links => Some(self),
            _ => None,
        }
    }

    /// Whether both move the same part of the arm.
    #[must_use]
    pub fn is_same_part(self, other: Self) -> bool {
        self.part().is_some_and(|part| other.part() == Some(part))
    }

    /// Whether a person may mean this place by a key ("tool"), a number ("3") or a name ("x").
    #[must_use]
    pub fn is_called(self, text: &str) -> bool {
        self.fields().any(|(key, value)| {
            key == text
                || match value {
                    Value::True => false,
                    Value::Number(n) => text.parse() == Ok(n),
                    Value::Name(name) => name == text,
                }
        })
    }

    /// Keys and values as files have them, in the order of the alphabet.
    fn fields(self) -> impl Iterator<Item = (&'static str, Value)> {
        let (first, second) = match self {
            Self::Joint(joint) => (("joint", Value::Number(joint)), None),
            Self::Coupling { joint, from } => (("from", Value::Number(from)), Some(("joint", Value::Number(joint)))),
            Self::Joints => (("joints", Value::True), None),
            Self::Link(link) => (("link", Value::Number(link)), None),
            Self::Links => (("links", Value::True), None),
            Self::Base => (("base", Value::True), None),
            Self::Tool => (("tool", Value::True), None),
            Self::Target(target) => (("target", Value::Number(target)), Some(("tool", Value::True))),
            Self::Fixture => (("fixture", Value::True), None),
            Self::Ball(ball) => (("ball", Value::Number(ball)), None),
            Self::Axis(axis) => (("axis", Value::Name(axis.name())), None),
            Self::Frame(number) => (("frame", Value::True), number.map(|n| ("number", Value::Number(n)))),
            Self::Anchor(anchor) => (("anchor", Value::Number(anchor)), None),
            Self::All => (("all", Value::True), None),
        };
        std::iter::once(first).chain(second)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::Coupling { joint, from } = self {
            return write!(f, "joint {joint} from joint {from}");
        }
        for (k, (key, value)) in self.fields().enumerate() {
            f.write_str(if k > 0 { " " } else { "" })?;
            match value {
                Value::True => f.write_str(key)?,
                Value::Number(n) => write!(f, "{key} {n}")?,
                Value::Name(name) => write!(f, "{key} {name}")?,
            }
        }
        Ok(())
    }
}

impl Serialize for Place {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (key, value) in self.fields() {
            match value {
                Value::True => map.serialize_entry(key, &true)?,
                Value::Number(n) => map.serialize_entry(key, &n)?,
                Value::Name(name) => map.serialize_entry(key, name)?,
            }
        }
        map.end()
    }
}

/// All keys that places have in files.
#[derive(Default, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Keys {
    joint: Option<usize>,
    from: Option<usize>,
    joints: bool,
    link: Option<usize>,
    links: bool,
    base: bool,
    tool: bool,
    target: Option<usize>,
    fixture: bool,
    ball: Option<usize>,
    axis: Option<Axis>,
    frame: bool,
    number: Option<usize>,
    anchor: Option<usize>,
    all: bool,
}

impl<'de> Deserialize<'de> for Place {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let keys = Keys::deserialize(deserializer)?;
        let number = keys.number;
        let numbered = [
            keys.link.map(Self::Link),
            keys.target.map(Self::Target),
            keys.joint.map(|joint| keys.from.map_or(Self::Joint(joint), |from| Self::Coupling { joint, from })),
            keys.ball.map(Self::Ball),
            keys.axis.map(Self::Axis),
            keys.anchor.map(Self::Anchor),
        ];
        let whole = [
            (keys.joints, Self::Joints),
            (keys.links, Self::Links),
            (keys.base, Self::Base),
            (keys.tool, Self::Tool),
            (keys.fixture, Self::Fixture),
            (keys.frame, Self::Frame(number)),
            (keys.all, Self::All),
        ];
        let whole = whole.into_iter().filter_map(|(is, place)| is.then_some(place));
        let place = numbered.into_iter().flatten().chain(whole).next();
        place.ok_or_else(|| D::Error::custom("no key of a place, as {\"joint\": 3} or {\"tool\": true}"))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::term::{Motion, Payload};

    #[test]
    fn places_are_read_as_they_are_written() {
        let (joint, from) = (5, 4);
        let numbered =
            [Place::Joint(3), Place::Coupling { joint, from }, Place::Link(2), Place::Target(2), Place::Ball(1)];
        let whole =
            [Place::Joints, Place::Links, Place::Base, Place::Tool, Place::Fixture, Place::Frame(None), Place::All];
        let others = [Place::Axis(Axis::Y), Place::Frame(Some(2)), Place::Anchor(1)];
        for place in numbered.into_iter().chain(whole).chain(others) {
            let text = toml::to_string(&place).unwrap();
            assert_eq!(toml::from_str::<Place>(&text).unwrap(), place, "{text}");
        }
        assert!(toml::from_str::<Place>("elbow = 1").is_err());
        assert!(toml::from_str::<Place>("").unwrap_err().to_string().contains("no key of a place"));
    }

    #[test]
    fn a_place_in_words() {
        let words = |place: Place| place.to_string();
        assert_eq!(words(Place::Joint(3)), "joint 3");
        assert_eq!(words(Place::Coupling { joint: 5, from: 4 }), "joint 5 from joint 4");
        assert_eq!(words(Place::Axis(Axis::Y)), "axis y");
        assert_eq!(words(Place::Target(2)), "target 2 tool");
        assert_eq!(words(Place::Frame(None)), "frame");
        assert_eq!(words(Place::Fixture), "fixture");
    }

    #[test]
    fn sites_that_move_one_part_are_at_one_place() {
        let of = |site| Place::of(&site);
        assert_eq!(of(Site::Link { link: 2, parameter: Parameter::Theta }), Place::Joint(2));
        assert_eq!(of(Site::Link { link: 2, parameter: Parameter::A }), Place::Link(2));
        assert_eq!(of(Site::Across { joint: 4 }), Place::Joint(4));
        assert_eq!(of(Site::Payload(Payload::Mass)), of(Site::Tool(Motion::Along(Axis::X))));
    }

    #[test]
    fn a_coupling_moves_its_first_joint_and_base_and_balls_move_nothing_alone() {
        let coupling = Place::Coupling { joint: 5, from: 4 };
        assert!(coupling.is_same_part(Place::Joint(5)) && !coupling.is_same_part(Place::Joint(4)));
        assert!(Place::Target(1).is_same_part(Place::Tool));
        assert!(!Place::Base.is_same_part(Place::Base) && !Place::Ball(1).is_same_part(Place::Ball(1)));
    }

    #[test]
    fn a_place_is_called_by_key_number_or_name() {
        assert!(
            Place::Joint(3).is_called("3") && !Place::Joint(3).is_called("4") && Place::Joint(3).is_called("joint")
        );
        assert!(Place::Axis(Axis::X).is_called("x") && Place::Tool.is_called("tool") && !Place::Tool.is_called("true"));
    }
}
