//! Names of effects that someone may have meant who does not know the catalogue.

use trical_diagnose::effects::EFFECTS;

/// Letters that two words have in common where they mean the same: eccentricity and eccentric, but not joint and jolt.
const SAME: usize = 5;

/// Effects whose name or title has a word of the wish ("backlash@3"), in words for the end of a message; nothing where its name is known, or none
/// is like it.
#[must_use]
pub fn meant(wish: &str) -> String {
    let name = wish.split(['@', '*']).next().unwrap_or_default().to_lowercase();
    if EFFECTS.iter().any(|e| e.id.name() == name) {
        return String::new();
    }
    let words = |text: &str| -> Vec<String> {
        text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_lowercase).collect()
    };
    let alike = |a: &str, b: &str| a == b || a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count() >= SAME;
    let asked = words(&name);
    let common = |title: &str, id: &str| {
        let own = [words(title), words(id)].concat();
        asked.iter().filter(|word| own.iter().any(|w| alike(word, w))).count()
    };
    let counts: Vec<(usize, String)> =
        EFFECTS.iter().map(|e| (common(e.title, e.id.name()), format!("{} ({})", e.id.name(), e.title))).collect();
    let most = counts.iter().map(|(n, _)| *n).max().filter(|n| *n > 0);
    let found: Vec<&str> = counts.iter().filter(|(n, _)| Some(*n) == most).map(|(_, said)| said.as_str()).collect();
    if found.is_empty() { String::new() } else { format!("; perhaps meant: {}", found.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_not_the_catalogues_leads_to_those_that_mean_it() {
        for (wish, expected) in [
            ("backlash@3", "lost_motion_direction (backlash or friction wind-up)"),
            ("Backlash", "lost_motion_gravity (backlash that gravity closes)"),
            ("gear_riple@4/100*2", "gear_ripple (gear ripple)"),
            ("eccentricity", "joint_harmonic (eccentric gear or encoder)"),
            ("temperature drift", "thermal_zero_drift"),
        ] {
            let said = meant(wish);
            assert!(said.starts_with("; perhaps meant: ") && said.contains(expected), "{wish}: {said}");
        }
        assert_eq!(meant("gear_ripple@99"), "");
        assert_eq!(meant("gremlins"), "");
    }
}
