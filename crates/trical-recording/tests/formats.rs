//! The table of columns in docs/formats.md is that of the program.

use trical_recording::columns::markdown;

const BEGIN: &str = "<!-- columns: written by the test of trical-recording -->\n";
const END: &str = "<!-- end of columns -->\n";

/// To write the table anew: `UPDATE_DOCS=1 cargo test -p trical-recording formats::`.
#[test]
fn the_documentation_has_the_columns_of_the_program() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats.md");
    let text = std::fs::read_to_string(path).unwrap();
    let begin = text.find(BEGIN).expect("docs/formats.md marks where its table of columns begins") + BEGIN.len();
    let end = text.find(END).expect("docs/formats.md marks where its table of columns ends");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(path, format!("{}{}{}", &text[..begin], markdown(), &text[end..])).unwrap();
        return;
    }
    assert_eq!(&text[begin..end], markdown(), "docs/formats.md is stale: see this test");
}
