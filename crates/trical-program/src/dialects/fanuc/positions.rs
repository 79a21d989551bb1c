//! Positions of a FANUC listing: what `P[1]{ ... };` says of the arm.

use crate::branch::Configuration;
use crate::literal::Shape;
use crate::names::Names;
use crate::packed::External;
use crate::scan::{Scan, Setup, hashed};
use crate::text::{Cursor, Span, lower};

const POSE: [&[u8]; 6] = [b"X", b"Y", b"Z", b"W", b"P", b"R"];

const JOINTS: [&[u8]; 9] = [b"J1", b"J2", b"J3", b"J4", b"J5", b"J6", b"J7", b"J8", b"J9"];

/// What is wrong with positions for two arms.
const ANOTHER_ARM: &str =
    "has a pose of another arm too (GP2 or higher), which stays as it is; only the first such position is named";

/// What a position says of the arm, which is motion group 1.
#[derive(Default)]
struct Fields<'a> {
    /// Coordinates and joints by name; nothing where a value is no number.
    numbers: Vec<(&'a [u8], Option<Span>)>,
    configuration: Option<Configuration>,
    /// Turn numbers of the configuration.
    turns: Option<[(Span, i16); 3]>,
    tool: Option<String>,
    frame: Option<String>,
    /// Whether a value is `***`.
    untaught: bool,
    /// Whether another motion group is at a pose: a second arm.
    another_arm: bool,
    /// `L` or `R`: to which side the elbow of a SCARA points.
    hand: Option<u8>,
    problem: Option<String>,
}

impl<'a> Fields<'a> {
    /// `{ GP1: UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = ... }`, to its closing brace.
    fn read(c: &mut Cursor<'a>) -> Self {
        let (mut found, mut group) = (Self::default(), 1);
        while !c.done() && c.peek() != b'}' {
            let word = c.name_ahead();
            if word.is_empty() {
                c.at += usize::from(c.peek() != b'}');
            } else if word.len() == 3 && word.starts_with(b"GP") {
                group = word[2].wrapping_sub(b'0');
            } else {
                let at = *c;
                if !(c.eat(b':') || c.eat(b'=')) {
                    *c = at;
                    continue;
                }
                c.skip_space();
                if group == 1 {
                    found.value(word, c);
                } else {
                    found.another_arm |= word == b"X";
                }
            }
        }
        found
    }

    /// What stands behind the sign of a field.
    fn value(&mut self, word: &'a [u8], c: &mut Cursor<'a>) {
        if c.peek() == b'\'' {
            let start = c.at;
            c.skip_string();
            self.turns = turns(c, start);
            self.hand = hand(&c.bytes[start..c.at]);
            match config(&c.bytes[start..c.at], self.turns.map(|all| all.map(|(_, turn)| turn))) {
                Some(found) => self.configuration = Some(found),
                None => {
                    let text = String::from_utf8_lossy(&c.bytes[start..c.at.min(start + 40)]).into_owned();
                    self.problem = Some(format!("has the configuration {text}, which is not understood"));
                }
            }
        } else if word == b"UT" || word == b"UF" {
            let text = match c.number() {
                Some(n) => lower(n.text(c.bytes)),
                None => lower(c.word()),
            };
            *(if word == b"UT" { &mut self.tool } else { &mut self.frame }) = Some(text);
        } else {
            let value = c.number();
            self.untaught |= value.is_none() && c.peek() == b'*';
            if matches!(word, [b'R', b'X' | b'Y' | b'Z' | b'W' | b'P' | b'R']) {
                self.problem = Some("is given relative to another motion group (RX ...)".into());
            }
            self.numbers.push((word, value));
        }
    }

    fn number(&self, name: &[u8]) -> Option<Span> {
        self.numbers.iter().rfind(|(n, _)| *n == name)?.1
    }

    /// To which side an elbow points has to be the same in the whole listing.
    fn check_hand(&mut self, scan: &mut Scan) {
        let Some(letter) = self.hand else { return };
        let first = *scan.hand.get_or_insert(letter);
        if first != letter {
            let [first, letter] = [first, letter].map(char::from);
            self.problem.get_or_insert(format!(
                "has the configuration '{letter}' where the first position that says one has '{first}': to which side the elbow points is followed \
                 only where it stays the same"
            ));
        }
    }

    /// The number of the tool or frame that was said; F is whichever is `active` when the program runs.
    fn numbered(&mut self, is_tool: bool, active: &Result<Option<String>, String>) -> Option<String> {
        let said = if is_tool { self.tool.take() } else { self.frame.take() }?;
        if said.bytes().all(|b| b.is_ascii_digit()) {
            return Some(said);
        }
        active.clone().unwrap_or_else(|e| {
            self.problem.get_or_insert(e);
            None
        })
    }
}

/// `P[1:"name"]{ ... };`: its name, and what is wrong with it where it has no numbers.
pub fn position(
    c: &mut Cursor<'_>,
    from: usize,
    active: &[Result<Option<String>, String>; 2],
    scan: &mut Scan,
    names: &mut Names,
) -> Option<(u64, Option<String>)> {
    c.at += 1;
    let number = c.number()?;
    while !c.done() && c.peek() != b'{' {
        if c.peek() == b'"' { c.skip_string() } else { c.at += 1 }
    }
    let name = Span::new(from, c.at.min(from + 40));
    let hash = hashed(number.text(c.bytes));
    let mut found = Fields::read(c);
    found.check_hand(scan);
    // told once
    if found.another_arm && !scan.problems.iter().any(|(_, what)| what == ANOTHER_ARM) {
        scan.problem(from, ANOTHER_ARM);
    }
    let pose: Option<Vec<Span>> = POSE.iter().map(|n| found.number(n)).collect();
    // joint values are in no frame
    let active_frame = if pose.is_some() { &active[1] } else { &Ok(None) };
    let setup = Setup { tool: found.numbered(true, &active[0]), frame: found.numbered(false, active_frame) };
    let joints: Vec<Span> = JOINTS.iter().map_while(|n| found.number(n)).collect();
    if found.problem.is_none() && pose.is_none() && joints.is_empty() {
        let what = if found.untaught { "is not taught (***)" } else { "has no position of six numbers in GP1" };
        found.problem = Some(what.into());
    }
    if found.problem.is_some() {
        names.listed(hash);
        return Some((hash, found.problem));
    }
    let external = External::of(&[b"E1", b"E2", b"E3"].map(|axis| found.number(axis)?.value(c.bytes)));
    let spot = match pose {
        Some(mut numbers) => {
            numbers.extend(found.turns.iter().flatten().map(|(span, _)| *span));
            scan.push(Shape::Xyz, &numbers, found.configuration.unwrap_or(Configuration::Free), name, external)
        }
        None => scan.push(Shape::JointsFanuc, &joints, Configuration::Free, name, external),
    };
    let setup = scan.setup(setup);
    scan.assign(spot, setup);
    names.declare(hash);
    names.define(hash, spot as usize, spot as usize + 1);
    Some((hash, None))
}

/// The turn numbers in `'N U T, 0, 0, 0'`, which stands from `at` to the cursor.
fn turns(c: &Cursor<'_>, at: usize) -> Option<[(Span, i16); 3]> {
    let mut inside = Cursor::at(c.bytes.get(..c.at)?, at, 0);
    let mut next = || {
        inside.skip_to(b",");
        let number = inside.eat_in_line(b',').then(|| inside.number())??;
        Some((number, number.value(c.bytes)? as i16))
    };
    Some([next()?, next()?, next()?])
}

/// `'N U T, 0, 0, 0'`, with these turn numbers; `None` where letters stand there that mean something else.
fn config(text: &[u8], turns: Option<[i16; 3]>) -> Option<Configuration> {
    let words = || text.split(|b| !b.is_ascii_alphanumeric()).filter(|w| w.iter().any(u8::is_ascii_alphabetic));
    let has = |b: u8| words().any(|w| w == [b]);
    if words().next().is_none() || hand(text).is_some() {
        return Some(Configuration::Free);
    }
    let whole = (has(b'N') || has(b'F')) && (has(b'U') || has(b'D')) && (has(b'T') || has(b'B'));
    whole.then(|| Configuration::Fanuc { flip: has(b'F'), up: has(b'U'), front: has(b'T'), turns })
}

/// The letter of `'L, 0, 0, 0'` or `'R, 0, 0, 0'`, which stands alone.
fn hand(text: &[u8]) -> Option<u8> {
    let mut letters = text.iter().copied().filter(u8::is_ascii_alphabetic);
    let first = letters.next().filter(|b| matches!(b, b'L' | b'R'))?;
    letters.next().is_none().then_some(first)
}
