//! The arm from the side, at one of the measured poses, with the places where something was found.

use std::fmt::Write;

use nalgebra::Vector3;
use trical_diagnose::Diagnosis;
use trical_model::{Forward, Place, Pose};

use crate::error::Result;
use crate::figures::picture::escaped;
use crate::figures::plots::span;

/// Colours of lines, and of places where something was found that explains little or much.
const INK: &str = "#47566a";
const PALE: [f64; 3] = [250.0, 238.0, 233.0];
const RED: [f64; 3] = [200.0, 92.0, 70.0];

/// The redder, the more of the error is explained there, of the most that any place explains.
fn shade(share: f64, most: f64) -> (String, &'static str) {
    let part = (share / most.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0).sqrt();
    let mix = |k: usize| PALE[k] + (RED[k] - PALE[k]) * part;
    (format!("rgb({:.0},{:.0},{:.0})", mix(0), mix(1), mix(2)), if part > 0.6 { "#fff" } else { INK })
}

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

/// Where two joints fall together, the first moves back along its link.
fn move_apart(flat: &mut [(f64, f64)]) {
    let size = flat.iter().map(|p| p.0.abs().max(p.1.abs())).fold(1e-3, f64::max);
    for k in 1..flat.len().saturating_sub(2) {
        let (here, next, before) = (flat[k], flat[k + 1], flat[k - 1]);
        if (here.0 - next.0).hypot(here.1 - next.1) < 0.09 * size {
            flat[k] = (0.5 * (here.0 + before.0), 0.5 * (here.1 + before.1));
        }
    }
}

/// The dot at which a finding is marked, of `last + 1`.
fn dot_of(site: &Place, last: usize) -> Option<usize> {
    match *site {
        Place::Joint(j) | Place::Coupling { joint: j, .. } if j < last => Some(j),
        Place::Base => Some(0),
        Place::Tool | Place::Target(_) | Place::Axis(_) => Some(last),
        _ => None,
    }
}

/// The arm from the side, with the guilty places marked, and beside it (on a telephone below) the main findings by their numbers and headings.
pub fn draw(d: &Diagnosis, headings: &[(usize, String)]) -> Result<String> {
    const WIDE: f64 = 270.0;
    const HIGHEST: f64 = 300.0;
    let mut flat = from_the_side(&places(d)?);
    move_apart(&mut flat);
    let ((left, right), (down, up)) = (span(flat.iter().map(|p| p.0)), span(flat.iter().map(|p| p.1)));
    let scale = ((WIDE - 100.0) / (right - left).max(1e-3)).min((HIGHEST - 90.0) / (up - down).max(1e-3));
    let high = ((up - down) * scale + 90.0).ceil();
    let at = |p: &(f64, f64)| (60.0 + (p.0 - left) * scale, high - 50.0 - (p.1 - down) * scale);
    let dots: Vec<(f64, f64)> = flat.iter().map(at).collect();
    let last = dots.len().saturating_sub(1);
    // what those findings explain together that are at some place; none where there is no finding
    let explained =
        |at: &dyn Fn(&Place) -> bool| d.findings.iter().filter(|f| at(&f.site)).map(|f| f.share).reduce(|a, b| a + b);
    let whole_arm = explained(&|site| matches!(site, Place::Links | Place::Joints));
    let each: Vec<Option<f64>> = (0..dots.len()).map(|k| explained(&|site| dot_of(site, last) == Some(k))).collect();
    let most = each.iter().chain([&whole_arm]).flatten().copied().fold(0.0, f64::max);
    let shaded = |share: Option<f64>| share.map(|share| shade(share, most));
    let mut svg = format!(
        "<div class=\"arm\"><svg class=\"chart\" viewBox=\"0 0 {WIDE} {high}\" width=\"100%\" style=\"max-width:{WIDE}px\" xmlns=\"http://www.w3.org/2000/svg\" \
         font-family=\"sans-serif\" font-size=\"13\"><rect width=\"{WIDE}\" height=\"{high}\" fill=\"#fff\"/>"
    );
    let list: Vec<String> = dots.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = write!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"9\" stroke-linejoin=\"round\" \
         stroke-linecap=\"round\"/>",
        list.join(" "),
        shaded(whole_arm).map_or_else(|| "#c9d3df".to_owned(), |(fill, _)| fill)
    );
    let mut names = String::new();
    for (k, (x, y)) in dots.iter().enumerate() {
        // the ends have their names beneath, joints their numbers inside
        let joint = k.to_string();
        let (name, below) = if k == 0 {
            ("base", 24.0)
        } else if k == last {
            // away from the joint before it
            ("tool", if dots[k - 1].1 > *y { -15.0 } else { 24.0 })
        } else {
            (&*joint, 4.5)
        };
        let (r, fill, ink) = match (k == 0 || k == last, shaded(each[k])) {
            (true, Some((fill, _))) => (11.0, fill, INK),
            (true, None) => (6.0, INK.to_owned(), INK),
            (false, Some((fill, ink))) => (13.0, fill, ink),
            (false, None) => (10.0, "#fff".to_owned(), INK),
        };
        let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\" fill=\"{fill}\" stroke=\"{INK}\"/>");
        let _ = write!(
            names,
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{ink}\">{name}</text>",
            y + below
        );
    }
    // over all circles
    svg += &names;
    svg += "</svg><ol>";
    for (number, heading) in headings {
        let _ = write!(svg, "<li value=\"{number}\">{}</li>", escaped(heading));
    }
    svg += "</ol>";
    let more = d.findings.len().saturating_sub(headings.len());
    if more > 0 {
        let _ = write!(svg, "<p class=\"fewer\">{more} more are told below.</p>");
    }
    Ok(svg + "</div>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_explains_more_is_redder_and_numbers_stay_legible() {
        let red = |share| shade(share, 0.8).0;
        assert_eq!([red(0.0), red(0.2), red(0.8)], ["rgb(250,238,233)", "rgb(225,165,152)", "rgb(200,92,70)"]);
        assert_eq!([0.0, 0.8].map(|share| shade(share, 0.8).1), [INK, "#fff"]);
        assert_eq!(shade(0.0, 0.0).0, red(0.0));
    }

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
