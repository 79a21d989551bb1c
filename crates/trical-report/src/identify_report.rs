//! The report of an identification, for the person who signs it off.

use trical_diagnose::verdict::capital;
use trical_ident::{Calibration, ErrorSummary};

use crate::error::Result;
use crate::evidence::{self, Errors, half_width, joints_used, row, signing};
use crate::page::{self, Made, Section, error_table};
use crate::table::{self, counted};

/// Two parameters are told to move together from here.
const CORRELATED: f64 = 0.9;

/// An error at poses not used that is larger by this is worth a word.
const LARGER: f64 = 1.5;

/// How poses are left out where the folds are those that were asked for.
pub const BY_BLOCK: &str = "by block of poses";
/// How the last poses are told.
pub const FORWARD: &str = "forward in time";

/// How rows of poses that the fit did not see begin.
const UNSEEN: &str = "poses that the fit did not see, ";

/// Poses that a fit in so many folds did not use.
pub fn of_folds(folds: usize) -> String {
    format!("{UNSEEN}{BY_BLOCK}, {folds} folds")
}

/// The last poses, where those before were fitted.
pub fn of_last(percent: usize) -> String {
    format!("last {percent} % of the poses, by a fit to those before")
}

/// Errors at poses that the fit did not see, each with what they are.
fn unseen(t: &Calibration) -> Vec<(String, ErrorSummary)> {
    let folds = t.cross_validation.iter().map(|(k, e)| (of_folds(*k), *e));
    let later = t.forward_in_time.iter().map(|(percent, e)| (of_last(*percent), *e));
    // each once: folds or the last poses that were asked for stand in the place of the usual ones
    let asked =
        |how: &str| t.cross_validation.is_some() && how == BY_BLOCK || t.forward_in_time.is_some() && how == FORWARD;
    let always = t.held_out.named().into_iter().filter(|(how, _)| !asked(how));
    let always = always.map(|(how, e)| (format!("{UNSEEN}{how}"), e));
    folds.chain(later).chain(always).collect()
}

/// A sentence with a beginning; a parameter keeps its name.
fn begun(text: &str) -> String {
    if text.split(' ').next().is_some_and(|word| word.contains('_')) { text.to_owned() } else { capital(text) }
}

/// What speaks against signing, in one sentence each.
fn concerns(t: &Calibration) -> Result<Vec<String>> {
    let f = &t.fitted;
    let mut out = Vec::new();
    if t.errors.mean_mm >= t.before.mean_mm {
        out.push("The model is no better than the nominal arm: do not use it.".into());
    }
    out.extend(t.cautions().into_iter().map(|c| begun(&table::ended(&c))));
    let unseen = unseen(t);
    for (name, e) in &unseen {
        if e.mean_mm > LARGER * t.errors.mean_mm {
            out.push(format!(
                "The error at poses that the fit did not see ({name}) is {:.1} times that of the fit: the model has too many parameters for these measurements.",
                e.mean_mm / t.errors.mean_mm
            ));
        }
    }
    if unseen.is_empty() {
        out.push(
            "Nothing was scored at poses that the fit did not see: --cross-validate 5 does, and `trical validate` on another \
             recording does better."
                .into(),
        );
    }
    out.extend(evidence::beyond_noise(&f.model, &f.data)?);
    out.extend(evidence::long_tail(&t.errors, &f.data));
    if t.rejected > 0 {
        out.push(format!(
            "Rejected: {} of {}; each is named below with its reason.",
            t.rejected,
            counted(t.rejected + t.observations, "row")
        ));
    }
    if !t.cleaned {
        out.push("Gross errors were kept (--keep-outliers).".into());
    }
    let stopped = f.stopped();
    if !stopped.is_empty() {
        out.push(format!("Held at a limit of --known, beyond which the data would go: {}.", stopped.join(", ")));
    }
    Ok(out)
}

fn verdict(t: &Calibration, concerns: usize) -> String {
    let mut out = format!(
        "{} parameters lower the mean position error at {} measurements from {:.3} mm (largest {:.3}) to {:.3} mm (largest {:.3}).",
        t.fitted.free.len(),
        t.observations,
        t.before.mean_mm,
        t.before.max_mm,
        t.errors.mean_mm,
        t.errors.max_mm
    );
    if let Some((how, e)) = unseen(t).iter().max_by(|a, b| a.1.mean_mm.total_cmp(&b.1.mean_mm)) {
        let how = how.trim_start_matches(UNSEEN);
        out +=
            &format!(" At poses that the fit did not see ({how}) it is {:.3} mm (largest {:.3}).", e.mean_mm, e.max_mm);
    }
    out + &signing(concerns)
}

fn parameters(t: &Calibration) -> Section {
    let f = &t.fitted;
    let spare = f.observability.rows.saturating_sub(f.free.len());
    let sds = half_width((spare > 0).then_some(spare));
    let pairs = f.correlated(CORRELATED);
    let stopped = f.stopped();
    let remark = |name: &str| if stopped.contains(&name) { "at its limit".to_owned() } else { String::new() };
    let mut tables = vec![evidence::parameters(&f.model, f.free.iter().map(|k| &f.model.terms[*k]), sds, remark)];
    let mut text = vec![format!(
        "The 95 % interval of each ({sds:.2} standard deviations to each side) holds if the model is complete. The \
         condition number of the scaled Jacobian is {:.0}.",
        f.observability.condition
    )];
    text.extend(evidence::legend(f.free.iter().map(|k| &f.model.terms[*k])));
    let dropped = f.left_out();
    if !dropped.is_empty() {
        text.push(format!("Not identified, because other parameters have the same effect: {}.", dropped.join("; ")));
    }
    if !pairs.is_empty() {
        text.push(
            "The data hardly separates the pairs in the second table: each alone is uncertain, but their joint effect is known \
             where it was measured."
                .into(),
        );
        let mut rows = vec![row(["parameter", "and", "correlation"])];
        rows.extend(pairs.iter().map(|(a, b, r)| vec![a.clone(), b.clone(), format!("{r:.3}")]));
        tables.push(rows);
    }
    Section::new("Parameters").with_text(text).with_tables(tables)
}

/// The whole report.
pub fn render(t: &Calibration, mut made: Made) -> Result<String> {
    let f = &t.fitted;
    let after = f.errors()?;
    let errors =
        Errors { model: &f.model, data: &f.data, was: "the nominal arm", before: &t.each_before, after: &after };
    let list = concerns(t)?;
    let verdict = verdict(t, list.len());
    let unseen = unseen(t);
    let mut rows = vec![("before: nominal arm", &t.before), ("after: identified", &t.errors)];
    rows.extend(unseen.iter().map(|(name, e)| (name.as_str(), e)));
    let mut sections = Vec::new();
    sections
        .push(evidence::to_be_looked_at(list, "errors at poses that the fit did not see, numbers measured for each parameter, where the base came out, limits"));
    let mut one_by_one = errors.section()?;
    if after.len() < t.observations {
        one_by_one.text.push(format!("These are from a sample of {} of {} measurements.", after.len(), t.observations));
    }
    sections.extend([
        Section::new("Position error before and after")
            .with_text(["Before is the arm as its maker describes it, with only the measuring frame or base and \
                 the tool points identified."])
            .with_tables([error_table(&rows)]),
        one_by_one,
    ]);
    sections.extend(errors.pictures()?);
    sections.extend([parameters(t), evidence::rejected(&t.named, t.rejected)]);
    made.notes.push(joints_used(f.data.joints));
    let title = page::title("Identification", &f.model.robot.name, &f.data.names);
    page::render(&title, &verdict, &sections, &made)
}
