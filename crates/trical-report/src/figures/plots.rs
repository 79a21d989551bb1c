//! Plots as SVG, to be put inline into a report.

use std::fmt::Write as _;

use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;

use crate::error::{Error, Result};

/// The colour of what is measured before calibration: grey-red.
pub const BEFORE: RGBColor = RGBColor(200, 92, 70);
/// The colour of what is measured after calibration: blue.
pub const AFTER: RGBColor = RGBColor(38, 102, 165);

/// The colour of axes and what is written on them, as in the plots that a script draws.
const PALE: RGBColor = RGBColor(71, 86, 106);

/// The size of what is written on axes, and of names: this picture of 480 is drawn 370 wide on a telephone, where letters are to have ten pixels.
const LETTERS: f64 = 13.5;
/// The same for the library that draws, whose sizes are 1.24 times as large as what it writes.
const DRAWN_LETTERS: f64 = 1.24 * LETTERS;

/// Points of one colour.
pub struct Series {
    /// In the legend.
    pub name: &'static str,
    /// Colour.
    pub color: RGBColor,
    /// Points.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// Those of its points whose numbers are given.
    fn only(&self, kept: &[usize]) -> Self {
        Self { points: kept.iter().map(|k| self.points[*k]).collect(), ..*self }
    }
}

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for Error {
    fn from(e: DrawingAreaErrorKind<E>) -> Self {
        Self::Failed(format!("a figure could not be drawn: {e}"))
    }
}

/// A colour as a page writes it.
fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The smallest and the largest.
pub fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

fn range(values: impl Iterator<Item = f64>, from_zero: bool) -> std::ops::Range<f64> {
    let (low, high) = span(values);
    if !low.is_finite() || !high.is_finite() {
        return 0.0..1.0;
    }
    let pad = ((high - low) * 0.04).max(1e-9);
    if from_zero { 0.0..up_to_tick(high + pad) } else { (low - pad)..(high + pad) }
}

/// The next number that an axis from zero has a tick at: nothing is drawn above the highest tick. As the script has it.
fn up_to_tick(high: f64) -> f64 {
    if !(high.is_finite() && high > 0.0) {
        return high;
    }
    let size = 10_f64.powf((high / 5.0).log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].map(|k| k * size).into_iter().find(|step| high / step <= 5.0).unwrap_or(10.0 * size);
    // rounding must not take the tick away
    (high / step).ceil() * step * (1.0 + 1e-9)
}

fn draw(size: (u32, u32), with: impl FnOnce(&Area<'_>) -> Result<()>) -> Result<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        with(&root)?;
        root.present()?;
    }
    let svg = svg.replace(" opacity=\"1\"", "").replace('\n', "");
    // scale with the page
    let (w, h) = size;
    let scaled = format!("class=\"chart\" width=\"100%\" style=\"max-width:{}px\"", w * 3 / 2);
    Ok(svg.replacen(&format!("width=\"{w}\" height=\"{h}\""), &scaled, 1))
}

/// A number on an axis: no more digits than it has, and zero without a sign.
fn tick(v: &f64) -> String {
    let digits = format!("{v:.9}");
    let digits = digits.trim_end_matches('0').trim_end_matches('.');
    if digits == "-0" { "0".into() } else { digits.into() }
}

type Chart<'a, 's> = ChartContext<'a, SVGBackend<'s>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Area<'s> = DrawingArea<SVGBackend<'s>, Shift>;
type Mesh<'a, 'c, 's> = MeshStyle<'a, 'c, RangedCoordf64, RangedCoordf64, SVGBackend<'s>>;

/// A chart with room for its axes.
fn framed<'a, 's>(area: &'a Area<'s>) -> ChartBuilder<'a, 'a, SVGBackend<'s>> {
    let mut chart = ChartBuilder::on(area);
    chart.margin(10).margin_right(16).x_label_area_size(50).y_label_area_size(72);
    chart
}

/// So many ticks has x at most.
const MOST_TICKS: usize = 8;

/// Where the points are at whole numbers, such as those of sessions.
fn whole(series: &[Series]) -> bool {
    series.iter().flat_map(|s| &s.points).all(|p| p.0.fract() == 0.0)
}

/// How many ticks x has, where the points are: between whole numbers there are none.
fn ticks(series: &[Series]) -> usize {
    let x = range(series.iter().flat_map(|s| &s.points).map(|p| p.0), false);
    if whole(series) { ((x.end - x.start) as usize + 1).clamp(2, MOST_TICKS) } else { MOST_TICKS }
}

/// A curve of at most so many points shows them, too.
const FEW_POINTS: usize = 30;

fn few(series: &[Series]) -> bool {
    series.iter().all(|s| s.points.len() <= FEW_POINTS)
}

/// Draws the axes with their labels and the lines behind a chart; `also` has what is special about them.
fn axes<'a, 'c, 's>(
    chart: &'c mut Chart<'a, 's>,
    x_label: &str,
    y_label: &str,
    also: impl FnOnce(&mut Mesh<'a, 'c, 's>),
) -> Result<()> {
    let mut mesh = chart.configure_mesh();
    // lines between the labelled ones would be half of a report's bytes
    mesh.max_light_lines(0)
        .bold_line_style(RGBColor(225, 225, 225))
        .x_desc(x_label)
        .y_desc(y_label)
        .x_labels(MOST_TICKS)
        .y_labels(6)
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .axis_style(PALE)
        .label_style(("sans-serif", DRAWN_LETTERS).with_color(PALE))
        .axis_desc_style(("sans-serif", DRAWN_LETTERS, FontStyle::Bold).with_color(PALE));
    also(&mut mesh);
    Ok(mesh.draw()?)
}

/// What a plot that can be zoomed begins with.
pub const LIVE: &str = "<div class=\"plot\">";

/// A plot has so many points at most: a drawing of bounded size, whatever the recording.
const MOST_POINTS: usize = 400;

/// Which of more points are drawn: of those that fall into one cell of a grid, one by chance, since the first ones of many cells may form lines
/// that are not in the data; and of each series the largest. Single points far from others stay. The grid is made coarser until few enough
/// are left.
fn drawn(series: &[Series]) -> Vec<Vec<usize>> {
    if series.iter().all(|s| s.points.len() <= MOST_POINTS) {
        return series.iter().map(|s| (0..s.points.len()).collect()).collect();
    }
    let all = || series.iter().flat_map(|s| s.points.iter()).filter(|p| p.0.is_finite() && p.1.is_finite());
    let (x, y) = (range(all().map(|p| p.0), false), range(all().map(|p| p.1), false));
    let shared = same_x(series);
    let chosen = |cells: f64| -> Vec<Vec<usize>> {
        let cell = |p: &(f64, f64)| {
            let at = |v: f64, r: &std::ops::Range<f64>| ((v - r.start) / (r.end - r.start) * cells) as i32;
            (at(p.0, &x), at(p.1, &y))
        };
        let mut kept: Vec<Vec<usize>> = Vec::new();
        for s in series {
            let size = |k: &usize| s.points[*k].1.abs();
            let mut order: Vec<usize> = (0..s.points.len()).collect();
            order.shuffle(&mut Pcg64Mcg::seed_from_u64(0));
            let largest =
                order.iter().copied().filter(|k| size(k).is_finite()).max_by(|a, b| size(a).total_cmp(&size(b)));
            let mut seen = std::collections::HashSet::new();
            let mut own: Vec<usize> =
                largest.into_iter().chain(order).filter(|k| seen.insert(cell(&s.points[*k]))).collect();
            own.sort_unstable();
            kept.push(own);
        }
        if shared {
            // before and after of a measurement are drawn together
            let mut both: Vec<usize> = kept.concat();
            both.sort_unstable();
            both.dedup();
            kept = vec![both; series.len()];
        }
        kept
    };
    let mut cells = 160.0;
    loop {
        let kept = chosen(cells);
        if kept.iter().map(Vec::len).max().unwrap_or(0) <= MOST_POINTS {
            return kept;
        }
        cells *= 0.85;
    }
}

/// The sentence that says how many points are drawn, where it is not all of them; so many lie outside of the picture.
fn not_all(series: &[Series], kept: &[Vec<usize>], outside: usize) -> String {
    let (all, drawn): (usize, usize) = if same_x(series) {
        (series.first().map_or(0, |s| s.points.len()), kept.first().map_or(0, Vec::len))
    } else {
        (series.iter().map(|s| s.points.len()).sum(), kept.iter().map(Vec::len).sum())
    };
    let fewer = format!("{drawn} of {all} points are drawn; points close together are drawn once.");
    let beyond = format!("{outside} point{} outside of the picture.", if outside == 1 { " lies" } else { "s lie" });
    match (drawn < all, outside > 0) {
        (false, false) => String::new(),
        (true, false) => format!("<p class=\"fewer\">{fewer}</p>"),
        (false, true) => format!("<p class=\"fewer\">{beyond}</p>"),
        (true, true) => format!("<p class=\"fewer\">{fewer} {beyond}</p>"),
    }
}

/// Whether all series have the same x, point by point.
fn same_x(series: &[Series]) -> bool {
    series.iter().skip(1).all(|s| {
        s.points.len() == series[0].points.len()
            && s.points.iter().zip(&series[0].points).all(|(a, b)| a.0.is_finite() && a.0 == b.0)
    })
}

/// A scatter plot that can be zoomed, with a static picture for paper. With `curves`, points are joined; many of them are not drawn.
pub fn scatter(x_label: &str, y_label: &str, from_zero: bool, curves: bool, series: &[Series]) -> Result<String> {
    scatter_named(x_label, y_label, from_zero, curves, series, &[])
}

/// As [`scatter`], with a name for each point, shown beside its x.
pub fn scatter_named(
    x_label: &str,
    y_label: &str,
    from_zero: bool,
    curves: bool,
    series: &[Series],
    names: &[String],
) -> Result<String> {
    let kept = if curves { Vec::new() } else { drawn(series) };
    let fewer: Vec<Series> = kept.iter().zip(series).map(|(k, s)| s.only(k)).collect();
    let fewer_told = if curves { String::new() } else { not_all(series, &kept, 0) };
    let series = if curves { series } else { &fewer };
    let own: Vec<String> = kept.first().into_iter().flatten().filter_map(|k| names.get(*k).cloned()).collect();
    let picture = still(x_label, y_label, from_zero, curves, series)?;
    let values = live(series, &own);
    let legend: Vec<_> = series.iter().map(|s| serde_json::json!({ "name": s.name, "color": hex(s.color) })).collect();
    let data = serde_json::json!({
        "x": x_label, "y": y_label, "zero": from_zero, "joined": curves, "points": !curves || few(series), "whole": whole(series),
        "series": legend, "data": values.0, "rows": values.1,
    });
    // nothing in it may end the script
    let data = serde_json::to_string(&data)?.replace('<', "\\u003c");
    Ok(format!("{LIVE}{picture}<script type=\"application/json\">{data}</script>{fewer_told}</div>"))
}

/// Columns with one ascending x, and the names in that order.
fn live(series: &[Series], names: &[String]) -> (Vec<Vec<Option<f64>>>, Vec<String>) {
    // five digits are finer than a screen
    let round = |v: f64| v.is_finite().then(|| format!("{v:.4e}").parse::<f64>().unwrap_or(v));
    let shared = same_x(series);
    let mut rows: Vec<(f64, Vec<Option<f64>>, String)> = Vec::new();
    for (s, these) in series.iter().enumerate() {
        for (k, (x, y)) in these.points.iter().enumerate().filter(|(_, p)| p.0.is_finite()) {
            match rows.get_mut(k).filter(|_| shared && s > 0) {
                Some(row) => row.1[s] = round(*y),
                None => {
                    let mut values = vec![None; series.len()];
                    values[s] = round(*y);
                    rows.push((*x, values, names.get(k).cloned().unwrap_or_default()));
                }
            }
        }
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut columns = vec![rows.iter().map(|r| round(r.0)).collect::<Vec<_>>()];
    columns.extend((0..series.len()).map(|s| rows.iter().map(|r| r.1[s]).collect()));
    let names = if names.is_empty() { Vec::new() } else { rows.into_iter().map(|r| r.2).collect() };
    (columns, names)
}

/// Bars of equal width: how many values fall into each.
pub fn histogram(x_label: &str, values: &[f64]) -> Result<String> {
    const BARS: usize = 30;
    let high = values.iter().copied().fold(0.0, f64::max).max(1e-9) * 1.000_001;
    let width = high / 30.0;
    let mut counts = [0_u32; BARS];
    for v in values.iter().filter(|v| v.is_finite()) {
        let k = ((v / width).max(0.0) as usize).min(BARS - 1);
        counts[k] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(1).max(1)) * 1.08;
    draw((480, 280), |root| {
        let mut chart = framed(root).build_cartesian_2d(0.0..high, 0.0..most)?;
        axes(&mut chart, x_label, "measurements", |mesh| {
            mesh.disable_x_mesh();
        })?;
        let mut left = 0.0;
        for n in counts {
            let bar = Rectangle::new([(left + 0.06 * width, 0.0), (left + 0.94 * width, f64::from(n))], AFTER.filled());
            chart.draw_series(std::iter::once(bar))?;
            left += width;
        }
        Ok(())
    })
}

/// A picture of series over x: its axes, and what is drawn `with` them.
fn chart(
    (x_label, y_label): (&str, &str),
    (x, y): (std::ops::Range<f64>, std::ops::Range<f64>),
    series: &[Series],
    with: impl FnOnce(&mut Chart<'_, '_>) -> Result<()>,
) -> Result<String> {
    draw((480, 300), |root| {
        let mut chart = framed(root).margin_top(26).build_cartesian_2d(x, y)?;
        axes(&mut chart, x_label, y_label, |mesh| {
            mesh.x_labels(ticks(series));
        })?;
        with(&mut chart)
    })
}

/// What the legend says of series.
fn keys(series: &[Series]) -> Vec<(&str, RGBColor)> {
    series.iter().map(|s| (s.name, s.color)).collect()
}

/// The static picture of a scatter plot.
fn still(x_label: &str, y_label: &str, from_zero: bool, curves: bool, series: &[Series]) -> Result<String> {
    let all = || series.iter().flat_map(|s| s.points.iter());
    let ranges = (range(all().map(|p| p.0), false), range(all().map(|p| p.1), from_zero));
    let mut dots = String::new();
    let svg = chart((x_label, y_label), ranges, series, |chart| {
        for s in series {
            if curves {
                chart.draw_series(LineSeries::new(s.points.iter().copied(), s.color.stroke_width(2)))?;
            }
            if !curves || few(series) {
                dots += &points(chart, s, STRONG);
            }
        }
        Ok(())
    })?;
    Ok(with_more(&svg, &(dots + &legend(&keys(series)))))
}

/// How much of what is behind them hide points, and where means are drawn over them.
const STRONG: f64 = 0.65;
const FAINT: f64 = 0.22;

/// All points of a series as one path: a tenth of the size of a circle each.
fn points(chart: &Chart<'_, '_>, s: &Series, opacity: f64) -> String {
    let mut path = String::new();
    for p in s.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()) {
        let (x, y) = chart.backend_coord(p);
        let _ = write!(path, "M{x} {y}h0");
    }
    format!(
        "<path d=\"{path}\" stroke=\"{}\" stroke-opacity=\"{opacity}\" stroke-width=\"6\" stroke-linecap=\"round\" fill=\"none\"/>",
        hex(s.color)
    )
}

/// Which colour is what, above a chart; nothing for a single series.
fn legend(keys: &[(&str, RGBColor)]) -> String {
    if keys.len() < 2 {
        return String::new();
    }
    let mut out = String::new();
    let mut x = 24;
    for (name, color) in keys {
        let _ = write!(
            out,
            "<rect x=\"{}\" y=\"8\" width=\"11\" height=\"11\" fill=\"{}\"/><text x=\"{}\" y=\"18\" font-family=\"sans-serif\" \
             font-size=\"{LETTERS}\" fill=\"#1d2733\">{name}</text>",
            x - 6,
            hex(*color),
            x + 9
        );
        x += 30 + 8 * name.len();
    }
    out
}

/// An SVG with more in it, above the rest.
fn with_more(svg: &str, more: &str) -> String {
    svg.rfind("</svg>").map_or_else(|| svg.to_owned(), |end| format!("{}{more}{}", &svg[..end], &svg[end..]))
}

/// An axis that is so many times as long for the few largest values leaves them out.
const FAR_OFF: f64 = 1.5;

/// What an axis shows of so many values: all but the few that are far off, and what it has to show besides.
fn usual(values: impl Iterator<Item = f64>, also: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let but =
        |few: usize| [sorted.get(few), sorted.get(sorted.len().saturating_sub(1 + few))].into_iter().flatten().copied();
    let also: Vec<f64> = also.collect();
    let of = |few| range(but(few).chain(also.iter().copied()), false);
    let (all, most) = (of(0), of(sorted.len() * 3 / 200));
    // those that are little further off are no reason to leave them out
    if all.end - all.start < FAR_OFF * (most.end - most.start) { all } else { most }
}

/// Points within a picture, behind what is drawn with them; what is told below of those that are not.
fn crowd(chart: &Chart<'_, '_>, all: &[Series], height: &std::ops::Range<f64>, opacity: f64) -> (String, String) {
    let inside = |p: &&(f64, f64)| height.contains(&p.1);
    let (mut dots, mut outside) = (String::new(), 0);
    let kept = drawn(all);
    for (s, kept) in all.iter().zip(&kept) {
        let few = s.only(kept);
        dots += &points(chart, &Series { points: few.points.iter().filter(inside).copied().collect(), ..few }, opacity);
        outside += s.points.iter().filter(|p| !inside(p)).count();
    }
    (dots, not_all(all, &kept, outside))
}

/// A fitted curve with its band over the data that it was fitted to.
pub fn curve_over_data(x_label: &str, y_label: &str, data: &[Series], curve: &Band) -> Result<String> {
    let all = || data.iter().flat_map(|s| &s.points);
    let x = range(all().map(|p| p.0).chain(curve.points.iter().map(|p| p.0)), false);
    // single points far off must not make the curve flat
    let y = usual(all().map(|p| p.1), curve.points.iter().flat_map(|p| [p.2, p.3]));
    let (mut dots, mut told) = Default::default();
    let svg = chart((x_label, y_label), (x, y.clone()), data, |chart| {
        (dots, told) = crowd(chart, data, &y, STRONG);
        chart.draw_series(std::iter::once(Polygon::new(curve.outline(), curve.color.mix(0.25))))?;
        chart.draw_series(LineSeries::new(curve.line(), curve.color.stroke_width(2)))?;
        Ok(())
    })?;
    let mut keys = keys(data);
    keys.push((&curve.name, curve.color));
    // points behind the curve
    let at = svg.find("<polygon").unwrap_or(svg.len());
    Ok(with_more(&format!("{}{dots}{}", &svg[..at], &svg[at..]), &legend(&keys)) + &told)
}

/// So many parts of an axis have a mean each, of so many points at least.
const PARTS: usize = 16;
const FEW_OF_A_PART: usize = 3;

/// Means of points in parts of x: x, mean, and half of its 95 % interval. Where x has few values only, each of them is a part.
fn means(points: &[(f64, f64)]) -> Vec<(f64, f64, f64)> {
    let (low, high) = span(points.iter().map(|p| p.0));
    let mut values: Vec<f64> = points.iter().map(|p| p.0).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let part = |x: f64| match values.iter().take(PARTS + 1).position(|v| *v == x) {
        Some(k) if values.len() <= PARTS => k,
        _ => ((x - low) / (high - low) * PARTS as f64).min(PARTS as f64 - 1.0) as usize,
    };
    let mut parts: Vec<Vec<(f64, f64)>> = vec![Vec::new(); PARTS];
    points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()).for_each(|p| parts[part(p.0)].push(*p));
    let of = |p: &Vec<(f64, f64)>| {
        let n = p.len() as f64;
        let [x, y] = [p.iter().map(|p| p.0).sum::<f64>() / n, p.iter().map(|p| p.1).sum::<f64>() / n];
        let variance = p.iter().map(|p| (p.1 - y).powi(2)).sum::<f64>() / (n - 1.0);
        (x, y, 1.96 * (variance / n).sqrt())
    };
    parts.iter().filter(|p| p.len() >= FEW_OF_A_PART).map(of).collect()
}

/// Series over the same x, such as errors without and with an effect: single points faint, over them their means in parts of x.
pub fn compared(x_label: &str, y_label: &str, series: &[Series]) -> Result<String> {
    let each: Vec<Vec<(f64, f64, f64)>> = series.iter().map(|s| means(&s.points)).collect();
    let all = || series.iter().flat_map(|s| &s.points);
    let x = range(all().map(|p| p.0), false);
    let y = usual(all().map(|p| p.1), each.iter().flatten().flat_map(|m| [m.1 - m.2, m.1 + m.2]));
    let (mut dots, mut told) = Default::default();
    let mut over = String::new();
    let svg = chart((x_label, y_label), (x, y.clone()), series, |chart| {
        (dots, told) = crowd(chart, series, &y, FAINT);
        for (s, means) in series.iter().zip(&each) {
            let (mut line, mut bars, mut marks) = (String::new(), String::new(), String::new());
            for (k, (x, mean, half)) in means.iter().enumerate() {
                let at = |y: f64| chart.backend_coord(&(*x, y));
                let ((x, y), (_, foot), (_, top)) = (at(*mean), at(mean - half), at(mean + half));
                let _ = write!(line, "{}{x} {y}", if k == 0 { 'M' } else { 'L' });
                let _ = write!(bars, "M{x} {foot}V{top}");
                let _ = write!(marks, "M{x} {y}h0");
            }
            let _ = write!(
                over,
                "<g stroke=\"{}\" fill=\"none\"><path d=\"{line}\"/><path d=\"{bars}\" stroke-width=\"2.5\"/>\
                 <path d=\"{marks}\" stroke-width=\"7\" stroke-linecap=\"round\"/></g>",
                hex(s.color)
            );
        }
        Ok(())
    })?;
    Ok(with_more(&svg, &(dots + &over + &legend(&keys(series)))) + &told)
}

/// A spectrum: amplitude of each whole number of cycles a turn; `marks` are those that were named.
pub fn spectrum(x_label: &str, y_label: &str, amplitudes: &[(f64, f64)], marks: &[f64]) -> Result<String> {
    let high = amplitudes.iter().map(|p| p.1).fold(1e-12, f64::max) * 1.2;
    let (mut bars, mut named) = (String::new(), String::new());
    let svg = draw((480, 260), |root| {
        let mut chart = framed(root).build_cartesian_2d(range(amplitudes.iter().map(|p| p.0), false), 0.0..high)?;
        axes(&mut chart, x_label, y_label, |_| ())?;
        for p in amplitudes {
            let ((x, top), (_, foot)) = (chart.backend_coord(p), chart.backend_coord(&(p.0, 0.0)));
            let _ = write!(bars, "M{x} {foot}V{top}");
        }
        let size_at = |n: f64| {
            let near = |a: &&(f64, f64), b: &&(f64, f64)| (a.0 - n).abs().total_cmp(&(b.0 - n).abs());
            amplitudes.iter().min_by(near).map_or(0.0, |p| p.1)
        };
        let mut marks: Vec<(f64, f64)> = marks.iter().map(|n| (*n, size_at(*n))).collect();
        marks.sort_by(|a, b| b.1.total_cmp(&a.1));
        // the largest are numbered first; no number is written over another
        let mut written: Vec<(i32, i32)> = Vec::new();
        for mark in &marks {
            let ((x, top), (_, foot)) = (chart.backend_coord(mark), chart.backend_coord(&(mark.0, 0.0)));
            let _ = write!(named, "<path d=\"M{x} {foot}V{top}\" stroke=\"#c85c46\" stroke-width=\"3\"/>");
            if written.iter().any(|(a, b)| (a - x).abs() < 26 && (b - top).abs() < 14) {
                continue;
            }
            // beside a higher line, the number stands on its own side of it
            let beside = written.iter().find(|(a, _)| (a - x).abs() < 14).map(|(a, _)| a <= &x);
            let (anchor, at) = match beside {
                Some(true) => ("start", x + 4),
                Some(false) => ("end", x - 4),
                None => ("middle", x),
            };
            written.push((x, top));
            let _ = write!(
                named,
                "<text x=\"{at}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"{LETTERS}\" text-anchor=\"{anchor}\" \
                 fill=\"#c85c46\">{:.0}</text>",
                top - 5,
                mark.0
            );
        }
        Ok(())
    })?;
    Ok(with_more(&svg, &format!("<path d=\"{bars}\" stroke=\"#2666a5\" stroke-width=\"1.6\"/>{named}")))
}

/// Height of a bar of a staircase with the room around it.
const STAIR: usize = 20;

/// A staircase: bars from top to bottom, each with its name before and its value behind it; `what` they are stands above.
pub fn staircase(what: &str, values: &[(String, f64)], decimals: usize) -> String {
    const WIDE: usize = 480;
    const LEFT: usize = 76;
    const LONGEST: f64 = 330.0;
    let most = values.iter().map(|v| v.1).fold(1e-12, f64::max);
    let high = 32 + STAIR * values.len();
    let mut svg = format!(
        "<svg class=\"chart\" viewBox=\"0 0 {WIDE} {high}\" width=\"100%\" style=\"max-width:{WIDE}px\" xmlns=\"http://www.w3.org/2000/svg\" \
         font-family=\"sans-serif\" font-size=\"{LETTERS}\" fill=\"{}\"><rect width=\"{WIDE}\" height=\"{high}\" fill=\"#fff\"/>\
         <text x=\"{LEFT}\" y=\"16\" font-weight=\"bold\">{what}</text>",
        hex(PALE)
    );
    for (k, (name, value)) in values.iter().enumerate() {
        let (y, long) = (26 + STAIR * k, (value / most).max(0.0) * LONGEST);
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{name}</text><rect x=\"{LEFT}\" y=\"{y}\" width=\"{long:.1}\" height=\"{}\" \
             fill=\"{}\"/><text x=\"{:.1}\" y=\"{1}\">{value:.decimals$}</text>",
            LEFT - 8,
            y + 12,
            STAIR - 5,
            hex(if k == 0 { BEFORE } else { AFTER }),
            LEFT as f64 + long + 6.0
        );
    }
    svg + "</svg>"
}

/// A curve with a band around it.
pub struct Band {
    /// In the legend.
    pub name: String,
    /// Colour.
    pub color: RGBColor,
    /// x, y, lower and upper edge of the band.
    pub points: Vec<(f64, f64, f64, f64)>,
}

impl Band {
    fn line(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().map(|p| (p.0, p.1))
    }

    /// Along the upper edge and back along the lower one.
    fn outline(&self) -> Vec<(f64, f64)> {
        let back = self.points.iter().rev().map(|p| (p.0, p.2));
        self.points.iter().map(|p| (p.0, p.3)).chain(back).collect()
    }
}

/// Panels side by side, each with a heading, curves over the same kinds of axes, y from zero; one legend below.
pub fn panels(x_label: &str, y_label: &str, panels: &[(String, Vec<Band>)]) -> Result<String> {
    let legend = panels.first().map_or(&[][..], |p| p.1.as_slice());
    let columns = panels.len().clamp(1, 2);
    let rows = legend.len().div_ceil(columns) as u32;
    let below = 24 * rows + 12;
    let size = (460 * panels.len().max(1) as u32, 340 + below);
    draw(size, |root| {
        let (charts, keys) = root.split_vertically(340);
        for (area, (heading, curves)) in charts.split_evenly((1, panels.len().max(1))).iter().zip(panels) {
            let all = || curves.iter().flat_map(|c| c.points.iter());
            let x = range(all().map(|p| p.0), false);
            let high = all().map(|p| p.3).fold(0.0, f64::max) * 1.1;
            if !(high.is_finite() && high > 0.0) {
                continue;
            }
            let mut chart = framed(area)
                .caption(heading, ("sans-serif", 20))
                .y_label_area_size(76)
                .build_cartesian_2d(x, 0.0..high)?;
            axes(&mut chart, x_label, y_label, |_| ())?;
            for c in curves {
                if c.points.iter().any(|p| p.3 > p.2) {
                    chart.draw_series(std::iter::once(Polygon::new(c.outline(), c.color.mix(0.13))))?;
                }
                chart.draw_series(LineSeries::new(c.line(), c.color.stroke_width(2)))?;
                chart.draw_series(c.line().map(|p| Circle::new(p, 3, c.color.filled())))?;
            }
        }
        for (k, c) in legend.iter().enumerate() {
            let (x, y) = (70 + 400 * (k % columns) as i32, 12 + 24 * (k / columns) as i32);
            keys.draw(&PathElement::new(vec![(x, y), (x + 26, y)], c.color.stroke_width(3)))?;
            keys.draw(&Text::new(
                c.name.clone(),
                (x + 34, y - 9),
                ("sans-serif", DRAWN_LETTERS).into_font().color(&BLACK),
            ))?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests;
