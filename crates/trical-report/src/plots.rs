//! Plots as SVG, to be put inline into a report.

use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::error::{Error, Result};

/// Before: grey-red. After: blue.
pub const BEFORE: RGBColor = RGBColor(200, 92, 70);
/// See [`BEFORE`].
pub const AFTER: RGBColor = RGBColor(38, 102, 165);

/// Points of one colour.
pub struct Series {
    /// In the legend.
    pub name: &'static str,
    /// Colour.
    pub color: RGBColor,
    /// Points.
    pub points: Vec<(f64, f64)>,
}

fn failed(e: impl std::fmt::Display) -> Error {
    Error::Failed(format!("a figure could not be drawn: {e}"))
}

fn range(values: impl Iterator<Item = f64> + Clone, from_zero: bool) -> std::ops::Range<f64> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if !low.is_finite() || !high.is_finite() {
        return 0.0..1.0;
    }
    let pad = ((high - low) * 0.04).max(1e-9);
    if from_zero { 0.0..(high + pad) } else { (low - pad)..(high + pad) }
}

fn draw(size: (u32, u32), with: impl FnOnce(&DrawingArea<SVGBackend<'_>, Shift>) -> Result<()>) -> Result<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        with(&root)?;
        root.present().map_err(failed)?;
    }
    // scale with the page
    let (w, h) = size;
    Ok(svg.replacen(&format!("width=\"{w}\" height=\"{h}\""), &format!("width=\"100%\" style=\"max-width:{w}px\""), 1))
}

type Chart<'a, 's> = ChartContext<'a, SVGBackend<'s>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Mesh<'a, 'c, 's> = MeshStyle<'a, 'c, RangedCoordf64, RangedCoordf64, SVGBackend<'s>>;

/// Draws the axes with their labels and the lines behind a chart; `also` has what is special about them.
fn axes<'a, 'c, 's>(
    chart: &'c mut Chart<'a, 's>,
    x_label: &str,
    y_label: &str,
    also: impl FnOnce(&mut Mesh<'a, 'c, 's>),
) -> Result<()> {
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .x_desc(x_label)
        .y_desc(y_label)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14));
    also(&mut mesh);
    mesh.draw().map_err(failed)
}

/// What a plot that can be zoomed begins with.
pub const LIVE: &str = "<div class=\"plot\">";

/// A scatter plot that can be zoomed, with a static picture for paper. With `curves`, points are joined.
pub fn scatter(x_label: &str, y_label: &str, from_zero: bool, curves: bool, series: &[Series]) -> Result<String> {
    scatter_named(x_label, y_label, from_zero, curves, series, &[])
}

/// The same, with a name for each point, shown beside its x.
pub fn scatter_named(
    x_label: &str,
    y_label: &str,
    from_zero: bool,
    curves: bool,
    series: &[Series],
    names: &[String],
) -> Result<String> {
    let picture = still(x_label, y_label, from_zero, curves, series)?;
    let values = live(series, names);
    let legend: Vec<_> = series
        .iter()
        .map(|s| {
            let (r, g, b) = (s.color.0, s.color.1, s.color.2);
            serde_json::json!({ "name": s.name, "color": format!("#{r:02x}{g:02x}{b:02x}") })
        })
        .collect();
    let data = serde_json::json!({
        "x": x_label, "y": y_label, "zero": from_zero, "joined": curves,
        "series": legend, "data": values.0, "rows": values.1,
    });
    // nothing in it may end the script
    let data = serde_json::to_string(&data)?.replace('<', "\\u003c");
    Ok(format!("{LIVE}{picture}<script type=\"application/json\">{data}</script></div>"))
}

/// Columns with one ascending x, and the names in that order.
fn live(series: &[Series], names: &[String]) -> (Vec<Vec<Option<f64>>>, Vec<String>) {
    let round = |v: f64| v.is_finite().then(|| (v * 1e6).round() / 1e6);
    let shared = series.iter().skip(1).all(|s| {
        s.points.len() == series[0].points.len()
            && s.points.iter().zip(&series[0].points).all(|(a, b)| a.0.is_finite() && a.0 == b.0)
    });
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
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to BARS")]
        let k = ((v / width).max(0.0) as usize).min(BARS - 1);
        counts[k] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(1).max(1)) * 1.08;
    draw((620, 320), |root| {
        let mut chart = ChartBuilder::on(root)
            .margin(10)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..high, 0.0..most)
            .map_err(failed)?;
        axes(&mut chart, x_label, "measurements", |mesh| {
            mesh.disable_x_mesh().y_label_formatter(&|n| format!("{n:.0}"));
        })?;
        let mut left = 0.0;
        for n in counts {
            let bar = Rectangle::new([(left + 0.06 * width, 0.0), (left + 0.94 * width, f64::from(n))], AFTER.filled());
            chart.draw_series(std::iter::once(bar)).map_err(failed)?;
            left += width;
        }
        Ok(())
    })
}

/// The static picture of a scatter plot.
fn still(x_label: &str, y_label: &str, from_zero: bool, curves: bool, series: &[Series]) -> Result<String> {
    draw((620, 360), |root| {
        let all = || series.iter().flat_map(|s| s.points.iter());
        let mut chart = ChartBuilder::on(root)
            .margin(10)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(range(all().map(|p| p.0), false), range(all().map(|p| p.1), from_zero))
            .map_err(failed)?;
        axes(&mut chart, x_label, y_label, |_| ())?;
        for s in series {
            let color = s.color;
            if curves {
                chart
                    .draw_series(LineSeries::new(s.points.iter().copied(), color.stroke_width(2)))
                    .map_err(failed)?
                    .label(s.name)
                    .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 14, y)], color.stroke_width(2)));
            } else {
                chart
                    .draw_series(s.points.iter().map(|p| Circle::new(*p, 3, color.mix(0.65).filled())))
                    .map_err(failed)?
                    .label(s.name)
                    .legend(move |(x, y)| Circle::new((x + 7, y), 4, color.filled()));
            }
        }
        if series.len() > 1 {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.85))
                .border_style(RGBColor(200, 200, 200))
                .label_font(("sans-serif", 13))
                .draw()
                .map_err(failed)?;
        }
        Ok(())
    })
}

/// A staircase: bars from left to right, each with its label below.
pub fn staircase(y_label: &str, x_label: &str, values: &[(String, f64)]) -> Result<String> {
    draw((620, 320), |root| {
        let high = values.iter().map(|v| v.1).fold(0.0, f64::max) * 1.15;
        let label = |x: &f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
            let k = x.round().max(0.0) as usize;
            let whole = (x - x.round()).abs() < 0.01;
            values.get(k).filter(|_| whole).map_or_else(String::new, |v| v.0.clone())
        };
        #[expect(clippy::cast_precision_loss, reason = "a small count")]
        let n = values.len() as f64;
        let mut chart = ChartBuilder::on(root)
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(-0.6..(n - 0.4), 0.0..high.max(1e-9))
            .map_err(failed)?;
        axes(&mut chart, x_label, y_label, |mesh| {
            mesh.disable_x_mesh().x_labels(2 * values.len() + 1).x_label_formatter(&label);
        })?;
        chart
            .draw_series(values.iter().enumerate().map(|(k, (_, v))| {
                #[expect(clippy::cast_precision_loss, reason = "a small count")]
                let x = k as f64;
                Rectangle::new([(x - 0.38, 0.0), (x + 0.38, *v)], if k == 0 { BEFORE } else { AFTER }.filled())
            }))
            .map_err(failed)?;
        Ok(())
    })
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

/// Panels side by side, each with a heading, curves over the same kinds of axes, y from zero; one legend below.
pub fn panels(x_label: &str, y_label: &str, panels: &[(String, Vec<Band>)]) -> Result<String> {
    let legend = panels.first().map_or(&[][..], |p| p.1.as_slice());
    let rows = u32::try_from(legend.len().div_ceil(2)).unwrap_or(0);
    let below = 24 * rows + 12;
    let size = (460 * u32::try_from(panels.len()).unwrap_or(1).max(1), 340 + below);
    draw(size, |root| {
        let (charts, keys) = root.split_vertically(340);
        for (area, (heading, curves)) in charts.split_evenly((1, panels.len().max(1))).iter().zip(panels) {
            let all = || curves.iter().flat_map(|c| c.points.iter());
            let x = range(all().map(|p| p.0), false);
            let high = all().map(|p| p.3).fold(0.0, f64::max) * 1.1;
            if !(high.is_finite() && high > 0.0) {
                continue;
            }
            let mut chart = ChartBuilder::on(area)
                .margin(10)
                .caption(heading, ("sans-serif", 16))
                .x_label_area_size(44)
                .y_label_area_size(70)
                .build_cartesian_2d(x, 0.0..high)
                .map_err(failed)?;
            axes(&mut chart, x_label, y_label, |mesh| {
                mesh.x_label_formatter(&|x| format!("{x:.0}"));
            })?;
            for c in curves {
                let up = c.points.iter().map(|p| (p.0, p.3));
                let down = c.points.iter().rev().map(|p| (p.0, p.2));
                if c.points.iter().any(|p| p.3 > p.2) {
                    chart
                        .draw_series(std::iter::once(Polygon::new(
                            up.chain(down).collect::<Vec<_>>(),
                            c.color.mix(0.13),
                        )))
                        .map_err(failed)?;
                }
                chart
                    .draw_series(LineSeries::new(c.points.iter().map(|p| (p.0, p.1)), c.color.stroke_width(2)))
                    .map_err(failed)?;
                chart
                    .draw_series(c.points.iter().map(|p| Circle::new((p.0, p.1), 3, c.color.filled())))
                    .map_err(failed)?;
            }
        }
        for (k, c) in legend.iter().enumerate() {
            let (column, line) = (i32::try_from(k % 2).unwrap_or(0), i32::try_from(k / 2).unwrap_or(0));
            let (x, y) = (70 + 400 * column, 12 + 24 * line);
            keys.draw(&PathElement::new(vec![(x, y), (x + 26, y)], c.color.stroke_width(3))).map_err(failed)?;
            keys.draw(&Text::new(c.name.clone(), (x + 34, y - 8), ("sans-serif", 14).into_font().color(&BLACK)))
                .map_err(failed)?;
        }
        Ok(())
    })
}
