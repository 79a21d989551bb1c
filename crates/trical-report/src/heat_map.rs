//! The error map as pictures: how far the arm misses without its model, seen from above in three heights and from the side.

use std::fmt::Write;

use trical_model::Model;

use crate::error::Result;
use crate::error_map::{ErrorMap, Miss};
use crate::figures::plots::span;
use crate::page::{Figure, Section};
use crate::table::counted;

/// Poses of the map.
const POSES: usize = 6000;

/// Squares along the longer side of a panel.
const SQUARES: f64 = 17.0;

/// Width of a panel and of the margins about it, in the picture's units.
const PANEL: f64 = 270.0;
const MARGIN: [f64; 3] = [56.0, 24.0, 34.0];

/// A panel that is narrower has no room for the name of its axis between two numbers.
const LABEL: f64 = 190.0;

/// Pale yellow over red to black: light and dark tell small from large on paper too.
const COLORS: [[f64; 3]; 4] = [[252.0, 248.0, 214.0], [246.0, 190.0, 86.0], [205.0, 72.0, 58.0], [66.0, 14.0, 52.0]];

fn color(part: f64) -> String {
    let x = part.clamp(0.0, 1.0) * 2.999;
    let k = x.floor() as usize;
    let mix = |c: usize| COLORS[k][c] + (COLORS[k + 1][c] - COLORS[k][c]) * x.fract();
    format!("#{:02x}{:02x}{:02x}", byte(mix(0)), byte(mix(1)), byte(mix(2)))
}

fn byte(x: f64) -> u8 {
    x.round() as u8
}

/// Places on a page (mm) with errors (mm).
struct Panel {
    heading: String,
    axes: [&'static str; 2],
    points: Vec<[f64; 3]>,
}

/// Squares of equal size, row by row: the sum of errors, the largest, how many.
struct Grid {
    low: [f64; 2],
    side: f64,
    columns: usize,
    rows: usize,
    squares: Vec<(f64, f64, usize)>,
}

impl Grid {
    /// `range`: lowest and highest place along both axes, mm.
    fn of(points: &[[f64; 3]], range: [[f64; 2]; 2]) -> Self {
        let wide = [range[0][1] - range[0][0], range[1][1] - range[1][0]];
        let side = (wide[0].max(wide[1]) / SQUARES).max(1e-3);
        let index = |x: f64| (x / side).floor().max(0.0) as usize;
        let (columns, rows) = (index(wide[0]) + 1, index(wide[1]) + 1);
        let mut squares = vec![(0.0, 0.0_f64, 0); columns * rows];
        for [x, y, e] in points {
            let (i, j) = (index(x - range[0][0]).min(columns - 1), index(y - range[1][0]).min(rows - 1));
            let s = &mut squares[j * columns + i];
            *s = (s.0 + e, s.1.max(*e), s.2 + 1);
        }
        Self { low: [range[0][0], range[1][0]], side, columns, rows, squares }
    }

    /// Side of a square in the picture.
    fn drawn_side(&self) -> f64 {
        self.side * (PANEL / (self.side * (SQUARES + 1.0)))
    }

    /// Upper left corner of a square in the picture, of a panel that begins at `x0`, `y0`.
    fn corner(&self, (x0, y0): (f64, f64), i: usize, j: usize) -> (f64, f64) {
        let (i, j) = (i as f64, (self.rows - 1 - j) as f64);
        (x0 + i * self.drawn_side(), y0 + j * self.drawn_side())
    }

    fn means(&self) -> impl Iterator<Item = f64> + '_ {
        self.squares.iter().filter(|s| s.2 > 0).map(|s| s.0 / s.2 as f64)
    }
}

fn range(points: &[[f64; 3]], axis: usize) -> [f64; 2] {
    span(points.iter().map(|p| p[axis])).into()
}

/// Panels side by side where the page has room for two, one scale of colours for all of them.
fn draw(panels: &[Panel]) -> String {
    let grids: Vec<Grid> =
        panels.iter().map(|p| Grid::of(&p.points, [range(&p.points, 0), range(&p.points, 1)])).collect();
    let most = grids.iter().flat_map(Grid::means).fold(1e-9, f64::max);
    let [left, right, around] = MARGIN;
    let wide = left + PANEL + right;
    // without a ground: the page has one, light or dark
    let picture = |height: f64, what: &str| {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{wide:.0}\" style=\"max-width:100%\" viewBox=\"0 0 {wide:.0} \
             {height:.0}\" font-family=\"system-ui, sans-serif\" font-size=\"12\" fill=\"#47566a\">{what}</svg>"
        )
    };
    let begin = (left, around);
    let drawn = panels.iter().zip(&grids).map(|(panel, grid)| {
        let high = grid.rows as f64 * grid.drawn_side();
        picture(around + high + 46.0, &(squares(panel, grid, begin, most) + &axes(panel, grid, begin)))
    });
    format!(
        "<div class=\"panels\">{}{}</div>",
        drawn.collect::<String>(),
        picture(52.0, &scale_of_colors((left, 8.0), most))
    )
}

/// The heading of a panel that begins at `begin`, and its squares in the colours of their mean errors.
fn squares(panel: &Panel, grid: &Grid, begin: (f64, f64), most: f64) -> String {
    let mut svg = format!(
        "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"13\" font-weight=\"600\">{}</text>",
        begin.0,
        begin.1 - 10.0,
        panel.heading
    );
    let side = grid.drawn_side();
    for (n, (sum, largest, count)) in grid.squares.iter().enumerate().filter(|s| s.1.2 > 0) {
        let (i, j) = (n % grid.columns, n / grid.columns);
        let ((x, y), mean) = (grid.corner(begin, i, j), sum / *count as f64);
        let middle = [i, j].map(|n| (n as f64 + 0.5) * grid.side);
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} {y:.1}h{side:.1}v{side:.1}h-{side:.1}z\" fill=\"{}\"><title>{} {:.0}, {} {:.0} mm: {mean:.2} \
             mm, at most {largest:.2}; {}</title></path>",
            color(mean / most),
            panel.axes[0],
            grid.low[0] + middle[0],
            panel.axes[1],
            grid.low[1] + middle[1],
            counted(*count, "pose")
        );
    }
    svg
}

/// Names and ends of a panel's axes.
fn axes(panel: &Panel, grid: &Grid, begin: (f64, f64)) -> String {
    let (x0, side) = (begin.0, grid.drawn_side());
    let (bottom, end) = (grid.corner(begin, 0, 0).1 + side, grid.corner(begin, grid.columns - 1, 0).0 + side);
    let top = grid.corner(begin, 0, grid.rows - 1).1;
    let high = |n: usize, k: usize| grid.low[k] + n as f64 * grid.side;
    let middle = 0.5 * (top + bottom);
    format!(
        "<text x=\"{x0:.1}\" y=\"{0:.1}\">{1:.0}</text><text x=\"{end:.1}\" y=\"{0:.1}\" text-anchor=\"end\">{2:.0}</text>\
         <text x=\"{3:.1}\" y=\"{4:.1}\" text-anchor=\"middle\">{5}, mm</text>\
         <text x=\"{6:.1}\" y=\"{bottom:.1}\" text-anchor=\"end\">{7:.0}</text>\
         <text x=\"{6:.1}\" y=\"{8:.1}\" text-anchor=\"end\">{9:.0}</text>\
         <text x=\"{10:.1}\" y=\"{middle:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 {10:.1} {middle:.1})\">{11}, mm</text>",
        bottom + 15.0,
        grid.low[0],
        high(grid.columns, 0),
        0.5 * (x0 + end),
        // between the numbers, where there is room
        bottom + if end - x0 > LABEL { 15.0 } else { 30.0 },
        panel.axes[0],
        x0 - 6.0,
        grid.low[1],
        top + 10.0,
        high(grid.rows, 1),
        x0 - 30.0,
        panel.axes[1]
    )
}

/// Which mean error has which colour.
fn scale_of_colors((x0, y0): (f64, f64), most: f64) -> String {
    let mut svg = String::new();
    for k in 0..40_u8 {
        let part = f64::from(k) / 40.0;
        let x = x0 + part * PANEL;
        let _ = write!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y0:.1}\" width=\"{:.2}\" height=\"12\" fill=\"{}\"/>",
            PANEL / 40.0 + 0.3,
            color(part)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{x0:.1}\" y=\"{0:.1}\">0</text><text x=\"{1:.1}\" y=\"{0:.1}\" text-anchor=\"end\">{most:.2} mm \
         (largest mean of a square)</text>",
        y0 + 27.0,
        x0 + PANEL
    );
    svg
}

/// Three slices by height with equally many poses each, from above; and all poses from the side.
fn panels(misses: &[Miss]) -> Vec<Panel> {
    let point = |a: f64, b: f64, m: &Miss| [a * 1e3, b * 1e3, m.off.norm() * 1e3];
    let mut by_height: Vec<&Miss> = misses.iter().collect();
    by_height.sort_by(|a, b| a.at.z.total_cmp(&b.at.z));
    let mut panels: Vec<Panel> = by_height
        .chunks(misses.len().div_ceil(3).max(1))
        .map(|slice| Panel {
            heading: format!(
                "From above, heights {:.0} to {:.0} mm",
                slice.first().map_or(0.0, |m| m.at.z * 1e3),
                slice.last().map_or(0.0, |m| m.at.z * 1e3)
            ),
            axes: ["x", "y"],
            points: slice.iter().map(|m| point(m.at.x, m.at.y, m)).collect(),
        })
        .collect();
    panels.push(Panel {
        heading: "From the side, all around the base".into(),
        axes: ["distance", "height"],
        points: misses.iter().map(|m| point(m.at.x.hypot(m.at.y), m.at.z, m)).collect(),
    });
    panels
}

/// The section of a report: what `trical export --error-map` writes, as pictures.
pub fn section(model: &Model) -> Result<Section> {
    let map = ErrorMap::of(model, POSES)?;
    let all = map.summary().errors;
    Ok(Section::new("Position error of the nominal arm over its whole workspace, by this model")
        .with_text([format!(
            "At {POSES} poses at random within the limits of the joints the nominal arm's tool is \
                 {:.3} mm from where this model says that it is, on average; {:.3} mm at most. Seen from \
                 the arm's own base, with the tool that was identified: where the arm stands and how its \
                 tool is mounted does not count, nor do time, temperature and sense of motion. These \
                 numbers are predictions of the model; beyond the measured joint angles they are \
                 extrapolated.",
            all.mean_mm, all.max_mm
        )])
        .with_figures([Figure::new(
            "Each square in the colour of the mean error of its poses; numbers show under the \
                 pointer. Places in the frame of the arm's base. `trical export --error-map` writes the \
                 poses one by one.",
            draw(&panels(&map.misses)),
        )]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_model::{Basis, Parameter, Site, Term};

    #[test]
    fn an_arm_turned_about_its_first_axis_misses_in_proportion_to_the_distance() {
        let mut model = crate::test_data::arm();
        let site = Site::Link { link: 1, parameter: Parameter::Theta };
        model.terms.push(Term { value: 1e-3, ..Term::new("t", "geometry", site, Basis::CONSTANT) });
        let map = ErrorMap::of(&model, 3000).unwrap();
        let side = panels(&map.misses).pop().unwrap();
        let grid = Grid::of(&side.points, [range(&side.points, 0), range(&side.points, 1)]);
        for (n, (sum, largest, count)) in grid.squares.iter().enumerate().filter(|s| s.1.2 > 0) {
            let distance = grid.low[0] + ((n % grid.columns) as f64 + 0.5) * grid.side;
            let half = 0.51e-3 * grid.side + 1e-3;
            assert!((sum / *count as f64 - 1e-3 * distance).abs() < half, "{distance}");
            assert!((largest - 1e-3 * distance).abs() < half, "{distance}");
        }
        let all: usize = grid.squares.iter().map(|s| s.2).sum();
        assert_eq!(all, 3000);
        let svg = section(&model).unwrap().figures.pop().unwrap().svg;
        assert_eq!(svg.matches("From above").count(), 3);
    }

    #[test]
    fn a_flat_panel_is_no_higher_than_its_squares_and_has_no_ground_of_its_own() {
        let of = |points| Panel { heading: "p".into(), axes: ["x", "y"], points };
        let high = |panel: Panel| {
            let svg = draw(&[panel]);
            assert!(!svg.contains("#fff"), "white on a dark page: {svg}");
            svg.split("viewBox=\"0 0 350 ").nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap()
        };
        let (flat, square) =
            (of(vec![[0.0, 0.0, 1.0], [1700.0, 150.0, 1.0]]), of(vec![[0.0, 0.0, 1.0], [1700.0, 1700.0, 1.0]]));
        // 2 rows of 15 beside 18 of them, below 34 and above 46
        assert_eq!((high(flat), high(square)), (110.0, 350.0));
    }
}
