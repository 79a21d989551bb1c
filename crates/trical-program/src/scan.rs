//! What a program holds: targets, tools and frames, and the order in which the arm visits them.

use std::collections::HashMap;
use std::collections::hash_map::{DefaultHasher, Entry};
use std::hash::Hasher;

use nalgebra::Vector3;

use crate::branch::Configuration;
use crate::frames::Frames;
use crate::literal::Shape;
use crate::text::Span;

/// A target in the text.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// First of its numbers in `Scan::spans`.
    first: u32,
    /// How many; those of a configuration stand behind the others.
    count: u8,
    /// What they say.
    pub shape: Shape,
    /// The configuration that the text demands.
    pub configuration: Configuration,
    /// Index into `Scan::setups`; `None` where nothing in the file says it.
    pub setup: Option<u32>,
    /// Whether it is used with a second setup.
    pub ambiguous: Option<u32>,
    /// Its name in the text; empty where it has none.
    pub name: Span,
}

/// The tool and the frame that targets are meant with; `None` is what the file's user says, or the cell's tool and the
/// controller's world.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Setup {
    /// Lower-case name of the tool.
    pub tool: Option<String>,
    /// Lower-case name of the work object, base or user frame.
    pub frame: Option<String>,
}

impl Setup {
    /// For messages.
    #[must_use]
    pub fn in_words(&self) -> String {
        let tool = self.tool.as_deref().map_or("the cell's tool".to_owned(), |t| format!("tool '{t}'"));
        let frame = self.frame.as_deref().map_or("the robot's base".to_owned(), |f| format!("'{f}'"));
        format!("{tool} in {frame}")
    }
}

/// One motion of the program.
#[derive(Clone, Copy, Debug)]
pub enum Visit {
    /// To a target (index into `Scan::spots`).
    To(u32),
    /// To a place that is shifted against a target: the target itself stays, but the next one is approached from there.
    Near {
        /// Index into `Scan::spots`.
        spot: u32,
        /// How far, m.
        shift: Vector3<f64>,
        /// Along the tool's axes; else along the frame's.
        in_tool: bool,
    },
    /// To a place that only the running program knows.
    Unknown,
}

/// What a dialect's reader found.
#[derive(Debug, Default)]
pub struct Scan {
    /// Targets in the order of the file.
    pub spots: Vec<Spot>,
    spans: Vec<Span>,
    /// Tools and frames that targets are used with.
    pub setups: Vec<Setup>,
    setup_indices: HashMap<Setup, u32>,
    /// In the order of the program, as far as the file tells; targets that no motion names are not in it.
    pub visits: Vec<Visit>,
    /// Tools and frames that the program declares.
    pub frames: Frames,
    /// Places where a target stands that cannot be rewritten: offset and reason.
    pub problems: Vec<(usize, String)>,
    /// Whether the program switches the controller's check of configurations off.
    pub configuration_off: bool,
}

impl Scan {
    /// The numbers of a target.
    #[must_use]
    pub fn spans(&self, spot: &Spot) -> &[Span] {
        let first = spot.first as usize;
        self.spans.get(first..first + spot.count as usize).unwrap_or(&[])
    }

    /// Where a target begins in the file.
    #[must_use]
    pub fn at(&self, spot: &Spot) -> usize {
        self.spans(spot).first().map_or(0, |s| s.at as usize)
    }

    /// Adds a target; numbers of its configuration stand behind the others.
    pub fn push(&mut self, shape: Shape, spans: &[Span], configuration: Configuration, name: Span) -> u32 {
        let first = u32::try_from(self.spans.len()).unwrap_or(u32::MAX);
        self.spans.extend_from_slice(spans);
        let count = u8::try_from(spans.len()).unwrap_or(0);
        self.spots.push(Spot { first, count, shape, configuration, setup: None, ambiguous: None, name });
        u32::try_from(self.spots.len() - 1).unwrap_or(u32::MAX)
    }

    /// Gives a target its setup; a second one is remembered as a contradiction.
    pub fn assign(&mut self, spot: u32, setup: u32) {
        if let Some(s) = self.spots.get_mut(spot as usize) {
            match s.setup {
                None => s.setup = Some(setup),
                Some(known) if known != setup => s.ambiguous = Some(setup),
                Some(_) => {}
            }
        }
    }

    /// The index of a setup.
    pub fn setup(&mut self, setup: Setup) -> u32 {
        if let Some(known) = self.setup_indices.get(&setup) {
            return *known;
        }
        let index = u32::try_from(self.setups.len()).unwrap_or(u32::MAX);
        self.setup_indices.insert(setup.clone(), index);
        self.setups.push(setup);
        index
    }
}

/// How a motion names its place.
#[derive(Clone, Copy, Debug)]
pub enum Way {
    /// The target itself.
    To,
    /// Element `k` (0-based) of an array of targets.
    Element(usize),
    /// Shifted against it.
    Near(Vector3<f64>, bool),
    /// Related to it in a way that is known only when the program runs.
    Computed,
    /// Perhaps the target itself: a name that may as well be a speed.
    Perhaps,
    /// No motion: the file says otherwise with which tool and frame it is meant.
    Said,
}

/// Which names stand for which targets, and how motions use them. Names are kept as hashes: programs have millions.
#[derive(Debug, Default)]
pub struct Names {
    defined: HashMap<u64, u32>,
    groups: Vec<Group>,
    uses: Vec<Use>,
}

#[derive(Clone, Copy, Debug)]
struct Group {
    first: u32,
    count: u32,
    /// An earlier definition of the same name.
    earlier: Option<u32>,
    /// The setup of the last use of all of it.
    used: Option<u32>,
}

#[derive(Clone, Copy, Debug)]
enum Use {
    /// `group` is the newest definition above the motion.
    Named {
        name: u64,
        group: Option<u32>,
        setup: u32,
        way: Way,
    },
    Direct(Visit),
}

/// 64 bits that stand for a name, letters in lower case.
#[must_use]
pub fn hashed(name: &[u8]) -> u64 {
    let mut h = DefaultHasher::new();
    for b in name {
        h.write_u8(b.to_ascii_lowercase());
    }
    h.finish()
}

impl Names {
    /// Targets `first..end` have this name (several: an array).
    pub fn define(&mut self, name: u64, first: usize, end: usize) {
        if end <= first {
            return;
        }
        let index = u32::try_from(self.groups.len()).unwrap_or(u32::MAX);
        let mut group = Group { first: first as u32, count: (end - first) as u32, earlier: None, used: None };
        match self.defined.entry(name) {
            Entry::Occupied(mut e) => {
                group.earlier = Some(*e.get());
                e.insert(index);
            }
            Entry::Vacant(e) => {
                e.insert(index);
            }
        }
        self.groups.push(group);
    }

    /// A motion to a named target.
    pub fn used(&mut self, name: u64, setup: u32, way: Way) {
        let group = self.defined.get(&name).copied();
        self.uses.push(Use::Named { name, group, setup, way });
    }

    /// A motion to a target that says itself with what it is meant.
    pub fn gone_to(&mut self, name: u64, relative: bool) {
        let group = self.defined.get(&name).copied();
        self.uses.push(match group.and_then(|g| self.groups.get(g as usize)) {
            Some(g) if !relative => Use::Direct(Visit::To(g.first)),
            _ => Use::Direct(Visit::Unknown),
        });
    }

    /// A motion that needs no name.
    pub fn visit(&mut self, visit: Visit) {
        self.uses.push(Use::Direct(visit));
    }

    /// Resolves uses: setups and the order of visits go into `scan`.
    pub fn resolve(mut self, scan: &mut Scan) {
        for u in std::mem::take(&mut self.uses) {
            let (name, group, setup, way) = match u {
                Use::Direct(v) => {
                    scan.visits.push(v);
                    continue;
                }
                Use::Named { name, group, setup, way } => (name, group, setup, way),
            };
            let Some(newest) = group.or_else(|| self.defined.get(&name).copied()) else {
                if !matches!(way, Way::Perhaps | Way::Said) {
                    scan.visits.push(Visit::Unknown);
                }
                continue;
            };
            self.walk(newest, setup, way, scan);
            // other routines may have data of the same name, which nobody uses from here on
            let mut earlier = self.groups.get(newest as usize).and_then(|g| g.earlier);
            while let Some(g) = earlier.and_then(|k| self.groups.get_mut(k as usize)) {
                if g.used.is_some() {
                    break;
                }
                g.used = Some(setup);
                for spot in g.first..g.first + g.count {
                    scan.assign(spot, setup);
                }
                earlier = g.earlier;
            }
        }
    }

    fn walk(&mut self, group: u32, setup: u32, way: Way, scan: &mut Scan) {
        let Some(g) = self.groups.get_mut(group as usize) else { return };
        let all = g.first..g.first + g.count;
        let fresh = g.used.is_none();
        let one = match way {
            Way::Element(k) => u32::try_from(k).ok().and_then(|k| g.first.checked_add(k)).filter(|s| all.contains(s)),
            _ => (g.count == 1).then_some(g.first),
        };
        match one {
            Some(spot) => scan.assign(spot, setup),
            None if g.used == Some(setup) => {}
            None => all.clone().for_each(|spot| scan.assign(spot, setup)),
        }
        g.used = Some(setup);
        match (way, one) {
            (Way::Said, _) => {}
            (Way::Near(shift, in_tool), Some(spot)) => scan.visits.push(Visit::Near { spot, shift, in_tool }),
            (Way::To | Way::Perhaps | Way::Element(_), Some(spot)) => scan.visits.push(Visit::To(spot)),
            // an array that a loop runs through is visited once, in its order
            (Way::To | Way::Perhaps | Way::Element(_), None) if fresh => scan.visits.extend(all.map(Visit::To)),
            _ => scan.visits.push(Visit::Unknown),
        }
    }
}
