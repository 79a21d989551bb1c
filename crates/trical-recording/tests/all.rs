//! Tests of recordings, one program: to build and link one costs less than many.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bags;
mod formats;
mod round_trip;

/// An arm with joints of these kinds.
fn robot(kinds: &[&str]) -> trical_model::Robot {
    let joint = |kind: &&str| {
        let limits = if *kind == "prismatic" { "limits_mm" } else { "limits_deg" };
        format!(
            "[[joint]]\nkind = '{kind}'\nalpha_deg = 0\na_mm = 0\nd_mm = 0\ntheta_offset_deg = 0\n{limits} = [-100, 100]\n"
        )
    };
    let joints: String = kinds.iter().map(joint).collect();
    trical_model::Robot::parse(&format!("name = 'arm'\n{joints}"), "robot.toml").unwrap()
}
