//! The arm from the side, at one of the measured poses, with the places where something was found.

use std::fmt::Write;

use nalgebra::Vector3;
use trical_diagnose::Diagnosis;
use trical_model::{Forward, Place, Pose};

use crate::error::Result;

/// A mark that more than so many pixels lie apart from is not crowded.
const CROWDED: f64 = 24.0;

/// Where the joints are drawn: at their origins, but where two fall together (a wrist) the first moves back along its link.
fn places(d: &Diagnosis) -> Result<Vec<Vector3<f64>>> {
    let forward = Forward::new(d.model.clone(), Vec::new())?;
    let mut ws = forward.workspace();
    let mut best: Option<(f64, Vec<Vector3<f64>>)> = None;
    // the pose that is spread out most when seen from the side
    for o in d.data.observations.iter().step_by(d.data.observations.len().div_ceil(200).max(1)) {
        let base = forward.world_from_links(&o.state, &mut ws).first().map_or_else(Vector3::zeros, |p| p.translation);
        let mut points = vec![base];
        points.extend(forward.world_from_joints(&o.state, &mut ws).iter().map(|p: &Pose| p.translation));
        points.push(forward.world_from_tool(&o.state, &mut ws).translation);
        let flat = from_the_side(&points);
        let mut area = 0.0;
        for w in flat.windows(3) {
            area += ((w[1].0 - w[0].0) * (w[2].1 - w[0].1) - (w[2].0 - w[0].0) * (w[1].1 - w[0].1)).abs();
        }
        if best.as_ref().is_none_or(|b| area > b.0) {
            best = Some((area, points));
        }
    }
    Ok(best.map(|b| b.1).unwrap_or_default())
}

/// Horizontal distance from the base towards the tool, and height.
fn from_the_side(points: &[Vector3<f64>]) -> Vec<(f64, f64)> {
    let (Some(base), Some(tool)) = (points.first(), points.last()) else { return Vec::new() };
    let mut ahead = tool - base;
    ahead.z = 0.0;
    let ahead = ahead.try_normalize(1e-6).unwrap_or_else(Vector3::x);
    points.iter().map(|p| ((p - base).dot(&ahead), p.z - base.z)).collect()
}

/// The arm from the side, with the guilty places marked, and beside it the first findings by their headings.
pub fn draw(d: &Diagnosis, headings: &[String]) -> Result<String> {
    const WIDE: f64 = 600.0;
    const HIGH: f64 = 360.0;
    // of the list beside the arm
    const LIST: f64 = 330.0;
    let mut flat = from_the_side(&places(d)?);
    let last = flat.len().saturating_sub(1);
    let size = flat.iter().map(|p| p.0.abs().max(p.1.abs())).fold(1e-3, f64::max);
    for k in 1..last.saturating_sub(1) {
        let (here, next, before) = (flat[k], flat[k + 1], flat[k - 1]);
        if (here.0 - next.0).hypot(here.1 - next.1) < 0.03 * size {
            flat[k] = (0.5 * (here.0 + before.0), 0.5 * (here.1 + before.1));
        }
    }
    let low = |f: fn(&(f64, f64)) -> f64| flat.iter().map(f).fold(f64::INFINITY, f64::min);
    let high = |f: fn(&(f64, f64)) -> f64| flat.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
    let (left, right, down, up) = (low(|p| p.0), high(|p| p.0), low(|p| p.1), high(|p| p.1));
    let scale = ((WIDE - LIST - 100.0) / (right - left).max(1e-3)).min((HIGH - 90.0) / (up - down).max(1e-3));
    let at = |p: (f64, f64)| (60.0 + (p.0 - left) * scale, HIGH - 50.0 - (p.1 - down) * scale);
    let dots: Vec<(f64, f64)> = flat.iter().map(|p| at(*p)).collect();
    let whole_arm = d.findings.iter().any(|f| matches!(f.site, Place::Links | Place::Joints));
    let mut svg = format!(
        "<svg class=\"chart\" viewBox=\"0 0 {WIDE} {HIGH}\" width=\"100%\" style=\"max-width:{WIDE}px\" xmlns=\"http://www.w3.org/2000/svg\" \
         font-family=\"sans-serif\" font-size=\"13\"><rect width=\"{WIDE}\" height=\"{HIGH}\" fill=\"#fff\"/>"
    );
    let list: Vec<String> = dots.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = write!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"9\" stroke-linejoin=\"round\" \
         stroke-linecap=\"round\"/>",
        list.join(" "),
        if whole_arm { "#e3b5a8" } else { "#c9d3df" }
    );
    let mut marks: Vec<Vec<usize>> = vec![Vec::new(); dots.len() + 1];
    for (k, f) in d.findings.iter().enumerate() {
        let place = match f.site {
            Place::Joint(j) | Place::Coupling { joint: j, .. } if j < last => j,
            Place::Base => 0,
            Place::Tool | Place::Target(_) | Place::Axis(_) => last,
            _ => dots.len(),
        };
        marks[place].push(k + 1);
    }
    for (k, (x, y)) in dots.iter().enumerate() {
        let name = match k {
            0 => "base".to_owned(),
            k if k == last => "tool".to_owned(),
            k => k.to_string(),
        };
        let guilty = !marks[k].is_empty();
        let (fill, ink, r) = if guilty { ("#c85c46", "#fff", 13.0) } else { ("#fff", "#47566a", 10.0) };
        if k == 0 || k == last {
            let _ = write!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{}\" fill=\"{}\" stroke=\"#47566a\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#47566a\">{name}</text>",
                if guilty { 11.0 } else { 6.0 },
                if guilty { "#c85c46" } else { "#47566a" },
                y + CROWDED
            );
        } else {
            let _ = write!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\" fill=\"{fill}\" stroke=\"#47566a\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{ink}\">{name}</text>",
                y + 4.5
            );
        }
    }
    for (k, heading) in headings.iter().enumerate() {
        let short = format!("{}. {heading}", k + 1);
        #[expect(clippy::cast_precision_loss, reason = "a small count")]
        let y = 30.0 + 22.0 * k as f64;
        let _ = write!(svg, "<text x=\"{:.1}\" y=\"{y:.1}\" fill=\"#1d2733\">{short}</text>", WIDE - LIST);
    }
    svg += "</svg>";
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_the_side_an_arm_reaches_to_the_right_whichever_way_it_points() {
        let v = Vector3::new;
        for (x, y) in [(0.6, 0.8), (-0.6, 0.8), (0.0, -1.0)] {
            let base = v(1.0, 2.0, 0.5);
            let flat = from_the_side(&[
                base,
                base + v(-0.2 * x, -0.2 * y, 0.3),
                base + v(0.1 * y, -0.1 * x, 0.1),
                base + v(x, y, 0.4),
            ]);
            for (found, expected) in flat.iter().zip([(0.0, 0.0), (-0.2, 0.3), (0.0, 0.1), (1.0, 0.4)]) {
                assert!((found.0 - expected.0).abs() < 1e-12 && (found.1 - expected.1).abs() < 1e-12, "{flat:?}");
            }
        }
        assert!(from_the_side(&[]).is_empty());
    }
}
