//! RAPID's calls of routines of the same file: what functions return (`RETURN Offs(p,0,0,h);`), and with which tools and
//! work objects routines move that get them as arguments.

use super::given::{DEEPEST, Each, Given, MOST_CALLS, place_of};
use super::reader::Reader;
use crate::names::{Meant, Origin};
use crate::scan::{Setup, hashed, hashed_as_written};

impl Reader<'_> {
    /// A call of a routine of this file was read.
    pub(super) fn called(&mut self, routine: u64, given: Vec<(u64, Given)>) {
        let all = self.calls.all.entry(routine).or_default();
        // one beyond says that there are too many
        if all.len() <= MOST_CALLS {
            all.push(given);
        }
    }

    /// A tool or a work object that a call gives for this argument, at the cursor.
    pub(super) fn gives_frame(&mut self, argument: u64) {
        let mut c = self.c;
        let word = c.word();
        c.skip_space();
        let is_name = !word.is_empty() && matches!(c.peek(), b',' | b';' | b'\\' | b')');
        let given = if is_name { Given::Frame(self.frame_name(word)) } else { Given::Unclear };
        self.calls.given.push((argument, given));
    }

    /// A tool or a work object of this name is an argument of the routine that is being read.
    pub(super) fn takes_frame(&mut self, name: &str, word: &[u8]) {
        let of = (self.key(word), hashed(self.within.as_bytes()));
        self.calls.arguments.insert(name.to_owned(), of);
    }

    /// A name for what a function of this file returns, at the bracket of its call; `None` is no function that returns a target.
    pub(super) fn returned_by(&mut self, function: &[u8]) -> Option<u64> {
        let routine = hashed(function);
        if self.functions.get(&routine) != Some(&true) || self.calls.depth > DEEPEST {
            return None;
        }
        let at = self.c.at;
        let name = hashed_as_written(&[&b"\0by"[..], &at.to_le_bytes()].concat());
        self.calls.depth += 1;
        self.call(at, function);
        if self.c.eat(b'(') {
            // of one that gets no targets
            self.each_argument(function, &mut |_, _| {});
        }
        self.calls.depth -= 1;
        self.c.eat(b')');
        let calls = self.calls.all.get(&routine).map_or(0, Vec::len);
        // of one that is not told apart nobody knows what it gives
        let call = if calls > MOST_CALLS { usize::MAX } else { calls.checked_sub(1)? };
        self.calls.results.push((name, routine, call));
        if let Some(exports) = &mut self.exports {
            exports.own.insert(name);
        }
        Some(name)
    }

    /// Behind `RETURN`.
    pub(super) fn returns(&mut self) {
        let routine = hashed(self.within.as_bytes());
        if self.functions.get(&routine) == Some(&true) {
            self.c.skip_space();
            let origin = self.origin(b";{");
            self.calls.returned.entry(routine).or_default().push(origin);
        }
    }

    /// Says of what functions return where it comes from: what is given to them comes from what this call gives.
    pub(super) fn follow_results(&mut self) {
        for (name, routine, call) in std::mem::take(&mut self.calls.results) {
            let given = self.calls.of(routine, call);
            for origin in self.calls.returned.get(&routine).cloned().unwrap_or_default() {
                self.comes_from(name, origin, &given, None, 0);
            }
        }
    }

    /// `to` comes from this; `shifted` says where it is shifted against it on the way.
    fn comes_from(&mut self, to: u64, origin: Origin, given: &[(u64, Given)], shifted: Option<u32>, depth: usize) {
        let Origin::Name { name, at } = origin else { return self.set_from(to, origin) };
        let shifted = shifted.or_else(|| self.names.shifted_at(name, at));
        let itself = Origin::Name { name, at: shifted.unwrap_or(at) };
        if self.names.defines(name) || !self.calls.goes_on(depth) {
            return self.set_from(to, itself);
        }
        let from: Vec<Origin> = match place_of(given, name) {
            // as its caller has it; what other calls give is theirs
            Some(one) => {
                let one = match one {
                    Origin::Name { name, at } => Origin::Name { name, at: shifted.unwrap_or(at) },
                    other => other,
                };
                self.set_from(to, one);
                self.names.set_within(name).collect()
            }
            None => self.names.set_anywhere(name).collect(),
        };
        if from.is_empty() && place_of(given, name).is_none() {
            self.set_from(to, itself);
        }
        from.into_iter().for_each(|origin| self.comes_from(to, origin, given, shifted, depth + 1));
    }

    /// Says of motions with a tool or a work object that is an argument with which it is in each of the calls.
    pub(super) fn follow_frames(&mut self) {
        if self.calls.arguments.is_empty() {
            return;
        }
        let mut calls = std::mem::take(&mut self.calls.all);
        calls.retain(|_, all| all.len() <= MOST_CALLS);
        let own = self.heads.keys().copied().collect();
        if let Some((called, _)) = self.elsewhere.around(&own) {
            // with what others call it is not followed
            calls.retain(|routine, _| !called.contains(routine));
        }
        for (name, setup) in self.names.motions() {
            let mut all = Vec::new();
            self.in_each_call(Meant { name, setup, is_shifted: false }, &calls, 0, &mut all);
            self.names.meant(name, setup, all);
        }
        for spot in 0..self.scan.spots.len() {
            let Some(setup) = self.scan.spots.get(spot).and_then(|s| s.setup()) else { continue };
            let mut all = Vec::new();
            self.in_each_call(Meant { name: 0, setup, is_shifted: false }, &calls, 0, &mut all);
            self.scan.reassign(spot as u32, setup, all.iter().map(|meant| meant.setup));
        }
    }

    /// A name for what the routine sets from what this call gives (`target:=to;`); the same where it does not.
    fn own_name(&mut self, name: u64, call: (Option<u64>, usize), given: &[(u64, Given)]) -> u64 {
        let from: Vec<Origin> = self.names.set_anywhere(name).collect();
        let is_given = |o: &Origin| matches!(o, Origin::Name { name, .. } if place_of(given, *name).is_some());
        if self.names.defines(name) || !from.iter().any(is_given) {
            return name;
        }
        let own = hashed_as_written(format!("\0{name} in {call:?}").as_bytes());
        if self.names.set_anywhere(own).next().is_none() {
            from.into_iter().for_each(|origin| self.comes_from(own, origin, given, None, 0));
        }
        own
    }

    /// What a motion means in each call of the routine whose tool or work object it uses.
    fn in_each_call(&mut self, motion: Meant, calls: &Each, depth: usize, out: &mut Vec<Meant>) {
        let with = self.scan.setups.get(motion.setup as usize).cloned().unwrap_or_default();
        let slots = [&with.tool, &with.frame];
        let routine = slots.into_iter().flatten().find_map(|name| Some(self.calls.arguments.get(name)?.1));
        let of_it = routine.and_then(|routine| calls.get(&routine)).filter(|_| self.calls.goes_on(depth));
        let Some(of_it) = of_it else {
            if !out.contains(&motion) {
                out.push(motion);
            }
            return;
        };
        for (call, given) in of_it.iter().enumerate() {
            let in_call = |name: &Option<String>, unless_given: Option<&str>| {
                let argument = name.as_ref().and_then(|name| self.calls.arguments.get(name));
                let Some((key, _)) = argument.filter(|(_, of)| Some(*of) == routine) else { return name.clone() };
                match given.iter().find(|(k, _)| k == key) {
                    Some((_, Given::Frame(frame))) => Some(frame.clone()),
                    Some(_) => name.clone(),
                    None => unless_given.map(str::to_owned).or_else(|| name.clone()),
                }
            };
            // `\WObj?o` of a call that gives none
            let setup = Setup { tool: in_call(&with.tool, None), frame: in_call(&with.frame, Some("wobj0")) };
            let mut meant = Meant { setup: self.scan.setup(setup.clone()), ..motion };
            let is_set = self.names.set_within(motion.name).next().is_some();
            match place_of(given, motion.name) {
                Some(Origin::Name { name, at }) if !is_set => {
                    meant.name = name;
                    meant.is_shifted |= self.names.shifted_at(motion.name, at).is_some();
                }
                None if is_set => meant.name = self.own_name(motion.name, (routine, call), given),
                _ => {}
            }
            // what it does not give stays unknown, whatever other calls give
            let of = |name: &String| self.calls.arguments.get(name).map(|(_, of)| *of);
            let is_unclear = [&setup.tool, &setup.frame].into_iter().flatten().any(|name| of(name) == routine);
            self.in_each_call(meant, calls, if is_unclear { DEEPEST } else { depth } + 1, out);
        }
    }
}
