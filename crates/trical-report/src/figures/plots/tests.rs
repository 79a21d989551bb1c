#![allow(clippy::unwrap_used)]

use super::*;

fn series(points: &[(f64, f64)]) -> Series {
    Series { name: "s", color: AFTER, points: points.to_vec() }
}

/// Numbers between two texts, each time that they occur.
fn between(svg: &str, before: &str, after: &str) -> Vec<f64> {
    svg.split(before).skip(1).filter_map(|t| t.split(after).next()?.parse().ok()).collect()
}

#[test]
fn what_a_script_draws_is_sorted_by_x_with_each_series_in_its_own_column() {
    let names = ["a", "b", "c"].map(String::from);
    // the same measurements before and after: one row each
    let (before, after) =
        (series(&[(3.0, 30.0), (1.0, 10.0), (2.0, 20.0)]), series(&[(3.0, 3.0), (1.0, 1.0), (2.0, f64::NAN)]));
    let (columns, rows) = live(&[before, after], &names);
    let some = |v: &[f64]| v.iter().copied().map(Some).collect::<Vec<_>>();
    assert_eq!(columns, [some(&[1.0, 2.0, 3.0]), some(&[10.0, 20.0, 30.0]), vec![Some(1.0), None, Some(3.0)]]);
    assert_eq!(rows, ["b", "c", "a"]);
    // of other measurements, rows of their own
    let (columns, rows) = live(&[series(&[(3.0, 30.0)]), series(&[(1.0, 1.0), (4.0, 4.0)])], &[]);
    assert_eq!(columns, [some(&[1.0, 3.0, 4.0]), vec![None, Some(30.0), None], vec![Some(1.0), None, Some(4.0)]]);
    assert!(rows.is_empty());
}

#[test]
fn of_many_points_a_bounded_number_is_drawn_and_none_that_is_alone_is_lost() {
    let crowd = |k: i32| (f64::from(k % 100), 1e-3 * f64::from(k / 100));
    let mut points: Vec<(f64, f64)> = (0..20_000).map(crowd).collect();
    points[777] = (50.0, 9.0);
    let kept = drawn(&[series(&points)]);
    assert!(kept[0].len() <= MOST_POINTS && kept[0].contains(&777), "{}", kept[0].len());
    // before and after of a measurement are drawn together
    let after: Vec<(f64, f64)> = points.iter().map(|p| (p.0, 0.5 * p.1)).collect();
    let both = drawn(&[series(&points), series(&after)]);
    assert_eq!(both[0], both[1]);
    // of few points each is drawn, however close together they are
    assert!(drawn(&[series(&[(1.0, 1.0); 400])])[0].len() == 400 && drawn(&[series(&[(1.0, 1.0); 401])])[0].len() == 1);
}

#[test]
fn of_a_crowd_points_are_drawn_by_chance_and_the_largest_always() {
    // measured in passes from left to right, each a little higher: of every cell the first point stands at its foot
    let mut points: Vec<(f64, f64)> = (0..40_000).map(|k| (f64::from(k % 200), f64::from(k / 200))).collect();
    points[25_123].1 = -200.5;
    let kept = drawn(&[series(&points)]);
    assert!(kept[0].contains(&25_123) && kept[0].is_sorted() && kept == drawn(&[series(&points)]));
    let mut heights: Vec<usize> = kept[0].iter().map(|k| k / 200).collect();
    heights.sort_unstable();
    heights.dedup();
    assert!(heights.len() > 100, "{} lines: {heights:?}", heights.len());
}

#[test]
fn names_go_with_the_points_that_are_drawn_and_nothing_ends_the_script() {
    let names = ["</script>", "b"].map(String::from);
    let html = scatter_named("x", "y", true, false, &[series(&[(2.0, 1.0), (1.0, 2.0)])], &names).unwrap();
    assert_eq!(html.matches("</script>").count(), 1);
    let data = html.split_once("json\">").unwrap().1.split_once("</script>").unwrap().0;
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(
        (data["rows"].clone(), data["data"].clone()),
        (serde_json::json!(["b", "</script>"]), serde_json::json!([[1.0, 2.0], [2.0, 1.0]]))
    );
    assert_eq!((data["zero"].clone(), data["joined"].clone()), (true.into(), false.into()));
}

#[test]
fn a_point_keeps_its_name_where_others_are_left_out() {
    let points: Vec<(f64, f64)> = (0..5000).map(|k| (f64::from(k), f64::from(k % 7))).collect();
    let names: Vec<String> = (0..5000).map(|k| k.to_string()).collect();
    let html = scatter_named("x", "y", true, false, &[series(&points)], &names).unwrap();
    let data = html.split_once("json\">").unwrap().1.split_once("</script>").unwrap().0;
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let (rows, x) = (data["rows"].as_array().unwrap(), data["data"][0].as_array().unwrap());
    assert!(rows.len() == x.len() && rows.len() <= MOST_POINTS);
    // and the reader is told
    assert!(
        html.contains(&format!(">{} of 5000 points are drawn; points close together are drawn once.<", rows.len()))
    );
    assert!(!scatter("x", "y", true, false, &[series(&points[..30])]).unwrap().contains("are drawn"));
    assert!(rows.iter().zip(x).all(|(name, x)| name.as_str().unwrap().parse::<f64>().ok() == x.as_f64()));
}

#[test]
fn bars_of_a_histogram_are_as_high_as_values_fall_into_them() {
    // 12 in the first bar, 6 in the last, 3 in the middle
    let values = [vec![0.01; 12], vec![3.0; 6], vec![1.55; 3]].concat();
    let svg = histogram("mm", &values).unwrap();
    let color = "fill=\"#2666A5\"";
    let bars: Vec<(f64, f64)> = svg
        .split("<rect")
        .filter(|r| r.contains(color))
        .map(|r| (between(r, " x=\"", "\"")[0], between(r, "height=\"", "\"")[0]))
        .filter(|b| b.1 > 0.5)
        .collect();
    assert_eq!(bars.len(), 3, "{bars:?}");
    let [low, middle, high] = [bars[0], bars[1], bars[2]];
    assert!(low.0 < middle.0 && middle.0 < high.0, "{bars:?}");
    assert!((low.1 / high.1 - 2.0).abs() < 0.05 && (high.1 / middle.1 - 2.0).abs() < 0.1, "{bars:?}");
    assert!(((middle.0 - low.0) / (high.0 - low.0) - 15.0 / 29.0).abs() < 0.008, "{bars:?}");
    // from end to end of a page of 480, but for margins and labels
    assert!(low.0 < 100.0 && high.0 > 440.0, "{bars:?}");
}

/// A page's y grows downwards: what is larger stands higher.
#[test]
fn larger_values_stand_higher_and_further_right() {
    let svg = still("x", "y", true, false, &[series(&[(1.0, 1.0), (2.0, 3.0)])]).unwrap();
    let path = svg.split("<path d=\"M").nth(1).unwrap().split('"').next().unwrap();
    let points: Vec<Vec<f64>> = path
        .split("h0")
        .map(|p| p.trim_start_matches('M'))
        .filter(|p| !p.is_empty())
        .map(|p| p.split(' ').map(|v| v.parse().unwrap()).collect())
        .collect();
    assert!(points[1][0] > points[0][0] && points[1][1] < points[0][1], "{points:?}");
    let lines = spectrum("cycles", "mm", &[(10.0, 1.0), (11.0, 4.0)], &[11.2]).unwrap();
    let bars: Vec<&str> = lines.split("<path d=\"M").nth(1).unwrap().split('"').next().unwrap().split('M').collect();
    let length = |bar: &str| -> f64 {
        let (foot, top) = bar.split_once(' ').unwrap().1.split_once('V').unwrap();
        foot.parse::<f64>().unwrap() - top.parse::<f64>().unwrap()
    };
    assert!((length(bars[1]) / length(bars[0]) - 4.0).abs() < 0.1, "{bars:?}");
    // the mark is as high as the bar beside it
    let mark = lines.split("<path d=\"M").nth(2).unwrap().split('"').next().unwrap();
    assert!((length(mark) - length(bars[1])).abs() < 1.5, "{mark} {bars:?}");
}

#[test]
fn a_staircase_begins_with_what_was_before() {
    let svg = staircase("mm", &[("plain".into(), 4.0), ("one".into(), 2.0)], 4);
    let bar = |color: &str| {
        let rect = svg.split("<rect").find(|r| r.contains(color)).unwrap();
        (between(rect, " y=\"", "\"")[0], between(rect, "width=\"", "\"")[0])
    };
    let (before, after) = (bar("fill=\"#c85c46\""), bar("fill=\"#2666a5\""));
    assert!(before.0 < after.0 && (before.1 / after.1 - 2.0).abs() < 0.05, "{before:?} {after:?}");
    // each has its name and its value, however many they are
    let many: Vec<(String, f64)> = (0..40).map(|k| (format!("n{k}"), 1.0)).collect();
    assert_eq!(staircase("mm", &many, 4).matches(">1.0000<").count(), 40);
}

#[test]
fn nothing_is_drawn_above_the_highest_tick_of_an_axis_from_zero() {
    for (high, top) in [(6.793, 8.0), (0.51, 0.6), (1.0, 1.0), (0.019, 0.02), (4.9, 5.0), (5.1, 6.0), (23.0, 25.0)] {
        let found = up_to_tick(high);
        assert!(found >= high && (found / top - 1.0).abs() < 1e-6, "{high}: {found}");
    }
    assert_eq!(up_to_tick(0.0), 0.0);
}

#[test]
fn numbers_on_an_axis_have_the_digits_that_they_need() {
    assert_eq!([-40.0, 0.1 + 0.2, -1e-17, 1500.0, 2e-5].map(|v| tick(&v)), ["-40", "0.3", "0", "1500", "0.00002"]);
    for high in [0.11, 0.26, 0.43] {
        let svg = scatter("x", "y", false, false, &[series(&[(0.0, -high), (1.0, high)])]).unwrap();
        assert!(svg.contains(">0<") && !svg.contains(">-0<"), "{high}: {svg}");
    }
}

#[test]
fn of_numbers_that_would_lie_on_each_other_the_largest_is_written() {
    let amplitudes: Vec<(f64, f64)> = (1..=320).map(|n| (f64::from(n), if n == 101 { 4.1 } else { 4.0 })).collect();
    let svg = spectrum("cycles", "mm", &amplitudes, &[100.0, 101.0, 200.0]).unwrap();
    // the number of a line beside a higher one stands on its own side
    let beside =
        spectrum("cycles", "mm", &[(1.0, 1.0), (100.0, 9.0), (102.0, 5.0), (320.0, 1.0)], &[100.0, 102.0]).unwrap();
    assert!(
        beside.contains("text-anchor=\"middle\" fill=\"#c85c46\">100<")
            && beside.contains("text-anchor=\"start\" fill=\"#c85c46\">102<")
    );
    let written = |n: &str| svg.contains(&format!("fill=\"#c85c46\">{n}</text>"));
    assert_eq!(["100", "101", "200"].map(written), [false, true, true]);
    assert_eq!(svg.matches("stroke=\"#c85c46\"").count(), 3);
}

#[test]
fn sessions_have_whole_numbers_and_few_of_them_a_mark_each() {
    let of = |n: u8| {
        let points: Vec<(f64, f64)> = (0..n).map(|k| (f64::from(k + 1), f64::from(k % 5))).collect();
        scatter("session", "mm", true, true, &[series(&points)]).unwrap()
    };
    for n in [2, 3, 5] {
        let svg = of(n);
        // labels of x stand in one line
        let foot = svg.split("<text").filter(|t| t.contains("text-anchor=\"middle\"") && t.contains("dy=\"0.76em\""));
        let told: Vec<f64> = foot.filter_map(|t| t.split('>').nth(1)?.split('<').next()?.parse().ok()).collect();
        assert_eq!(told, (1..=n).map(f64::from).collect::<Vec<_>>(), "{svg}");
        assert!(svg.matches("h0").count() == usize::from(n) && svg.contains("\"points\":true"), "{svg}");
    }
    assert!(!of(40).contains("h0") && of(40).contains("\"points\":false"));
}

#[test]
fn what_is_compared_has_its_means_over_parts_of_the_axis() {
    let wave = |k: u32| {
        let x = f64::from(k % 360);
        (x, x.to_radians().sin() + if (k / 360).is_multiple_of(2) { 5.0 } else { -5.0 })
    };
    // every angle twenty times, with as much above as below
    let points: Vec<(f64, f64)> = (0..7200).map(|k| wave(k * 7)).collect();
    let found = means(&points);
    assert_eq!(found.len(), PARTS);
    for (x, y, half) in found {
        assert!(
            (y - x.to_radians().sin()).abs() < 0.1 && (half - 1.96 * 5.0 / 450_f64.sqrt()).abs() < 0.01,
            "{x}: {y} +- {half}"
        );
    }
    // a sense of motion has two values, and each its mean
    let senses = means(&[(-1.0, 1.0), (1.0, 4.0), (-1.0, 3.0), (1.0, 6.0), (-1.0, 2.0), (1.0, 5.0), (0.0, 9.0)]);
    assert_eq!(senses.iter().map(|m| (m.0, m.1)).collect::<Vec<_>>(), [(-1.0, 2.0), (1.0, 5.0)]);
}

#[test]
fn points_outside_of_a_picture_are_counted() {
    let mut points: Vec<(f64, f64)> = (0..300).map(|k| (f64::from(k), f64::from(k % 7))).collect();
    points[40].1 = 900.0;
    let band =
        || Band { name: "fitted".into(), color: BEFORE, points: vec![(0.0, 1.0, 0.5, 1.5), (299.0, 2.0, 1.5, 2.5)] };
    let html = curve_over_data("x", "y", &[series(&points)], &band()).unwrap();
    assert!(html.contains(">1 point lies outside of the picture.<"), "{html}");
    points[40].1 = 3.0;
    assert!(!curve_over_data("x", "y", &[series(&points)], &band()).unwrap().contains("outside"));
}
