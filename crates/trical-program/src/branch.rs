//! Configurations: what a program's text demands of the arm's branch, and what joints have.
//!
//! The meaning of the numbers is as the makers' manuals describe it for arms with a spherical wrist; it was not tried on
//! controllers \[I\]. So quadrants (ABB) and signs (KUKA) of single joints decide, and the rest (front or back, elbow up or
//! down) only chooses among what is left.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use trical_model::{JointKind, Joints, Robot, trig};

/// What the text of a target demands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Configuration {
    /// Nothing: the solution nearest to the target before.
    Free,
    /// ABB's cf1, cf4, cf6 (quadrants of joints 1, 4, 6) and cfx.
    Abb([i16; 4]),
    /// KUKA's status and turn, where given.
    Kuka {
        /// Status.
        s: Option<u16>,
        /// Turn: bit i is set where joint i + 1 is below zero; behind those of the arm are external axes.
        t: Option<u16>,
    },
    /// FANUC's flip, up, front.
    Fanuc {
        /// F: flip.
        flip: bool,
        /// U: elbow up.
        up: bool,
        /// T: toward the front.
        front: bool,
        /// Turn numbers of joints 1, 4, 6, where given: 0 is within half a turn of zero.
        turns: Option<[i16; 3]>,
    },
}

/// Joints whose quadrants ABB names, and whose turns FANUC counts.
const NAMED: [usize; 3] = [0, 3, 5];

/// Parts of a joint's range that a configuration counts from 0.
#[derive(Clone, Copy)]
struct Parts {
    /// Of one, rad.
    size: f64,
    /// Where number 0 begins, rad.
    begin: f64,
    /// How far a joint may be beyond the part that the text names, rad.
    slack: f64,
}

/// A joint may be this far beyond a quadrant that the text names, rad: texts are rounded.
const SLACK: f64 = 2e-3;
/// Joints that change by less than this have not changed, rad.
const SAME: f64 = 1e-6;

const QUADRANTS: Parts = Parts { size: FRAC_PI_2, begin: 0.0, slack: SLACK };
/// Of two values of a joint that are a turn apart one is within the part, and is meant.
const TURNS: Parts = Parts { size: TAU, begin: -PI, slack: SAME };

/// What tells the branches of a 6R arm apart.
#[derive(Clone, Debug)]
pub struct Branches {
    /// Twist, length and offsets that place the wrist; `None` where axes 2 and 3 are not parallel or joints slide.
    elbow: Option<Elbow>,
    spherical: bool,
    dof: usize,
}

#[derive(Clone, Copy, Debug)]
struct Elbow {
    offset: [f64; 2],
    a1: f64,
    a2: f64,
    fold: f64,
    wrist: [f64; 2],
}

impl Branches {
    /// Of an arm.
    #[must_use]
    pub fn of(robot: &Robot) -> Self {
        let j = &robot.joints;
        let revolute = j.len() == 6 && j.iter().all(|j| j.kind == JointKind::Revolute);
        let parallel = revolute && trig::sin(j[2].alpha).abs() < 1e-6 && j[2].a.abs() > 1e-6;
        Self {
            elbow: parallel.then(|| Elbow {
                offset: [j[1].theta_offset, j[2].theta_offset],
                a1: j[1].a,
                a2: j[2].a,
                fold: trig::cos(j[2].alpha),
                wrist: [j[3].a, -trig::sin(j[3].alpha) * j[3].d],
            }),
            spherical: parallel && j[4].a.abs() < 1e-9 && j[4].d.abs() < 1e-9,
            dof: j.len(),
        }
    }

    /// Distance of the wrist from the line of the lower arm, m: its sign says how the elbow is bent.
    fn elbow(&self, q: &Joints) -> Option<f64> {
        self.elbow.map(|e| e.across(q))
    }

    /// How far the wrist is in front of axis 1 (as seen at zero), m.
    fn front(&self, q: &Joints) -> Option<f64> {
        let e = self.elbow.filter(|_| self.spherical)?;
        let ahead = |q: &Joints| {
            let (s, c) = trig::sin_cos(q[1] + e.offset[0]);
            e.a1 + c * (e.a2 + e.along(q)) - s * e.fold * e.across(q)
        };
        Some(ahead(q) * ahead(&Joints::default()).signum())
    }

    /// How badly `q` fits what the text demands: 0 is well; `None` is not at all.
    #[must_use]
    pub fn mismatch(&self, demanded: &Configuration, q: &Joints) -> Option<u32> {
        let (excluded, turned) = match demanded {
            Configuration::Free => (false, 0),
            Configuration::Abb(cf) => (QUADRANTS.exclude(cf, q), 0),
            Configuration::Kuka { t, .. } => {
                let unlike = |t: u16| (0..self.dof.min(6)).any(|i| below(q[i]).is_some_and(|b| b != (t >> i & 1 == 1)));
                (t.is_some_and(unlike), 0)
            }
            Configuration::Fanuc { turns, .. } => {
                // turns that the text counts are as it demands them
                let counted = |joint: usize| turns.is_some() && NAMED.contains(&joint);
                let turned = q.iter().enumerate().filter(|(joint, q)| q.abs() > PI && !counted(*joint)).count();
                (turns.is_some_and(|turns| TURNS.exclude(&turns, q)), turned as u32)
            }
        };
        (!excluded).then(|| self.unlike(demanded, q) + turned)
    }

    /// In how many of the parts that only choose among solutions (front, elbow, wrist) `q` is otherwise than the text demands.
    #[must_use]
    pub fn unlike(&self, demanded: &Configuration, q: &Joints) -> u32 {
        let unlike = |has: Option<bool>, wants: bool| u32::from(has.is_some_and(|h| h != wants));
        let behind = self.front(q).map(|f| f < 0.0);
        let as_at_zero = || self.elbow(q).zip(self.elbow(&Joints::default())).map(|(e, z)| e * z > 0.0);
        match demanded {
            Configuration::Free | Configuration::Kuka { s: None, .. } => 0,
            Configuration::Abb(cf) => {
                let Ok(x) = u8::try_from(cf[3]) else { return 0 };
                unlike(behind, x & 4 != 0) + unlike(as_at_zero(), x & 2 == 0) + unlike(below(q[4]), x & 1 != 0)
            }
            Configuration::Kuka { s: Some(s), t } => {
                let bent = self.elbow.map(|e| wrapped(q[2] - e.stretched()) >= 0.0);
                let wrist = below(q[4]).filter(|_| t.is_none());
                unlike(behind, s & 1 != 0) + unlike(bent, s & 2 != 0) + unlike(wrist, s & 4 != 0)
            }
            Configuration::Fanuc { flip, up, front, .. } => {
                unlike(below(q[4]), !flip) + unlike(as_at_zero(), *up) + unlike(behind, !front)
            }
        }
    }

    /// What the text has to demand of `new`, where the way there from `old` crosses a quadrant, a turn or a zero: the numbers that
    /// stand behind those of the pose.
    #[must_use]
    pub fn rewritten(&self, demanded: &Configuration, old: &Joints, new: &Joints) -> [Option<i16>; 3] {
        match demanded {
            Configuration::Abb([cf1, cf4, cf6, _]) => QUADRANTS.crossed([*cf1, *cf4, *cf6], old, new),
            Configuration::Fanuc { turns: Some(turns), .. } => TURNS.crossed(*turns, old, new),
            Configuration::Kuka { t: Some(t), .. } => {
                let mut bits = *t;
                for i in 0..self.dof.min(6) {
                    let set = t >> i & 1 == 1;
                    let against = |q: f64| if set { q.max(0.0) } else { (-q).max(0.0) };
                    if against(new[i]) > against(old[i]) + SAME {
                        bits ^= 1 << i;
                    }
                }
                [i16::try_from(bits).ok().filter(|_| bits != *t), None, None]
            }
            _ => [None; 3],
        }
    }

    /// Which part of the arm changes its branch between two sets of joint values.
    #[must_use]
    pub fn changed(&self, old: &Joints, new: &Joints) -> Option<&'static str> {
        let flips = |a: f64, b: f64| a * b < 0.0 && (a - b).abs() > SAME;
        let both = |a: Option<f64>, b: Option<f64>| a.zip(b).is_some_and(|(a, b)| flips(a, b));
        if self.elbow.is_some() && flips(trig::sin(old[4]), trig::sin(new[4])) {
            Some("the wrist flips (joint 5 passes zero)")
        } else if both(self.elbow(old), self.elbow(new)) {
            Some("the elbow passes its stretched position")
        } else if both(self.front(old), self.front(new)) {
            Some("the wrist passes axis 1")
        } else {
            None
        }
    }
}

impl Elbow {
    fn along(&self, q: &Joints) -> f64 {
        let (s, c) = trig::sin_cos(q[2] + self.offset[1]);
        c * self.wrist[0] - s * self.wrist[1]
    }

    fn across(&self, q: &Joints) -> f64 {
        let (s, c) = trig::sin_cos(q[2] + self.offset[1]);
        s * self.wrist[0] + c * self.wrist[1]
    }

    /// Value of joint 3 at which the arm is stretched out.
    fn stretched(&self) -> f64 {
        let theta = libm::atan2(-self.wrist[1], self.wrist[0]);
        theta - self.offset[1] + if self.a2 < 0.0 { PI } else { 0.0 }
    }
}

impl Parts {
    /// How far an angle is outside part `n`, rad.
    fn outside(self, q: f64, n: i16) -> f64 {
        let from = self.begin + f64::from(n) * self.size;
        (from - q).max(q - from - self.size).max(0.0)
    }

    /// Whether joints are elsewhere than in the parts that the text names.
    fn exclude(self, numbers: &[i16], q: &Joints) -> bool {
        NAMED.iter().zip(numbers).any(|(j, n)| self.outside(q[*j], *n) > self.slack)
    }

    /// The new numbers of joints that leave their parts.
    fn crossed(self, numbers: [i16; 3], old: &Joints, new: &Joints) -> [Option<i16>; 3] {
        std::array::from_fn(|k| {
            let (j, n) = (NAMED[k], numbers[k]);
            let left = self.outside(new[j], n) > self.outside(old[j], n) + SAME;
            left.then(|| ((new[j] - self.begin) / self.size).floor() as i16)
        })
    }
}

/// Whether a joint is below zero; of one that is nearly at zero nothing is said.
fn below(q: f64) -> Option<bool> {
    (q.abs() > SLACK).then_some(q < 0.0)
}

fn wrapped(x: f64) -> f64 {
    x - TAU * (x / TAU).round()
}
