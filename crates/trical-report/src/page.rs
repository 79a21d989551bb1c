//! Reports: one self-contained HTML file each.

use std::path::Path;

use minijinja::value::Serde;
use minijinja::{Environment, HtmlEscape, Value, context};
use serde::Serialize;
use sha2::{Digest, Sha256};
use trical_ident::ErrorSummary;
use trical_ident::fit::cautions::listed;

use crate::error::{Error, Result};
use crate::figures::{plots, turning_scene};

/// A figure.
#[derive(Serialize)]
pub struct Figure {
    /// What one sees.
    pub caption: String,
    /// The picture.
    pub svg: String,
}

impl Figure {
    /// A picture with its caption.
    pub fn new(caption: impl Into<String>, svg: String) -> Self {
        let caption = caption.into();
        // for those who have the page read to them
        let named = format!("<svg role=\"img\" aria-label=\"{}\" ", HtmlEscape(&caption));
        Self { svg: svg.replace("<svg ", &named), caption }
    }
}

/// A section.
#[derive(Default, Serialize)]
pub struct Section {
    /// Heading.
    pub heading: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Points of a list.
    pub list: Vec<String>,
    /// Tables; the first row is the header.
    pub tables: Vec<Vec<Vec<String>>>,
    /// Paragraphs behind the tables.
    pub after: Vec<String>,
    /// Figures.
    pub figures: Vec<Figure>,
    /// Whether it is closed until somebody opens it; on paper it is open.
    pub folded: bool,
}

impl Section {
    /// A section with nothing below its heading yet.
    pub fn new(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), ..Self::default() }
    }

    /// With these paragraphs.
    pub fn with_text(mut self, text: impl IntoIterator<Item: Into<String>>) -> Self {
        self.text.extend(text.into_iter().map(Into::into));
        self
    }

    /// With these tables.
    pub fn with_tables(mut self, tables: impl IntoIterator<Item = Vec<Vec<String>>>) -> Self {
        self.tables.extend(tables);
        self
    }

    /// With these figures.
    pub fn with_figures(mut self, figures: impl IntoIterator<Item = Figure>) -> Self {
        self.figures.extend(figures);
        self
    }

    /// Where so, closed until somebody opens it.
    pub fn folded(self, folded: bool) -> Self {
        Self { folded, ..self }
    }
}

/// A file that a report was made from.
#[derive(Serialize)]
pub struct Input {
    /// As it was named on the command line.
    name: String,
    /// Its size.
    bytes: String,
    /// Hash of its bytes; why there is none, where it cannot be read twice.
    sha256: String,
}

/// What ends every report: version, command, inputs. No clock: the same inputs give the same bytes.
#[derive(Serialize)]
pub struct Made {
    version: &'static str,
    command: String,
    /// Further sentences.
    pub notes: Vec<String>,
    inputs: Vec<Input>,
}

impl Made {
    /// By this command, from these files, with their hashes.
    pub fn by(command: String, inputs: &[&Path]) -> Self {
        let inputs = inputs.iter().map(|p| input(p)).collect();
        Self { version: env!("CARGO_PKG_VERSION"), command, notes: Vec::new(), inputs }
    }

    /// The command.
    #[must_use]
    pub fn command(&self) -> &str {
        &self.command
    }

    /// Names of the inputs, and the SHA-256 of their bytes.
    pub fn hashes(&self) -> impl Iterator<Item = (&str, &str)> {
        self.inputs.iter().map(|i| (i.name.as_str(), i.sha256.as_str()))
    }
}

fn input(path: &Path) -> Input {
    // a URDF may carry its two links behind a #
    let named = path.to_string_lossy();
    let file = named.split_once('#').filter(|_| !path.exists()).map_or(path, |(file, _)| Path::new(file));
    let hashed = || -> std::io::Result<(u64, String)> {
        if !file.metadata()?.is_file() {
            return Err(std::io::Error::other("not a file"));
        }
        let mut hash = Sha256::new();
        let bytes = std::io::copy(&mut std::fs::File::open(file)?, &mut hash)?;
        Ok((bytes, hash.finalize().iter().map(|b| format!("{b:02x}")).collect()))
    };
    let (bytes, sha256) =
        hashed().map_or_else(|e| ("-".to_owned(), format!("not read again: {e}")), |(n, h)| (n.to_string(), h));
    Input { name: named.into_owned(), bytes, sha256 }
}

/// What a report is of: "Diagnosis of ABB IRB 120: tracker.csv".
pub fn title(what: &str, robot: &str, recordings: &[String]) -> String {
    let file = |r: &String| Path::new(r).file_name().map_or_else(|| r.clone(), |f| f.to_string_lossy().into_owned());
    let mut named: Vec<String> = recordings.iter().take(NAMED).map(file).collect();
    named.extend((recordings.len() > NAMED).then(|| format!("{} more", recordings.len() - NAMED)));
    let of = if robot.is_empty() { String::new() } else { format!(" of {robot}") };
    if named.is_empty() { format!("{what}{of}") } else { format!("{what}{of}: {}", listed(&named, "and")) }
}

/// So many recordings are named in a title.
const NAMED: usize = 2;

/// Puts a report together.
pub fn render(title: &str, verdict: &str, sections: &[Section], made: &Made) -> Result<String> {
    // the library is carried by those who have something to draw with it
    let live = sections.iter().flat_map(|s| &s.figures).any(|f| f.svg.contains(plots::LIVE));
    let turning = sections.iter().flat_map(|s| &s.figures).any(|f| f.svg.contains(turning_scene::OPEN));
    let (sections, made) = (Serde(sections), Serde(made));
    let uplot_css = if live { include_str!("../assets/uPlot.min.css") } else { "" };
    let (uplot_js, report_js) = (include_str!("../assets/uPlot.iife.min.js"), include_str!("../assets/report.js"));
    let turn_js = include_str!("../assets/turn.js");
    let uplot_license = include_str!("../assets/uPlot.LICENSE");
    let values = context! { title, verdict, sections, made, live, turning, turn_js, uplot_css, uplot_license, uplot_js, report_js };
    from_template("report", include_str!("../assets/report.html"), values)
}

/// A page (a "report") from its template, in which the filter `told` is for what a person reads.
pub fn from_template(what: &str, template: &str, values: Value) -> Result<String> {
    let mut env = Environment::new();
    env.add_filter("told", |text: String| Value::from_safe_string(as_html(&text)));
    env.add_filter("command", |text: String| Value::from_safe_string(command(&text)));
    // the name ends in .html, so that text is escaped
    env.render_named_str(&format!("{what}.html"), template, values)
        .map_err(|e| Error::Failed(format!("the {what} could not be written: {e}")))
}

/// What stays in one line with the number before it.
const UNITS: [&str; 9] = ["%", "mm", "deg", "mdeg", "degC", "Nm", "kg", "deg/Nm", "s"];

/// What stays in one line with the number behind it.
const COUNTED: [&str; 9] = ["joint", "joints", "ball", "line", "row", "axis", "axes", "session", "target"];

/// Text as HTML: escaped, `commands` set as code, no line ends between a number and its unit or what it counts, long names of files break
/// behind a slash.
fn as_html(text: &str) -> String {
    let mut html = String::with_capacity(text.len() + 16);
    // an odd one is no pair
    let (quotes, mut open) = (text.matches('`').count() / 2 * 2, 0);
    let (mut rest, mut before) = (text, "");
    while let Some(c) = rest.chars().next() {
        let (here, after) = rest.split_at(c.len_utf8());
        match c {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\'' => html += "&#x27;",
            '`' if open < quotes => {
                html += if open % 2 == 0 { "<code>" } else { "</code>" };
                open += 1;
            }
            '/' | '#'
                if before.ends_with(char::is_alphanumeric)
                    && after.starts_with(|c: char| c.is_alphanumeric() || c == '.')
                    && is_file_name(text) =>
            {
                html += here;
                html += "<wbr>";
            }
            '+' if before.ends_with(' ') && after.starts_with("- ") => {
                html.push('\u{b1}');
                rest = &after[1..];
                before = &text[..text.len() - rest.len()];
                continue;
            }
            '-' if !before.ends_with(|c: char| c.is_alphanumeric() || c == '-') && option(rest).is_some() => {
                let name = option(rest).unwrap_or_default();
                html += &format!("<span class=\"option\">{name}</span>");
                rest = &rest[name.len()..];
                before = &text[..text.len() - rest.len()];
                continue;
            }
            ' ' if tied(before, after) => html.push('\u{a0}'),
            _ => html += here,
        }
        before = &text[..text.len() - after.len()];
        rest = after;
    }
    html
}

/// The option of a command, which no line ends in, that a text begins with.
fn option(text: &str) -> Option<&str> {
    let name = text.strip_prefix("--")?;
    let end = name.find(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).unwrap_or(name.len());
    name.starts_with(|c: char| c.is_ascii_lowercase()).then(|| &text[..end + 2])
}

/// A command as HTML, escaped: to be copied, so that nothing is replaced.
fn command(text: &str) -> String {
    let word = |word: &str| match option(word) {
        Some(name) => format!("<span class=\"option\">{name}</span>{}", HtmlEscape(&word[name.len()..])),
        None => HtmlEscape(word).to_string(),
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Whether a text is the name of a file in a folder, alone or among words.
fn is_file_name(text: &str) -> bool {
    text.split(' ').any(|word| word.matches('/').count() > 1)
}

/// Whether a blank between these belongs to one number.
fn tied(before: &str, after: &str) -> bool {
    let word = |c: char| c.is_alphanumeric() || "%/_".contains(c);
    let next = after.split(|c| !word(c)).next().unwrap_or_default();
    let last = before.rsplit(|c| !word(c)).next().unwrap_or_default();
    before.ends_with(|c: char| c.is_ascii_digit()) && UNITS.contains(&next)
        || COUNTED.contains(&last) && next.starts_with(|c: char| c.is_ascii_digit())
}

/// Rows of a before and after table.
pub fn error_table(rows: &[(&str, &ErrorSummary)]) -> Vec<Vec<String>> {
    let mut out = vec![["position error, mm", "mean", "max", "sd", "median", "rms"].map(String::from).to_vec()];
    for (name, e) in rows {
        let mut row = vec![(*name).to_owned()];
        row.extend([e.mean_mm, e.max_mm, e.sd_mm, e.median_mm, e.rms_mm].map(|v| format!("{v:.3}")));
        out.push(row);
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;

    #[test]
    fn a_report_names_its_inputs_by_the_hash_of_their_bytes() {
        let folder = std::env::temp_dir().join(format!("trical-page-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("arm.urdf");
        std::fs::write(&file, "abc").unwrap();
        let (linked, missing) = (folder.join("arm.urdf#base:tool"), folder.join("nothing"));
        let made = Made::by("trical".into(), &[&file, &linked, &missing, &folder]);
        std::fs::remove_dir_all(&folder).unwrap();
        // FIPS 180-2, appendix B.1
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let hashes: Vec<&str> = made.hashes().map(|(_, hash)| hash).collect();
        assert_eq!(hashes[..2], [abc, abc]);
        assert!(hashes[2..].iter().all(|h| h.starts_with("not read again: ")), "{hashes:?}");
        assert_eq!((made.inputs[0].bytes.as_str(), made.inputs[3].bytes.as_str()), ("3", "-"));
    }

    #[test]
    fn text_is_escaped_pictures_are_not_and_scripts_are_carried_where_they_are_used() {
        let page = |svg: &str| {
            let figure = Figure::new("a < b", svg.into());
            let section = Section::new("x & y")
                .with_tables([vec![vec!["<i>".into()], vec!["<b>".into()]]])
                .with_figures([figure]);
            render("<title>", "<verdict>", &[section], &Made::by("trical <x>".into(), &[])).unwrap()
        };
        let plain = page("<svg></svg>");
        // paper repeats the head of a table on each of its pages
        assert!(plain.contains("<thead><tr><th>&lt;i&gt;</th></tr></thead><tbody>"), "{plain}");
        assert!(plain.contains("<svg></svg>") && plain.contains("a &lt; b") && plain.contains("x &amp; y"));
        for bare in ["<i>", "<b>", "<verdict>", "<x>"] {
            assert!(!plain.contains(bare), "{bare}");
        }
        let (plot, turned) = (page(&format!("{}</div>", plots::LIVE)), page(&format!("{}</div>", turning_scene::OPEN)));
        assert!(!plain.contains("uPlot") && plot.contains("uPlot") && !turned.contains("uPlot"));
        assert!(turned.len() > plain.len() + 1000);
    }

    #[test]
    fn on_paper_what_is_folded_is_open_and_what_only_a_screen_can_do_is_not_there() {
        let section = Section::new("x").with_text(["y".to_owned()]).folded(true);
        let page = render("t", "v", &[section], &Made::by("trical".into(), &[])).unwrap();
        assert!(page.contains("<details><summary><h2>x</h2></summary>"), "{page}");
        let (_, print) = page.split_once("@media print {").unwrap();
        let (print, _) = print.split_once("\n}").unwrap();
        let said = |selector: &str| {
            let line = print.lines().find(|l| l.trim_start().starts_with(&format!("{selector} {{")));
            line.unwrap_or_else(|| panic!("{selector} in {print}")).to_owned()
        };
        assert!(said("details::details-content").contains("content-visibility: visible"));
        assert!([".live", ".screen", ".turn > canvas"].iter().all(|s| said(s).contains("display: none")));
        assert!(said(".plot.drawn > svg, .turn.turned > svg").contains("display: inline"));
        assert!(
            said("thead").contains("table-header-group") && said("h2, tr, .verdict").contains("break-inside: avoid")
        );
    }

    #[test]
    fn a_picture_has_its_caption_for_those_who_do_not_see_it() {
        let figure = Figure::new("a < b", "<svg class=\"chart\"></svg>".into());
        assert_eq!(figure.svg, "<svg role=\"img\" aria-label=\"a &lt; b\" class=\"chart\"></svg>");
    }

    #[test]
    fn a_title_says_which_arm_and_which_recordings() {
        let files = ["/data/a.csv", "b.csv", "c.csv", "d.csv"].map(str::to_owned);
        assert_eq!(title("Diagnosis", "arm 3", &files[..1]), "Diagnosis of arm 3: a.csv");
        assert_eq!(title("Diagnosis", "arm 3", &files), "Diagnosis of arm 3: a.csv, b.csv and 2 more");
        assert_eq!(title("Plan", "", &[]), "Plan");
    }

    #[test]
    fn a_number_stays_with_its_unit_and_a_command_is_set_as_code() {
        assert_eq!(
            as_html("0.5 mm (96 %) at joint 3, from joints 1 and 2"),
            "0.5\u{a0}mm (96\u{a0}%) at joint\u{a0}3, from joints\u{a0}1 and 2"
        );
        assert_eq!(as_html("<a> & `trical diagnose` looks"), "&lt;a&gt; &amp; <code>trical diagnose</code> looks");
        assert_eq!(as_html("by 0.3 +- 0.1 deg, 1 +1"), "by 0.3 \u{b1} 0.1\u{a0}deg, 1 +1");
        // what only looks like it
        assert_eq!(as_html("one ` alone; 3 made; the joint moves"), "one ` alone; 3 made; the joint moves");
    }

    #[test]
    fn an_option_stays_in_one_line() {
        let held = "<span class=\"option\">--cross-validate</span>";
        assert_eq!(as_html("`trical identify --cross-validate 5`"), format!("<code>trical identify {held} 5</code>"));
        assert_eq!(as_html("--cross-validate: a -- b, x--y"), format!("{held}: a -- b, x--y"));
        assert_eq!(command("trical 'a<b' --cross-validate=5"), format!("trical &#x27;a&lt;b&#x27; {held}=5"));
    }

    #[test]
    fn the_name_of_a_file_breaks_between_its_folders() {
        assert_eq!(as_html("/data/arm/run.csv, line 3"), "/data/<wbr>arm/<wbr>run.csv, line\u{a0}3");
        assert_eq!(as_html("../run.csv in deg/Nm"), "../run.csv in deg/Nm");
    }

    #[test]
    fn the_columns_of_an_error_table_are_what_its_head_says() {
        let e = ErrorSummary { mean_mm: 1.0, max_mm: 2.0, sd_mm: 3.0, median_mm: 4.0, rms_mm: 5.0 };
        let table = error_table(&[("before", &e)]);
        let of = |name: &str| table[1][table[0].iter().position(|c| c == name).unwrap()].as_str();
        assert_eq!(["mean", "max", "sd", "median", "rms"].map(of), ["1.000", "2.000", "3.000", "4.000", "5.000"]);
    }
}
