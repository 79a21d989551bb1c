//! The chain between two links of a URDF, and everything that hangs on it.

use std::collections::BTreeMap;

use crate::error::{ModelError, Result};
use crate::pose::Pose;
use crate::recording::MAX_JOINTS;
use crate::robot::{FARTHEST, JointKind};

use super::xml::{Inertial, Joint, NO_LIMIT, Urdf, error};

type V3 = nalgebra::Vector3<f64>;

/// A moving joint of the chain at its zero position, and what moves with it; everything in the frame of the root.
pub(crate) struct Axes {
    pub kind: JointKind,
    /// A point of the axis and its direction.
    pub point: V3,
    pub axis: V3,
    pub limits: [f64; 2],
    /// Everything that this joint carries and the next does not: kg where known, and its centre of gravity.
    pub mass: Option<f64>,
    pub cog: V3,
}

/// A moving joint of the chain as the file has it.
pub(crate) struct Place {
    /// Which joint of the file.
    pub index: usize,
    /// Where it stands at zero.
    pub root_from_joint: Pose,
    /// The link that carries it, in the link that the moving joint before it carries (or in the root).
    pub carried: Pose,
}

/// The chain at its zero position.
pub(crate) struct Serial {
    pub joints: Vec<Axes>,
    pub places: Vec<Place>,
    pub names: Vec<String>,
    pub root_from_tip: Pose,
    pub root: String,
    pub tip: String,
}

struct Tree<'a> {
    file: &'a str,
    urdf: &'a Urdf,
    index: BTreeMap<&'a str, usize>,
    /// Joint above each link.
    above: Vec<Option<usize>>,
    /// Joints below each link.
    below: Vec<Vec<usize>>,
    /// Parent and child link of each joint.
    ends: Vec<(usize, usize)>,
}

impl<'a> Tree<'a> {
    fn of(urdf: &'a Urdf, file: &'a str) -> Result<Self> {
        let mut index = BTreeMap::new();
        for (k, link) in urdf.links.iter().enumerate() {
            if let Some(first) = index.insert(link.name.as_str(), k) {
                let problem = format!("link '{}' is given twice, first on line {}", link.name, urdf.links[first].line);
                return Err(error(file, link.line, problem));
            }
        }
        if urdf.links.is_empty() {
            return Err(ModelError::unreadable(file, "has no <link> within <robot>"));
        }
        let mut names = BTreeMap::new();
        let mut above: Vec<Option<usize>> = vec![None; urdf.links.len()];
        let mut below = vec![Vec::new(); urdf.links.len()];
        let mut ends = Vec::with_capacity(urdf.joints.len());
        for (k, joint) in urdf.joints.iter().enumerate() {
            let Joint { name, line, .. } = joint;
            if let Some(first) = names.insert(name.as_str(), *line) {
                return Err(error(file, *line, format!("joint '{name}' is given twice, first on line {first}")));
            }
            let link = |which: &str, of: &str| match (of, index.get(of)) {
                (_, Some(k)) => Ok(*k),
                ("", None) => Err(error(file, *line, format!("joint '{name}': <{which}> is missing"))),
                _ => Err(error(file, *line, format!("joint '{name}': {which} link '{of}' is not in the file"))),
            };
            let (parent, child) = (link("parent", &joint.parent)?, link("child", &joint.child)?);
            if let Some(other) = above[child] {
                return Err(error(
                    file,
                    *line,
                    format!(
                        "link '{}' is the child of joint '{}' and of joint '{name}': the chain closes on itself, and only \
                         open chains are understood",
                        joint.child, urdf.joints[other].name
                    ),
                ));
            }
            above[child] = Some(k);
            below[parent].push(k);
            ends.push((parent, child));
        }
        Ok(Self { file, urdf, index, above, below, ends })
    }

    fn name(&self, link: usize) -> &'a str {
        &self.urdf.links[link].name
    }

    /// The one link without a parent.
    fn root(&self) -> Result<usize> {
        let roots: Vec<usize> = (0..self.above.len()).filter(|k| self.above[*k].is_none()).collect();
        let Some(root) = roots.first().copied() else {
            let line = self.urdf.links[0].line;
            return Err(error(self.file, line, "every link is the child of a joint: the joints form a closed loop"));
        };
        if let Some(other) = roots.get(1) {
            // of two loose ends the smaller piece is the one that was forgotten
            let loose = if self.below[*other].is_empty() || !self.below[root].is_empty() { *other } else { root };
            let kept = if loose == root { *other } else { root };
            return Err(error(
                self.file,
                self.urdf.links[loose].line,
                format!("link '{}' hangs in the air: no joint ties it to '{}'", self.name(loose), self.name(kept)),
            ));
        }
        // a loop beside the tree has no root: its links are never reached
        let mut reached = vec![false; self.above.len()];
        let mut open = vec![root];
        while let Some(k) = open.pop() {
            reached[k] = true;
            open.extend(self.below[k].iter().map(|j| self.ends[*j].1));
        }
        match reached.iter().position(|r| !r) {
            None => Ok(root),
            Some(k) => Err(error(
                self.file,
                self.urdf.links[k].line,
                format!("link '{}' belongs to joints that form a closed loop", self.name(k)),
            )),
        }
    }

    fn find(&self, name: &str) -> Result<usize> {
        self.index.get(name).copied().ok_or_else(|| {
            let some: Vec<&str> = self.urdf.links.iter().take(40).map(|l| l.name.as_str()).collect();
            let more = if self.urdf.links.len() > 40 { " and more" } else { "" };
            ModelError::Input {
                file: self.file.to_owned(),
                place: format!("link '{name}'"),
                problem: format!("there is no such link; found {}{more}", some.join(", ")),
            }
        })
    }

    /// Joints from `root` down to `tip`.
    fn chain(&self, root: usize, tip: usize) -> Result<Vec<usize>> {
        let mut joints = Vec::new();
        let mut at = tip;
        while at != root {
            let Some(j) = self.above[at] else {
                return Err(ModelError::Input {
                    file: self.file.to_owned(),
                    place: format!("link '{}'", self.name(tip)),
                    problem: format!("does not descend from link '{}'", self.name(root)),
                });
            };
            joints.push(j);
            at = self.ends[j].0;
        }
        joints.reverse();
        Ok(joints)
    }

    fn moves(&self, joint: usize) -> bool {
        self.urdf.joints[joint].kind != "fixed"
    }

    /// The only leaf that a joint moves.
    fn tip(&self, root: usize) -> Result<usize> {
        let mut leaves = Vec::new();
        let mut open = vec![(root, false)];
        while let Some((k, moved)) = open.pop() {
            if self.below[k].is_empty() && moved {
                leaves.push(k);
            }
            open.extend(self.below[k].iter().map(|j| (self.ends[*j].1, moved || self.moves(*j))));
        }
        leaves.sort_unstable();
        let names: Vec<&str> = leaves.iter().take(10).map(|k| self.name(*k)).collect();
        let more = if leaves.len() > 10 { format!(" and {} more", leaves.len() - 10) } else { String::new() };
        match leaves.as_slice() {
            [one] => Ok(*one),
            [] => {
                let problem = format!("no joint moves anything below link '{}'", self.name(root));
                Err(ModelError::unreadable(self.file, problem))
            }
            _ => {
                let (root, likeliest) = (self.name(root), self.name(self.likeliest(root, &leaves)));
                let problem = format!(
                    "has several ends, {}{more}: name the flange as in {}#{root}:{likeliest}",
                    names.join(", "),
                    self.file
                );
                Err(ModelError::unreadable(self.file, problem))
            }
        }
    }

    /// The link that is an arm's flange most likely: it is named so, and as many joints move it as an arm may have. Of a
    /// gripper it is the link where the fingers part, not one of them; and where all ends share a whole arm, its last link.
    fn likeliest(&self, root: usize, leaves: &[usize]) -> usize {
        const NAMES: [&str; 5] = ["tool0", "flange", "tool", "tcp", "ee"];
        // of a gripper, which moves more than the arm does
        const FINGERS: [&str; 4] = ["finger", "knuckle", "jaw", "pad"];
        let moves = |link: usize| self.chain(root, link).map_or(0, |c| c.iter().filter(|j| self.moves(**j)).count());
        let rank = |link: &usize| {
            let name = self.name(*link).to_lowercase();
            let words = name.split(|c: char| !c.is_alphanumeric());
            let named = words.filter_map(|w| NAMES.iter().position(|n| w.starts_with(n))).min();
            let named = named.map_or(0, |k| NAMES.len() - k);
            let moves = moves(*link);
            let few = moves <= MAX_JOINTS;
            let arm = few && !FINGERS.iter().any(|n| name.contains(n));
            let end = self.below[*link].is_empty();
            let whole = moves >= 4;
            let shared = whole && leaves.iter().all(|leaf| self.chain(*link, *leaf).is_ok());
            (arm, named > 0 && whole, shared, if few { moves } else { 0 }, named, end, std::cmp::Reverse(*link))
        };
        let parts = leaves.iter().filter_map(|leaf| self.parting(*leaf)).filter(|link| moves(*link) > 0);
        let shared = leaves.first().and_then(|leaf| {
            self.links_above(*leaf).find(|link| leaves.iter().all(|leaf| self.chain(*link, *leaf).is_ok()))
        });
        leaves.iter().copied().chain(parts).chain(shared).max_by_key(rank).unwrap_or(root)
    }

    /// The last link above `leaf` from which several joints move on.
    fn parting(&self, leaf: usize) -> Option<usize> {
        self.links_above(leaf).find(|link| self.below[*link].iter().filter(|j| self.moves(**j)).count() > 1)
    }

    /// The links from the one above `link` to the root.
    fn links_above(&self, link: usize) -> impl Iterator<Item = usize> {
        let above = |link: usize| self.above[link].map(|j| self.ends[j].0);
        std::iter::successors(above(link), move |link| above(*link))
    }

    /// What link `from`, which stands at `root_from_link`, carries without the joint `except`: joints that branch off stay at
    /// their zero position.
    fn body(&self, from: usize, root_from_link: &Pose, except: &[usize]) -> Inertial {
        let (mut mass, mut moment) = (0.0, V3::zeros());
        let mut open = vec![(from, *root_from_link)];
        while let Some((k, pose)) = open.pop() {
            let own = &self.urdf.links[k].inertial;
            mass += own.mass;
            moment += pose.apply(&own.cog) * own.mass;
            for j in self.below[k].iter().filter(|j| !except.contains(j)) {
                open.push((self.ends[*j].1, pose.compose(&self.urdf.joints[*j].parent_from_joint)));
            }
        }
        Inertial { mass, cog: if mass > 0.0 { moment / mass } else { V3::zeros() } }
    }
}

/// A full turn to either side, for joints without limits.
const CONTINUOUS: [f64; 2] = [-std::f64::consts::TAU, std::f64::consts::TAU];

fn limits(joint: &Joint, file: &str) -> Result<[f64; 2]> {
    let bad = |line, problem: &str| Err(error(file, line, format!("joint '{}': {problem}", joint.name)));
    match joint.limit {
        None => bad(joint.line, "<limit> is missing, and its lower and upper are needed"),
        Some((line, None, None)) => bad(line, "<limit> has neither lower nor upper"),
        Some((line, None, _)) => bad(line, "<limit> has no lower"),
        Some((line, _, None)) => bad(line, "<limit> has no upper"),
        Some((line, Some(a), Some(b))) if a >= b => {
            bad(line, &format!("<limit> found lower {a} and upper {b}, expected a lower and a higher number"))
        }
        Some((_, Some(a), Some(b))) if joint.kind != "prismatic" && -a >= NO_LIMIT && b >= NO_LIMIT => Ok(CONTINUOUS),
        Some((_, Some(a), Some(b))) => {
            // as far as a robot file may have it: 5000 m of a slide are meant as mm
            let kind = if joint.kind == "prismatic" { JointKind::Prismatic } else { JointKind::Revolute };
            let most = FARTHEST / kind.unit().0 * (1.0 - 1e-9);
            Ok([a, b].map(|l| l.clamp(-most, most)))
        }
    }
}

/// The chain from link `root` (the root of the tree) to link `tip` (the only end of it).
pub(crate) fn serial(urdf: &Urdf, file: &str, root: Option<&str>, tip: Option<&str>) -> Result<Serial> {
    let tree = Tree::of(urdf, file)?;
    let top = tree.root()?;
    let root = root.map_or(Ok(top), |name| tree.find(name))?;
    let tip = tip.map_or_else(|| tree.tip(root), |name| tree.find(name))?;
    let chain = tree.chain(root, tip)?;
    let (mut joints, mut names): (Vec<Axes>, Vec<String>) = (Vec::new(), Vec::new());
    let (mut pose, mut carried) = (Pose::identity(), Pose::identity());
    let mut places = Vec::new();
    let mut has_masses = false;
    for (k, index) in chain.iter().enumerate() {
        let joint = &urdf.joints[*index];
        let carrier = carried;
        pose = pose.compose(&joint.parent_from_joint);
        carried = carried.compose(&joint.parent_from_joint);
        let bad = |problem: String| Err(error(file, joint.line, format!("joint '{}' {problem}", joint.name)));
        let kind = match joint.kind.as_str() {
            "fixed" => continue,
            "revolute" | "continuous" => JointKind::Revolute,
            "prismatic" => JointKind::Prismatic,
            "floating" | "planar" => {
                return bad(format!("is {}; expected revolute, continuous, prismatic or fixed", joint.kind));
            }
            other => return bad(format!("has type '{other}'; expected revolute, continuous, prismatic or fixed")),
        };
        if let Some(problem) = &joint.problem {
            return Err(problem.clone());
        }
        if let Some(other) = &joint.mimics {
            return bad(format!("mimics joint '{other}', and joints that are tied together are not understood"));
        }
        if joints.len() == MAX_JOINTS {
            let last = chain.iter().rev().filter(|j| tree.moves(**j)).nth(MAX_JOINTS - 1).unwrap_or(index);
            return bad(format!(
                "is one too many: an arm has 1 to {MAX_JOINTS} moving joints; name links with as many between them, as in {file}#{}:{}",
                urdf.joints[*last].parent,
                tree.name(tip)
            ));
        }
        let child = tree.ends[*index].1;
        // up to the next joint that moves; fixed ones belong to this body, and so do branches
        let next = chain[k + 1..].iter().find(|j| tree.moves(**j));
        let body = tree.body(child, &pose, next.map_or(&[], std::slice::from_ref));
        has_masses |= body.mass > 0.0;
        names.push(joint.name.clone());
        places.push(Place { index: *index, root_from_joint: pose, carried: carrier });
        carried = Pose::identity();
        joints.push(Axes {
            kind,
            point: pose.translation,
            axis: pose.rotation * joint.axis,
            limits: if joint.kind == "continuous" { CONTINUOUS } else { limits(joint, file)? },
            mass: Some(body.mass),
            cog: body.cog,
        });
    }
    if joints.is_empty() {
        let problem = format!("no joint moves between link '{}' and link '{}'", tree.name(root), tree.name(tip));
        return Err(ModelError::unreadable(file, problem));
    }
    if !has_masses {
        joints.iter_mut().for_each(|j| j.mass = None);
    }
    let (root, tip) = (tree.name(root).to_owned(), tree.name(tip).to_owned());
    Ok(Serial { joints, places, names, root_from_tip: pose, root, tip })
}
