//! Plans with a few characters changed: no panic, nothing beyond the arm's limits, and what is taken is read back the same.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../trical-model/tests/common/mutants.rs"]
mod common;

use trical_model::Robot;
use trical_plan::{read_plan, write_plan};

#[test]
fn plans() {
    let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let seed = "order,ball,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg,via\n\
                1,2,10.5,-20,30,-40,50,-60,11,-21,31,-41,51,-61,1 2 3 4 5 6;7 8 9 10 11 12\n\
                2,3,10,20,30,40,50,60,11,21,31,41,51,61,\n";
    common::mutants(&[seed], |text| {
        let Ok(plan) = read_plan(text, "plan.csv", &robot, 3) else { return false };
        for e in &plan {
            for q in e.via.iter().chain([&e.joints, &e.approach]) {
                assert!(q.iter().all(|q| q.is_finite()) && robot.within_limits(q, 0.0), "{text}");
            }
            assert!(e.ball < 3, "{text}");
        }
        let written = write_plan(&robot, &plan);
        let again = read_plan(&written, "plan.csv", &robot, 3).unwrap_or_else(|e| panic!("{e}\n{text}\n{written}"));
        assert_eq!((again.len(), write_plan(&robot, &again)), (plan.len(), written), "{text}");
        true
    });
}
