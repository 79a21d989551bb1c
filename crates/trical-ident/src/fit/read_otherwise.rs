//! Indicators whose readings are not what their columns say: another sign, another axis, another unit.

use trical_model::{Axis, Basis, Measured, Motion, Shape, Site, Term, Variable};

use crate::fit::identify::{ErrorSummary, Identified, fit_some};
use crate::fit::levenberg_marquardt::LmParams;
use crate::fit::priors::PriorKnowledge;

/// Less than this is left where readings are what their columns say, mm rms: it is not asked.
const MUCH_MM: f64 = 0.1;

/// Readings smaller than this tell nothing, m.
const LARGE_READING: f64 = 1e-5;

/// As otherwise read they must leave at most this share of the error.
const LEFT_SHARE: f64 = 1.0 / 3.0;

/// Factors that differ by less are the same, and a factor below this, beside the largest, is nothing.
const ALIKE: f64 = 0.2;

/// What to look at where the device moved otherwise than the columns of the readings say, and all fits if they are read so: found by fitting what
/// each indicator adds along each axis. `None` where they are right, or where it would not help.
#[must_use]
pub fn read_otherwise(fitted: &Identified) -> Option<String> {
    let is_large = |m: &Measured| match m {
        Measured::Touch { reading, .. } => reading.iter().any(|r| r.abs() > LARGE_READING),
        _ => false,
    };
    if !fitted.data.observations.iter().any(|o| is_large(&o.measured)) {
        return None;
    }
    let before = ErrorSummary::of(&fitted.errors().ok()?).rms_mm;
    if before < MUCH_MM {
        return None;
    }
    let mut model = fitted.model.clone();
    // a share of each reading that was taken for noise is one of these numbers
    let is_reading = |t: &Term| matches!(t.basis.of, Variable::Reading { .. });
    model.terms.iter_mut().filter(|t| is_reading(t)).for_each(|t| t.value = 0.0);
    let known = fitted.known.iter().copied().chain(std::iter::repeat(PriorKnowledge::NOTHING));
    let (mut free, known): (Vec<usize>, Vec<PriorKnowledge>) =
        fitted.free.iter().copied().zip(known).filter(|(k, _)| !is_reading(&model.terms[*k])).unzip();
    let first = model.terms.len();
    for (along, of) in Axis::ALL.iter().flat_map(|along| Axis::ALL.iter().map(move |of| (along, of))) {
        let basis = Basis::new(Variable::Reading { axis: *of }, Shape::Linear);
        let name = format!("reads_{}_{}", along.name(), of.name());
        model.terms.push(Term::new(name, "reading", Site::Tool(Motion::Along(*along)), basis));
        free.push(model.terms.len() - 1);
    }
    let otherwise =
        fit_some(model, free, &fitted.data, &fitted.noise, &known, Vec::new(), &LmParams::default()).ok()?;
    let after = ErrorSummary::of(&otherwise.errors().ok()?).rms_mm;
    let added = |along: usize, of: usize| otherwise.model.terms[first + 3 * along + of].value;
    let factor = |along: usize, of: usize| added(along, of) + f64::from(u8::from(along == of));
    let of_axis = |along: usize| {
        let all = [0, 1, 2].map(|of| (of, factor(along, of)));
        all.into_iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((along, 1.0))
    };
    // at poses where the arm as it was planned touches its balls readings that count for nothing always fit: what is left counts in readings
    let least = (0..3).map(|along| of_axis(along).1.abs()).fold(1.0, f64::min);
    if after > LEFT_SHARE * before * least {
        return None;
    }
    let told: Vec<String> = (0..3)
        .map(|along| (along, of_axis(along)))
        .filter(|(along, (of, factor))| along != of || (factor - 1.0).abs() > ALIKE)
        .map(|(along, (of, factor))| {
            let sign = if factor < 0.0 { "-" } else { "" };
            let size = factor.abs();
            let times = if (size - 1.0).abs() < ALIKE {
                String::new()
            } else {
                format!("{size:.*} ", (1.0 - libm::log10(size).floor()).clamp(2.0, 6.0) as usize)
            };
            format!("along {} as {sign}{times}i{}_mm says", Axis::ALL[along].name(), Axis::ALL[of].name())
        })
        .collect();
    (!told.is_empty()).then(|| {
        format!(
            "the device moved {}, if the readings are to fit ({before:.3} -> {after:.3} mm rms): are their columns, signs and units right?",
            told.join(", ")
        )
    })
}
