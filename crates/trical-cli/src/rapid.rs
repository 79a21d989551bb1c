//! RAPID programs: targets found in the text, numbers replaced, everything else left to the byte.

use nalgebra::Vector3;
use trical_model::ik::{IkError, continue_from, nearest_solution};
use trical_model::pose::{quaternion_from_rotation, rotation_from_quaternion};
use trical_model::{Forward, Joints, Pose, State};

use crate::error::{CliError, Result};

/// The mark that keeps a program from being compensated twice.
pub const MARK: &str = "! compensated by TriCal";

/// A number in the text: where it stands and what it says.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    from: usize,
    to: usize,
    value: f64,
}

/// A bracketed list: numbers, or lists.
#[derive(Clone, Debug, PartialEq)]
enum Item {
    Number(Number),
    List(Vec<Item>),
    Other,
}

/// A target in the text.
enum Target {
    /// Position, mm, and quaternion w, x, y, z.
    Pose { position: [Number; 3], quaternion: [Number; 4] },
    /// Joint values, deg.
    Joints(Vec<Number>),
}

/// All lists of the text that stand outside comments and strings.
fn lists(text: &str) -> Vec<(usize, Item)> {
    let bytes = text.as_bytes();
    let mut out = Vec::new();
    let mut i = 0;
    while i < bytes.len() {
        match bytes[i] {
            b'!' => i = end_of_line(bytes, i),
            b'"' => i = end_of_string(bytes, i),
            b'[' => {
                let start = i;
                let (item, next) = list(text, i + 1);
                i = next;
                out.push((start, item));
            }
            _ => i += 1,
        }
    }
    out
}

fn end_of_line(bytes: &[u8], from: usize) -> usize {
    bytes[from..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |k| from + k)
}

fn end_of_string(bytes: &[u8], from: usize) -> usize {
    bytes[from + 1..].iter().position(|b| *b == b'"').map_or(bytes.len(), |k| from + k + 2)
}

fn list(text: &str, from: usize) -> (Item, usize) {
    let bytes = text.as_bytes();
    let mut items = Vec::new();
    let mut i = from;
    while i < bytes.len() {
        match bytes[i] {
            b']' => return (Item::List(items), i + 1),
            b'[' => {
                let (item, next) = list(text, i + 1);
                items.push(item);
                i = next;
            }
            b'!' => i = end_of_line(bytes, i),
            b'"' => {
                items.push(Item::Other);
                i = end_of_string(bytes, i);
            }
            b',' | b' ' | b'\t' | b'\r' | b'\n' => i += 1,
            _ => {
                let start = i;
                while i < bytes.len() && !matches!(bytes[i], b',' | b']' | b'[' | b'!' | b'"') {
                    i += 1;
                }
                let word = text.get(start..i).unwrap_or("").trim_end();
                items.push(match word.parse::<f64>() {
                    Ok(value) if value.is_finite() => {
                        Item::Number(Number { from: start, to: start + word.len(), value })
                    }
                    _ => Item::Other,
                });
            }
        }
    }
    (Item::Other, i)
}

fn numbers(item: &Item) -> Option<Vec<Number>> {
    match item {
        Item::List(items) => items
            .iter()
            .map(|i| match i {
                Item::Number(n) => Some(*n),
                _ => None,
            })
            .collect(),
        _ => None,
    }
}

/// A list as a target (robtarget: 3, 4, 4 and 6 numbers; jointtarget: 6 and 6), or the targets inside it.
fn targets(item: &Item, joints: usize, out: &mut Vec<Target>) {
    let Item::List(items) = item else { return };
    let parts: Vec<Option<Vec<Number>>> = items.iter().map(numbers).collect();
    let lengths: Vec<usize> = parts.iter().map(|p| p.as_ref().map_or(usize::MAX, Vec::len)).collect();
    match (lengths.as_slice(), parts.as_slice()) {
        ([3, 4, 4, 6], [Some(p), Some(q), ..]) => {
            if let (Ok(position), Ok(quaternion)) = (p.as_slice().try_into(), q.as_slice().try_into()) {
                out.push(Target::Pose { position, quaternion });
            }
        }
        ([6, 6], [Some(q), _]) if joints <= 6 => out.push(Target::Joints(q.iter().take(joints).copied().collect())),
        _ => items.iter().for_each(|i| targets(i, joints, out)),
    }
}

/// A rewritten program.
pub struct Rewritten {
    /// The text.
    pub text: String,
    /// How far each target moved, mm.
    pub moved_mm: Vec<f64>,
    /// Targets that could not be rewritten: line and reason.
    pub problems: Vec<String>,
    /// Poses that the program wants, in {w}, and the joints with which the controller will go there after rewriting.
    pub poses: Vec<(Pose, Joints)>,
}

/// Rewrites targets so that the arm of `model` goes where the program says. Poses are in the robot's base frame (wobj0) with
/// the cell's tool; `seed` starts inverse kinematics.
pub fn rewrite(text: &str, nominal: &Forward, model: &Forward, file: &str) -> Result<Rewritten> {
    if text.contains(MARK) {
        return Err(CliError::Input(format!(
            "{file}: is compensated already (it has the line '{MARK} ...'); compensate the original instead"
        )));
    }
    let dof = model.model().robot.dof();
    let world_from_base = nominal.model().cell.world_from_base;
    let (mut nominal_ws, mut model_ws) = (nominal.workspace(), model.workspace());
    let mut edits: Vec<(usize, usize, String)> = Vec::new();
    let mut out = Rewritten { text: String::new(), moved_mm: Vec::new(), problems: Vec::new(), poses: Vec::new() };
    let mut seed = State::at(&[0.0; 9]);
    for (at, item) in lists(text) {
        let mut found = Vec::new();
        targets(&item, dof, &mut found);
        let line = 1 + text[..at].matches('\n').count();
        for target in found {
            let wanted = match &target {
                Target::Pose { position, quaternion } => {
                    let q = quaternion.map(|n| n.value);
                    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
                    if (norm - 1.0).abs() > 0.01 {
                        out.problems.push(format!("line {line}: the quaternion has length {norm:.4}, expected 1"));
                        continue;
                    }
                    let in_base = Pose {
                        rotation: rotation_from_quaternion(q),
                        translation: Vector3::from(position.map(|n| n.value)) * 1e-3,
                    };
                    let world = world_from_base.compose(&in_base);
                    match nearest_solution(nominal, &world, &seed, &mut nominal_ws) {
                        Ok(q) => seed.q = q,
                        Err(e) => {
                            out.problems.push(format!("line {line}: the program's own target: {e}"));
                            continue;
                        }
                    }
                    world
                }
                Target::Joints(values) => {
                    for (q, n) in seed.q.iter_mut().zip(values) {
                        *q = n.value.to_radians();
                    }
                    nominal.world_from_tool(&seed, &mut nominal_ws)
                }
            };
            // joints with which the real arm is where the program says, on the same branch
            let joints = match continue_from(model, &wanted, &seed, &mut model_ws) {
                Ok(q) => q,
                Err(e) => {
                    let what = match e {
                        IkError::Singular { .. } => "near a singularity: ",
                        _ => "",
                    };
                    out.problems.push(format!("line {line}: {what}{e}"));
                    continue;
                }
            };
            let commanded = nominal.world_from_tool(&State::at(&joints), &mut nominal_ws);
            out.moved_mm.push((commanded.translation - wanted.translation).norm() * 1e3);
            out.poses.push((wanted, joints));
            match target {
                Target::Pose { position, quaternion } => {
                    let in_base = world_from_base.inverse().compose(&commanded);
                    for (k, n) in position.iter().enumerate() {
                        edits.push((n.from, n.to, format_number(in_base.translation[k] * 1e3, n.value, 4)));
                    }
                    let mut q = quaternion_from_rotation(&in_base.rotation);
                    // the sign that the program had
                    if q.iter().zip(&quaternion).map(|(a, b)| a * b.value).sum::<f64>() < 0.0 {
                        q = q.map(|x| -x);
                    }
                    for (v, n) in q.iter().zip(&quaternion) {
                        edits.push((n.from, n.to, format_number(*v, n.value, 8)));
                    }
                }
                Target::Joints(values) => {
                    for (v, n) in joints.iter().zip(&values) {
                        edits.push((n.from, n.to, format_number(v.to_degrees(), n.value, 6)));
                    }
                }
            }
        }
    }
    let mut at = 0;
    for (from, to, new) in edits {
        out.text.push_str(&text[at..from]);
        out.text.push_str(&new);
        at = to;
    }
    out.text.push_str(&text[at..]);
    Ok(out)
}

/// The mark, to be put before the program.
pub fn with_mark(text: &str, model: &str) -> String {
    let end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let line = format!("{MARK} {} with {model}", env!("CARGO_PKG_VERSION"));
    // a module's header attributes (%%% ... %%%) must stay first
    match text.rfind("%%%") {
        Some(k) if text.trim_start().starts_with("%%%") => {
            let after = text[k..].find('\n').map_or(text.len(), |n| k + n + 1);
            format!("{}{line}{end}{}", &text[..after], &text[after..])
        }
        _ => format!("{line}{end}{text}"),
    }
}

/// The number with `decimals` places; the old text's value if it is the same to that precision.
fn format_number(new: f64, old: f64, decimals: usize) -> String {
    let text = format!("{new:.decimals$}");
    let same = format!("{old:.decimals$}") == text;
    let shown = if same { format!("{old}") } else { text };
    if shown.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { "0".into() } else { shown }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;
    use trical_model::{Basis, Cell, Model, Motion, Parameter, Robot, Site, Term};

    const ROBOT: &str = include_str!("../../../cells/irb120/robot.toml");
    const CELL: &str = include_str!("../../../cells/irb120/cell.toml");
    const PROGRAM: &str = include_str!("../assets/sample.mod");

    fn nominal() -> Model {
        Model::nominal(Robot::parse(ROBOT, "r").unwrap(), Cell::parse(CELL, "c").unwrap())
    }

    fn forward(terms: Vec<Term>) -> Forward {
        Forward::new(Model { terms, ..nominal() }, Vec::new()).unwrap()
    }

    #[test]
    fn an_identity_model_moves_nothing() {
        let f = forward(Vec::new());
        let r = rewrite(PROGRAM, &f, &f, "p").unwrap();
        assert!(r.problems.is_empty(), "{:?}", r.problems);
        assert!(r.moved_mm.iter().all(|m| *m < 1e-6));
        // numbers may lose digits beyond the eighth of a quaternion, nothing else changes
        let strip = |t: &str| t.chars().filter(|c| !c.is_ascii_digit() && *c != '.' && *c != '-').collect::<String>();
        assert_eq!(strip(&r.text), strip(PROGRAM));
    }

    #[test]
    fn the_arm_goes_where_the_program_says() {
        let mut a = Term::new("a", "geometry", Site::Link { link: 2, parameter: Parameter::A }, Basis::CONSTANT);
        a.value = 0.5e-3;
        let mut t = Term::new("t", "geometry", Site::Link { link: 3, parameter: Parameter::Theta }, Basis::CONSTANT);
        t.value = 2e-3;
        let mut b = Term::new("b", "base", Site::Base(Motion::ALL[0]), Basis::CONSTANT);
        b.value = 1e-3;
        let (nominal, real) = (forward(Vec::new()), forward(vec![a, t, b]));
        let r = rewrite(PROGRAM, &nominal, &real, "p").unwrap();
        assert!(r.problems.is_empty(), "{:?}", r.problems);
        assert_eq!(r.poses.len(), 7);
        let (mut ws, mut nws) = (real.workspace(), nominal.workspace());
        // the rewritten program, read again as the controller reads it, driven on the real arm
        let again = rewrite(&r.text, &nominal, &nominal, "p").unwrap();
        for ((wanted, _), (commanded, joints)) in r.poses.iter().zip(&again.poses) {
            let controller = nominal.world_from_tool(&State::at(joints), &mut nws);
            assert!((controller.translation - commanded.translation).norm() < 1e-9);
            let reached = real.world_from_tool(&State::at(joints), &mut ws);
            assert!(
                (reached.translation - wanted.translation).norm() < 2e-7,
                "{}",
                (reached.translation - wanted.translation).norm()
            );
        }
    }

    #[test]
    fn comments_and_strings_are_left_alone() {
        let f = forward(Vec::new());
        let text = "! CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\"[[1,2,3]]\"\n";
        assert_eq!(rewrite(text, &f, &f, "p").unwrap().text, text);
    }

    #[test]
    fn twice_is_refused() {
        let f = forward(Vec::new());
        let once = with_mark(PROGRAM, "calibrated.toml");
        assert!(rewrite(&once, &f, &f, "p").is_err());
    }
}
