//! The loop of a product.
//!
//! Entries are summed in tiles, each entry over the common index in order, so that vectors lie across entries and their width is no matter. What a tile
//! needs is copied to where it lies in order (Goto & van de Geijn 2008).

use std::cell::RefCell;

use pulp::{Arch, NullaryFnOnce};

use super::view::View;
use super::{add as add_to, dot};

/// Rows and columns of a tile.
const HIGH: usize = 8;
const WIDE: usize = 4;

/// Of the common index so much is worked on at once: what stays near the processor.
const DEEP: usize = 64;

/// So many strips of rows are copied at once: with what they meet of the columns they stay near the processor, too.
const STRIPS: usize = 16;

/// Rows of a narrow product that are worked on at once.
const LONG: usize = 1024;

type Tile = [[f64; HIGH]; WIDE];

/// Adds `factor a b` to `out`, whose columns are `stride` apart; with `lower` only what is not above the diagonal has to be right.
pub(super) fn add(out: &mut [f64], stride: usize, factor: f64, a: View<'_>, b: View<'_>, lower: bool) {
    debug_assert!(a.rows <= stride && a.columns == b.rows);
    COPIES.with_borrow_mut(|copies| Arch::new().dispatch(Product { out, stride, factor, a, b, lower, copies }));
}

/// Strips of rows and of columns.
type Copies = (Vec<[f64; HIGH]>, Vec<[f64; WIDE]>);

thread_local! {
    /// Memory that needs no zeros each time.
    static COPIES: RefCell<Copies> = RefCell::default();
}

struct Product<'a> {
    out: &'a mut [f64],
    stride: usize,
    factor: f64,
    a: View<'a>,
    b: View<'a>,
    lower: bool,
    copies: &'a mut Copies,
}

impl NullaryFnOnce for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { out, stride, factor, a, b, lower, copies: (rows, columns) } = self;
        let (m, n, depth) = (a.rows, b.columns, a.columns);
        if m == 0 || n == 0 || depth == 0 {
            return;
        }
        if n <= 2 * WIDE && a.stride.0 == 1 {
            // not worth a copy
            for from in (0..m).step_by(LONG) {
                let long = LONG.min(m - from);
                let column = |k: usize| &a.entries[k * a.stride.1 + from..][..long];
                for k in (0..depth).step_by(4) {
                    for j in 0..n {
                        let out = &mut out[j * stride + from..][..long];
                        if k + 4 > depth {
                            (k..depth).for_each(|k| add_to(out, factor * b.at(k, j), column(k)));
                            continue;
                        }
                        let [y0, y1, y2, y3] = [0, 1, 2, 3].map(|i| factor * b.at(k + i, j));
                        let columns = column(k).iter().zip(column(k + 1)).zip(column(k + 2)).zip(column(k + 3));
                        for (out, (((a0, a1), a2), a3)) in out.iter_mut().zip(columns) {
                            *out = (((*out + y0 * a0) + y1 * a1) + y2 * a2) + y3 * a3;
                        }
                    }
                }
            }
            return;
        }
        if n == 1 && b.stride.0 == 1 {
            let x = &b.entries[..depth];
            for (i, out) in out[..m].iter_mut().enumerate() {
                *out += factor * dot(&a.entries[i * a.stride.0..][..depth], x);
            }
            return;
        }
        let (high, wide) = (m.div_ceil(HIGH), n.div_ceil(WIDE));
        let mut tiles: Vec<Tile> = vec![[[0.0; HIGH]; WIDE]; high * wide];
        let (strips, deep) = (high.min(STRIPS), depth.min(DEEP));
        rows.resize(rows.len().max(strips * deep), [0.0; HIGH]);
        columns.resize(columns.len().max(wide * deep), [0.0; WIDE]);
        for from in (0..depth).step_by(DEEP) {
            let count = DEEP.min(depth - from);
            copy(b.rows(from, count).transpose(), columns);
            let a = a.columns(from, count);
            for first in (0..high).step_by(STRIPS) {
                let some = first..high.min(first + STRIPS);
                copy(a.rows(first * HIGH, m.min(some.end * HIGH) - first * HIGH), rows);
                for (i, rows) in some.zip(rows.chunks_exact(count)) {
                    let tiles = &mut tiles[i * wide..][..wide];
                    for (j, (columns, tile)) in columns.chunks_exact(count).zip(tiles).enumerate() {
                        if !lower || (i + 1) * HIGH > j * WIDE {
                            add_to_tile(tile, rows, columns);
                        }
                    }
                }
            }
        }
        for j in 0..n {
            let out = &mut out[j * stride..][..m];
            let first = if lower { j / HIGH } else { 0 };
            for (i, out) in out.chunks_mut(HIGH).enumerate().skip(first) {
                add_to(out, factor, &tiles[i * wide + j / WIDE][j % WIDE]);
            }
        }
    }
}

#[inline(always)]
fn add_to_tile(tile: &mut Tile, rows: &[[f64; HIGH]], columns: &[[f64; WIDE]]) {
    let mut sums = *tile;
    for (row, column) in rows.iter().zip(columns) {
        for (sums, y) in sums.iter_mut().zip(column) {
            for (sum, x) in sums.iter_mut().zip(row) {
                *sum += x * y;
            }
        }
    }
    *tile = sums;
}

/// Strips of `N` rows, each in the order of the columns; what fills up the last one is of no use. It is read in the order in which it lies.
#[inline(always)]
fn copy<const N: usize>(of: View<'_>, to: &mut [[f64; N]]) {
    if of.stride.0 == 1 {
        for k in 0..of.columns {
            let column = &of.entries[k * of.stride.1..][..of.rows];
            let strips = column.chunks_exact(N);
            let rest = strips.remainder();
            let mut to = to[k..].iter_mut().step_by(of.columns);
            for (strip, to) in strips.zip(&mut to) {
                to.copy_from_slice(strip);
            }
            if let Some(to) = to.next() {
                to.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
            }
        }
        return;
    }
    for (to, first) in to.chunks_exact_mut(of.columns).zip((0..of.rows).step_by(N)) {
        let lanes: [&[f64]; N] = std::array::from_fn(|i| {
            let row = (first + i).min(of.rows - 1);
            &of.entries[row * of.stride.0..][..of.columns]
        });
        for (k, to) in to.iter_mut().enumerate() {
            *to = std::array::from_fn(|i| lanes[i][k]);
        }
    }
}
