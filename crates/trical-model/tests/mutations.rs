//! Valid files with a few characters changed: no panic, and whatever is taken is finite and is read back as it was written.

#[path = "common/mutants.rs"]
mod common;
#[path = "../../../fuzz/src/model.rs"]
mod targets;

use common::mutants;

const ROBOT: &str = include_str!("../../../cells/irb120/robot.toml");
const SLIDES: &str = "name = \"a\"\n[root]\nxyz_mm = [1.0, 2, -3]\nzyx_deg = [10, 0, 180]\n[[joint]]\nkind = \"prismatic\"\nalpha_deg = 90\n\
                      a_mm = 1e2\nd_mm = 0.5\ntheta_offset_deg = -90.0\nlimits_mm = [0, 500]\nmass_kg = 3\ncog_mm = [1, 2, 3]\n";
const CELL: &str = "[base]\nxyz_mm = [150.0, -330.0, -150.0]\nzyx_deg = [90.0, 0.0, 0.0]\n[tool]\ntcp_mm = [18.0, -12.0, 118.0]\n\
                    mass_kg = 1.7\ncog_mm = [5.0, -4.0, 55.0]\n[balls]\ndistances_mm = { d12 = 300.0, d13 = 300.0, d23 = 300.0 }\n\
                    [anchors]\npositions_mm = [[1, 2, 3]]\n[geometry]\nmargin_mm = 5.0\n";
const POINTS: &str = "[base]\nxyz_mm = [1, 2, 3]\nzyx_deg = [90, 80, 70]\n[tool]\ntcp_mm = [1, 2, 3]\nzyx_deg = [1, 2, 3]\n\
                      targets_mm = [[1, 2, 3], [4, 5, 6]]\n[balls]\npositions_mm = [[1, 2, 3], [4, 5, 6]]\n";
const URDF: &str = "<robot name=\"r\"><link name=\"a\"><inertial><origin xyz=\"0 0 .1\"/><mass value=\"2\"/></inertial></link>\
                    <joint name=\"1\" type=\"revolute\"><origin xyz=\"0 0 .3\" rpy=\"0 1.5708 0\"/><parent link=\"a\"/>\
                    <child link=\"b\"/><axis xyz=\"0 1 0\"/><limit lower=\"-3\" upper=\"3.1\"/></joint><link name=\"b\"/>\
                    <joint name=\"2\" type=\"prismatic\"><parent link=\"b\"/><child link=\"c\"/><limit lower=\"0\" upper=\"1\"/>\
                    </joint><link name=\"c\"/></robot>";

#[test]
fn robots() {
    mutants(&[ROBOT, SLIDES], |text| targets::robot(text.as_bytes()));
}

#[test]
fn cells() {
    mutants(&[CELL, POINTS], |text| targets::cell(text.as_bytes()));
}

#[test]
fn urdfs() {
    mutants(&[URDF], |text| targets::urdf(text.as_bytes()));
}
