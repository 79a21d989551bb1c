//! Valid recordings, model files and files of what is known, with a few characters changed: no panic, and whatever is taken is
//! finite and is read back as it was written.

#[path = "../../trical-model/tests/common/mutants.rs"]
mod common;
#[path = "../../../fuzz/src/ident.rs"]
mod targets;

use common::mutants;
use trical_ident::ModelFile;

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

const TOUCHES: &str = "t_s,seq,q1_deg,q2_deg,qc1_deg,qc2_deg,dir1,dir2,ball,ix_mm,iy_mm,iz_mm,temp_c,payload_kg\n\
                       0,1,10,20.5,10,20.5,-1,1,1,0.001,-0.002,0.003,21.5,0\n2.5,2,-10,2e1,-10,20,0,1,3,0,0,0,22,1.5\n";
const POINTS: &str =
    "q1_deg,q2_mm,target,reference,x_mm,y_mm,z_mm\n1,2,1,,100.5,200,-300\n1,2,,3,1,2,3\n3,4,2,,5,6,7\n";
const OTHERS: &str =
    "q1_deg,q2_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,anchor,d_mm\n1,2,100,200,300,1,0,0,0,,\n3,4,,,,,,,,1,812.5\n";

#[test]
fn recordings() {
    mutants(&[TOUCHES, POINTS, OTHERS], |csv| targets::recording(csv.as_bytes()));
}

#[test]
fn model_files() {
    let term = |rest: &str| format!("[[term]]\neffect = \"e\"\nvalue = 0.5\nsd = 0.01\n{rest}\n");
    let head = format!(
        "format_version = 1\nprogram = \"trical\"\njoints = \"read\"\nrecordings = [\"a\"]\n[robot]\n{}\n[cell]\n{}\n\
         [[frame]]\nxyz_mm = [1, 2, 3]\nquaternion_wxyz = [1, 0, 0, 0]\nreferences_mm = [[1, 2, 3]]\n",
        ROBOT.replace("[[joint]]", "[[robot.joint]]"),
        CELL.replace("\n[", "\n[cell.").replace("[base]", "[cell.base]"),
    );
    let terms = [
        "name = \"a\"\nunit = \"deg\"\nsite = { joint = { joint = 2 } }",
        "name = \"b\"\nunit = \"deg\"\nsite = { joint = { joint = 2 } }\n\
         basis = { of = { joint = { joint = 3 } }, shape = { sine = { cycles = 2.0 } } }",
        "name = \"c\"\nunit = \"deg\"\nsite = { joint = { joint = 1 } }\n\
         basis = { of = { joint = { joint = 2 } }, shape = { tent = { left = -0.5, centre = 0.0, right = 1.0 } }, sense = 2 }",
    ];
    let seeds: Vec<String> = terms.iter().map(|t| head.clone() + &term(t)).collect();
    for s in &seeds {
        ModelFile::parse(s, "m.toml").unwrap_or_else(|e| panic!("{e}\n{s}"));
    }
    mutants(&seeds.iter().map(String::as_str).collect::<Vec<_>>(), |toml| targets::model(toml.as_bytes()));
}

#[test]
fn what_is_known() {
    let seed = "[[parameter]]\nname = \"a_2\"\nvalue = 270.0\nsd = 0.5\n[[parameter]]\nname = \"d_4\"\nmin = -1.0\nmax = 2.5\n";
    mutants(&[seed], |toml| targets::known(toml.as_bytes()));
}
