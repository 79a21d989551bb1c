//! Statements of a FANUC listing, as text: what each does, and the places that it names.

use crate::text::{is_among_as_written, lower};

/// What activates a tool, and a user frame.
pub const ACTIVE: [[&str; 2]; 2] = [["UTOOL_NUM", "$MNUTOOLNUM"], ["UFRAME_NUM", "$MNUFRAMENUM"]];

/// The number of the tool or frame that a statement activates for the arm by one of these names; empty where it calculates it.
pub fn activated(upper: &[u8], names: [&str; 2]) -> Option<String> {
    let rest = names.iter().find_map(|name| upper.strip_prefix(name.as_bytes()))?.trim_ascii_start();
    let close = rest.iter().position(|b| *b == b']').filter(|_| rest.starts_with(b"["));
    let (groups, rest) = rest.split_at(close.map_or(0, |k| k + 1));
    if !groups.is_empty() && !groups.contains(&b'1') {
        return None;
    }
    let rest = rest.trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
    let digits = rest.iter().take_while(|b| b.is_ascii_digit()).count();
    Some(lower(&rest[..digits]))
}

/// A line of /MN without its number; generators leave the number out, or the colon too.
pub fn statement(line: &[u8]) -> &[u8] {
    let text = line.trim_ascii_start();
    let behind = text.iter().position(|b| !b.is_ascii_digit() && !b.is_ascii_whitespace()).unwrap_or(0);
    text[behind..].strip_prefix(b":").unwrap_or(text).trim_ascii_start()
}

/// Whether what stands here is a remark, or a statement that was made one.
pub fn is_remark(text: &[u8]) -> bool {
    [&b"!"[..], b"//", b"--"].iter().any(|sign| text.starts_with(sign))
}

/// A statement without the remark that a person or a generator wrote behind its end.
pub fn without_remark(text: &[u8]) -> &[u8] {
    let is_end = |k: &usize| text[*k] == b';' && is_remark(text[k + 1..].trim_ascii_start());
    (0..text.len()).find(is_end).map_or(text, |end| &text[..=end])
}

/// Whether a line has this word, with nothing of a name before it.
pub fn has(line: &[u8], word: &[u8]) -> bool {
    line.windows(word.len()).enumerate().any(|(k, w)| {
        let before =
            k.checked_sub(1).and_then(|k| line.get(k)).is_some_and(|b| b.is_ascii_alphanumeric() || *b == b'_');
        let behind = line.get(k + word.len()).is_some_and(|b| b.is_ascii_alphanumeric() || *b == b'_');
        w == word && !before && !behind
    })
}

/// First words of statements that do not move the arm, or are read for how they do.
const STATEMENTS: &str = " J L C S A P PR R F M DO DI RO RI GO GI AO AI SO SI UO UI WO WI SR AR VR TIMER IF ELSE ENDIF SELECT FOR ENDFOR \
    WAIT JMP LBL CALL RUN OVERRIDE PAUSE ABORT END MESSAGE UALM UFRAME UTOOL PAYLOAD SKIP OFFSET TOOL COL MONITOR RSR LOCK UNLOCK JOINT \
    LINEAR ERROR RESUME STRLEN SUBSTR FINDSTR VISION ARC WEAVE TRACK TC DIAG TORQ PULSE BREAK SOFTFLOAT STOP LINE SENSOR POINT PERCH \
    DEFAULT EG INDEPENDENT SIMULTANEOUS ";

/// Beginnings of statements behind which motions end elsewhere than they say, until one of the same kind says END.
pub const DISPLACES: [&[u8]; 2] = [b"TRACK ", b"TOUCH OFFSET "];

/// Beginning of a statement that moves the arm against a part by force, from where it stands.
pub const BY_FORCE: &[u8] = b"FORCE CTRL";

/// Whether a statement that begins with this word (in capitals) is one of the user's.
pub fn is_macro(word: &[u8]) -> bool {
    !word.is_empty() && !is_among_as_written(word, STATEMENTS)
}

/// A statement with blanks in the place of what is only said: comments in brackets (`R[15:Trolley INC]`), the first motion group
/// (`PR[GP1:1,3]`), and the names of programs that it calls.
pub fn without_names(mut upper: Vec<u8>) -> Vec<u8> {
    let mut comment = None;
    let mut depth = 0_usize;
    for k in 0..upper.len() {
        match upper[k] {
            b'[' if comment.is_none() => {
                depth += 1;
                if upper[k + 1..].starts_with(b"GP1:") {
                    upper[k + 1..k + 5].fill(b' ');
                }
            }
            b']' => {
                depth = depth.saturating_sub(1);
                comment = comment.filter(|of| *of <= depth);
            }
            b':' if depth > 0 => comment = comment.or(Some(depth)),
            _ => {}
        }
        if comment.is_some() && !upper[k].is_ascii_whitespace() {
            upper[k] = b' ';
        }
    }
    let mut at = 0;
    while let Some(call) = upper[at..].windows(5).position(|w| w == b"CALL ") {
        at += call + 5;
        let name = upper[at..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
        upper[at..at + name].fill(b' ');
    }
    upper
}

/// The places that a line names, `P[3]` and `PR[3]`: offset, whether it is a register, and its digits.
pub fn places(upper: &[u8]) -> Vec<(usize, bool, &[u8])> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(k) = upper[at..].iter().position(|b| *b == b'[') {
        let open = at + k;
        at = open + 1;
        let name = upper[..open].iter().rev().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
        let name = &upper[open - name..open];
        if name == b"P" || name == b"PR" {
            at += upper[at..].iter().take_while(|b| **b == b' ').count();
            let digits = upper[at..].iter().take_while(|b| b.is_ascii_digit()).count();
            found.push((open - name.len(), name == b"PR", &upper[at..at + digits]));
        }
    }
    found
}

/// Whether a place, `PR[3,5]`, is one of its angles.
pub fn is_one_angle(place: &[u8]) -> bool {
    let open = place.iter().position(|b| *b == b'[').map_or(place.len(), |open| open + 1);
    let mut behind = place[open..].iter().filter(|b| **b != b' ').skip_while(|b| b.is_ascii_digit());
    behind.next() == Some(&b',') && matches!(behind.next(), Some(b'4'..=b'6')) && behind.next() == Some(&b']')
}

/// Where `=` stands behind the bracket that the line begins with, `PR[R[1],3]=`; a motion's `DO[1]=ON` stands farther.
pub fn assigned(upper: &[u8]) -> Option<usize> {
    let mut depth = 0_usize;
    let close = upper.iter().position(|b| {
        depth = match b {
            b'[' => depth + 1,
            b']' => depth.saturating_sub(1),
            _ => return false,
        };
        depth == 0
    })?;
    let behind = &upper[close + 1..];
    let blanks = behind.iter().take_while(|b| b.is_ascii_whitespace()).count();
    (behind.get(blanks) == Some(&b'=')).then_some(close + 1 + blanks)
}

/// Where the statement ends whose first line is `from..at`: lines that begin with `:` belong to the one above, as long as that has
/// no end.
pub fn continued(bytes: &[u8], mut from: usize, mut at: usize, end: usize) -> usize {
    for line in bytes[at..end].split_inclusive(|b| *b == b'\n') {
        let has_end = without_remark(&bytes[from..at]).trim_ascii_end().ends_with(b";");
        if has_end || !line.trim_ascii_start().starts_with(b":") {
            break;
        }
        (from, at) = (at, at + line.len());
    }
    at
}

/// Tools and user frames of the controller, by their names in a program and as system variables (`$GROUP[1].$UFRAME` too).
const FRAMES: [&[u8]; 4] = [b"UTOOL", b"UFRAME", b"MNUTOOL", b"MNUFRAME"];

/// The bytes that stand in no bracket, and where.
fn outside_brackets(upper: &[u8]) -> impl Iterator<Item = (usize, u8)> {
    let mut depth = 0_usize;
    upper.iter().copied().enumerate().filter(move |(_, b)| {
        let before = depth;
        match b {
            b'[' | b'(' => depth += 1,
            b']' | b')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        before == 0 && depth == 0
    })
}

/// Whether a statement sets a tool or a user frame: one of their names stands before `=`, and in no bracket.
pub fn sets_frame(upper: &[u8]) -> bool {
    let outside: Vec<u8> = outside_brackets(upper).map(|(_, b)| b).collect();
    let equals = outside.iter().position(|b| *b == b'=');
    equals.is_some_and(|equals| FRAMES.iter().any(|name| has(&outside[..equals], name)))
}

/// What a statement does: of `IF ...,UFRAME[1]=PR[2]`, what is behind the condition.
pub fn action(upper: &[u8]) -> &[u8] {
    if !upper.starts_with(b"IF") || upper.get(2).is_some_and(u8::is_ascii_alphanumeric) {
        return upper;
    }
    let behind = outside_brackets(upper).find(|(_, b)| *b == b',').map_or(upper.len(), |(comma, _)| comma + 1);
    upper[behind..].trim_ascii_start()
}

/// Whether a loop, of which this is what follows its first line, activates a tool or a frame.
pub fn loop_activates(behind: &[u8]) -> bool {
    let mut depth = 1;
    for line in behind.split(|b| *b == b'\n') {
        let upper = statement(line).to_ascii_uppercase();
        match upper.split(|b| !b.is_ascii_alphabetic()).next() {
            Some(b"FOR") => depth += 1,
            Some(b"ENDFOR") if depth == 1 => return false,
            Some(b"ENDFOR") => depth -= 1,
            _ if ACTIVE.iter().any(|names| activated(action(&upper), *names).is_some()) => return true,
            _ => {}
        }
    }
    false
}

/// Whether a statement moves the arm.
pub fn moves(upper: &[u8]) -> bool {
    let is_letter = matches!(upper.first(), Some(b'J' | b'L' | b'C' | b'S' | b'A'))
        && !upper.get(1).is_some_and(u8::is_ascii_alphanumeric);
    // `A[1]=AN` of a German listing sets an output
    let is_indexed = upper.get(1..).is_some_and(|rest| rest.trim_ascii_start().starts_with(b"["));
    is_letter && !is_indexed || matches!(upper.get(..2), Some(b"P[" | b"PR"))
}

/// What moves motion group 1 in a statement that moves several (`GP1 J P[1] 100% FINE`, in lines of its own), and its offset.
pub fn of_first_group(upper: &[u8]) -> Option<(usize, &[u8])> {
    let mut found = None;
    let mut at = 0;
    for line in upper.split_inclusive(|b| *b == b'\n') {
        let text = statement(line);
        match (found, text.strip_prefix(b"GP1")) {
            (Some(from), _) if text.starts_with(b"GP") => return Some((from, &upper[from..at])),
            (None, Some(motion)) => found = Some(at + line.len() - motion.trim_ascii_start().len()),
            _ => {}
        }
        at += line.len();
    }
    found.map(|from| (from, &upper[from..]))
}

/// Where a motion goes that goes to no position and no register, `PAL_1[A_1]`.
pub fn unread(upper: &[u8]) -> Option<&[u8]> {
    let target = upper.get(1..)?.trim_ascii_start();
    let target = target.strip_prefix(b"@").unwrap_or(target);
    let is_read = upper.starts_with(b"P") || target.starts_with(b"P[") || target.starts_with(b"PR[");
    let end = target.iter().position(|b| b.is_ascii_whitespace() || *b == b';').unwrap_or(target.len());
    (!is_read && end > 0).then_some(&target[..end])
}
