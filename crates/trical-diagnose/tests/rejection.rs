//! Stale rows.

use trical_diagnose::rejection::without_stale;
use trical_ident::{Dataset, JointSource};
use trical_model::{Measured, Recording, Row, State};

#[test]
fn a_repeated_reading_is_stale_only_where_chance_cannot_repeat_it() {
    let rows = |x: &dyn Fn(usize) -> f64| {
        let row = |k: usize| Row {
            state: State::at(&[0.01 * k as f64; 6]),
            measured: Measured::Touch { ball: 0, reading: [x(k), 0.0, 0.0] },
            seq: None,
            line: k + 2,
        };
        let recording =
            Recording { name: "made".into(), joints: 6, rows: (0..200).map(row).collect(), ..Recording::default() };
        Dataset::build(&[recording], JointSource::Read, None).unwrap()
    };
    // y and z always show 0; x never shows the same twice but once
    let once = rows(&|k| 1e-6 * if k == 101 { 100.0 } else { k as f64 });
    let stale: Vec<usize> = without_stale(&once).rejected.iter().map(|r| r.row).collect();
    assert_eq!(stale, [102]);
    // x has two values only: repeats are chance
    let coarse = rows(&|k| ((k / 2) % 2) as f64 * 1e-6);
    assert!(without_stale(&coarse).rejected.is_empty());
}
