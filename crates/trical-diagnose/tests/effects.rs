//! The catalogue as users read it is the catalogue as the program has it.

use trical_diagnose::effects::EFFECTS;

const DOC: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/effects.md");

/// To write the rows anew: `UPDATE_DOCS=1 cargo test -p trical-diagnose effects::`.
#[test]
fn the_documentation_lists_every_effect_as_its_file_has_it() {
    let text = std::fs::read_to_string(DOC).unwrap();
    let rows: Vec<&str> = text.lines().filter(|l| l.starts_with("| `")).collect();
    let expected: Vec<String> = EFFECTS
        .iter()
        .map(|e| {
            let cells = [e.site, e.form, e.needs, e.typical, e.rivals].map(|c| c.replace('|', "\\|")).join(" | ");
            format!("| `{}` | {cells} |", e.id)
        })
        .collect();
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let (first, last) = (rows.first().unwrap(), rows.last().unwrap());
        let (begin, end) = (text.find(first).unwrap(), text.rfind(last).unwrap() + last.len());
        std::fs::write(DOC, format!("{}{}{}", &text[..begin], expected.join("\n"), &text[end..])).unwrap();
        return;
    }
    assert_eq!(rows, expected, "docs/effects.md is stale: see this test");
}

#[test]
fn the_guide_shows_a_file_as_it_is() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/");
    let read = |path: &str| std::fs::read_to_string(format!("{root}{path}")).unwrap();
    let (page, file) = (read("../../docs/guide/src/effect.md"), read("src/effects/gear_ratio.rs"));
    assert!(page.contains(&file), "docs/guide/src/effect.md should quote all of gear_ratio.rs");
}
