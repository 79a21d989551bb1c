//! The calibrated arm for other programs: a URDF, a table of modified Denavit-Hartenberg parameters.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use serde_json::json;
use trical_ident::{ModelFile, unit};
use trical_model::calibrated::{corrected_file, ur_kinematics, wrist_from_flange};
use trical_model::pose::angles_zyx;
use trical_model::robot::tidy;
use trical_model::urdf::{self, UrdfPath};
use trical_model::{Forward, Joint, JointKind, Model, Pose, Rigid, Robot, State};

use crate::error::{Error, Result};
use crate::error_map::{ErrorMap, MapSummary};
use crate::table::csv;

/// Where an arm is written for other programs.
#[derive(Clone, Copy, Debug)]
pub struct Outputs<'a> {
    /// A URDF.
    pub urdf: Option<&'a Path>,
    /// The kinematics of an arm of Universal Robots for its ROS driver.
    pub ur_kinematics: Option<&'a Path>,
    /// The table of modified Denavit-Hartenberg parameters.
    pub mdh: Option<&'a Path>,
    /// How far the arm misses all over its workspace.
    pub error_map: Option<&'a Path>,
    /// Poses of that.
    pub poses: usize,
}

/// Files and what is to stand in them.
pub type Texts<'a> = Vec<(&'a Path, String)>;

/// What an exported arm cannot say, in numbers.
struct LeftOut {
    /// Names with units of the terms.
    names: Vec<String>,
    /// How far the model's TCP is from the rigid one's at random poses within limits, mm.
    rms_mm: f64,
    max_mm: f64,
}

/// So near are two tools or flanges the same one, m and rad.
const SAME: f64 = 1e-7;

/// Poses at which the model is compared with its rigid part.
const POSES: usize = 1000;

impl LeftOut {
    fn of(model: &Model, rigid: &Rigid) -> Result<Self> {
        let names = rigid
            .left_out
            .iter()
            .map(|t| format!("{} ({}, {})", t.name, t.effect, unit(&model.robot, t).name))
            .collect();
        let full = Forward::new(model.clone(), Vec::new())?;
        let bare = Forward::new(Model::nominal(rigid.robot.clone(), rigid.cell.clone()), Vec::new())?;
        let (mut a, mut b) = (full.workspace(), bare.workspace());
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(20_260_201);
        let (mut sum, mut max): (f64, f64) = (0.0, 0.0);
        for _ in 0..POSES {
            let q: Vec<f64> = model.robot.joints.iter().map(|j| rng.random_range(j.limits[0]..j.limits[1])).collect();
            let state = State::at(&q);
            let off =
                full.world_from_tool(&state, &mut a).translation - bare.world_from_tool(&state, &mut b).translation;
            sum += off.norm_squared();
            max = max.max(off.norm());
        }
        let rms = (sum / POSES as f64).sqrt();
        Ok(Self { names, rms_mm: rms * 1e3, max_mm: max * 1e3 })
    }

    fn sentences(&self) -> Vec<String> {
        if self.names.is_empty() {
            return vec!["Nothing is left out: the model is rigid.".into()];
        }
        let mut lines = vec![format!(
            "Left out, since a table of lengths and angles cannot hold it: {} terms, which move the TCP by {:.3} mm (rms) and up \
             to {:.3} mm at {POSES} random poses (load only; time, temperature and sense of motion not counted):",
            self.names.len(),
            self.rms_mm,
            self.max_mm
        )];
        lines.extend(self.names.iter().map(|n| format!("  {n}")));
        lines
    }
}

/// A calibrated arm as others can have it.
pub struct Export<'a> {
    file: &'a ModelFile,
    model: Model,
    rigid: Rigid,
    left_out: LeftOut,
}

impl<'a> Export<'a> {
    /// Of a model, its rigid part, with the tool that programs are compensated for ([`Model::with_seen_tcp`]).
    ///
    /// # Errors
    /// A model that has none.
    pub fn of(file: &'a ModelFile) -> Result<Self> {
        let model = file.model.clone().with_seen_tcp();
        let rigid = model.rigid()?;
        let left_out = LeftOut::of(&model, &rigid)?;
        Ok(Self { file, model, rigid, left_out })
    }

    /// The texts of all files, and of an error map how large the errors are. A URDF is the `given` one, corrected, where there is one; `source` is what
    /// the model is called, and `hash` what the driver of Universal Robots is to call it.
    ///
    /// # Errors
    /// A model that the files cannot say.
    pub fn texts<'b>(
        &self,
        to: &Outputs<'b>,
        given: Option<&UrdfPath>,
        (source, hash): (&str, &str),
    ) -> Result<(Texts<'b>, Option<MapSummary>)> {
        let (model, mut texts, mut errors) = (&self.model, Vec::new(), None);
        if let Some(out) = to.urdf {
            let own = || Ok(self.urdf(source));
            texts.push((out, given.map_or_else(own, |given| corrected_file(given, model))?));
        }
        if let Some(out) = to.ur_kinematics {
            texts.push((out, ur_kinematics(model, hash)?));
        }
        if let Some(out) = to.mdh {
            texts.push((out, self.table(out)?));
        }
        if let Some(out) = to.error_map {
            let mut map = ErrorMap::of(model, to.poses)?;
            map.expect(self.file)?;
            texts.push((out, map.csv()));
            errors = Some(map.summary());
        }
        Ok((texts, errors))
    }

    /// The text of a URDF: base, links and tool; `source` is the model's name.
    #[must_use]
    pub fn urdf(&self, source: &str) -> String {
        let mut remarks = vec![
            format!("{}, calibrated: {source}.", self.rigid.robot.name),
            "Lengths in m, angles in rad. From world to tcp: base, links in Craig's modified Denavit-Hartenberg frames, flange, tool."
                .into(),
            "Moments of inertia, greatest torques and speeds are not known, and zero.".into(),
        ];
        remarks.extend(self.left_out.sentences());
        urdf::write(&self.rigid.robot, &self.rigid.cell, &remarks)
    }

    /// The text of a table of modified Denavit-Hartenberg parameters, as the name of `out` says: .toml (a robot file), .json or
    /// .csv.
    ///
    /// # Errors
    /// Another ending of the name.
    pub fn table(&self, out: &Path) -> Result<String> {
        let Self { model, rigid, left_out, .. } = self;
        let lines = |robot: &Robot| robot.joints.iter().enumerate().map(line).collect::<Vec<_>>();
        match out.extension().and_then(|e| e.to_str()) {
            Some("toml") => {
                let head: Vec<String> = left_out.sentences().iter().map(|s| format!("# {s}\n")).collect();
                Ok(format!(
                    "# Calibrated; T(i-1, i) = Rx(alpha) Tx(a) Ry(beta) Rz(theta + theta_offset) Tz(d).\n{}\n{}",
                    head.concat(),
                    rigid.robot.to_toml()
                ))
            }
            Some("json") => {
                let nominal = if rigid.same_frames { lines(&model.robot) } else { Vec::new() };
                Ok(serde_json::to_string_pretty(&json!({
                    "robot": rigid.robot.name,
                    "convention": "T(i-1, i) = Rx(alpha) Tx(a) Ry(beta) Rz(theta + theta_offset) Tz(d); R = Rz(a) Ry(b) Rx(c) in zyx_deg",
                    "world_from_base": pose(&rigid.cell.world_from_base),
                    "base_from_frame_0": pose(&rigid.robot.root_from_zero),
                    "joints": lines(&rigid.robot),
                    "nominal_joints": nominal,
                    "frame_n_from_flange": pose(&rigid.robot.last_from_flange),
                    "flange_from_tcp": self.flange_from_tcp(),
                    "left_out": left_out.names,
                    "left_out_rms_mm": left_out.rms_mm,
                    "left_out_max_mm": left_out.max_mm,
                }))?)
            }
            Some("csv") => {
                let cell = |line: &serde_json::Value, name: &str| match &line[name] {
                    serde_json::Value::Null => String::new(),
                    v => v.as_str().map_or_else(|| v.to_string(), str::to_owned),
                };
                let head = COLUMNS.map(str::to_owned);
                let rows = lines(&rigid.robot);
                Ok(csv([head].into_iter().chain(rows.iter().map(|line| COLUMNS.map(|name| cell(line, name))))))
            }
            _ => Err(Error::Input(format!("{}: the name must end in .toml, .json or .csv", out.display()))),
        }
    }

    /// Whether the frames are those of the nominal arm, so that tables can be compared line by line.
    #[must_use]
    pub fn same_frames(&self) -> bool {
        self.rigid.same_frames
    }

    /// Whether anything was left out, how far that moves the TCP, and what it is.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        self.left_out.sentences()
    }

    /// What the files have no place for and whoever uses them has to enter: the tool that was identified, and where the flange is behind the last
    /// frame.
    ///
    /// # Errors
    /// A model of which [`Self::texts`] has none.
    pub fn cautions(&self, to: &Outputs<'_>, given: Option<&UrdfPath>) -> Result<Vec<String>> {
        let of_lines = |out: &&Path| out.extension().is_some_and(|e| e != "json");
        let without_tool = [to.urdf.filter(|_| given.is_some()), to.ur_kinematics, to.mdh.filter(of_lines)];
        let names: Vec<String> = without_tool.iter().flatten().map(|out| out.display().to_string()).collect();
        let mut told: Vec<String> =
            self.tool_sentence(&names.join(" and ")).filter(|_| !names.is_empty()).into_iter().collect();
        if let Some(out) = to.ur_kinematics {
            let flange = wrist_from_flange(&self.model.robot)?;
            // a quarter turn is how others place the same flange
            let is_whole = flange.rotation.iter().all(|x| (x - x.round()).abs() < SAME);
            told.extend((!is_whole || flange.translation.norm() > SAME).then(|| {
                format!(
                    "{} ends at wrist_3, and the driver takes that for the flange. The flange of this arm is behind it at {} (delta_a and delta_alpha of \
                     joint 6 in the calibration.conf, for which the file has no place): add this to the tool in the program that uses the file.",
                    out.display(),
                    in_words(&flange)
                )
            }));
        }
        Ok(told)
    }

    /// Where the tool is, of which these files have nothing; `None` where it is as the cell file says.
    fn tool_sentence(&self, files: &str) -> Option<String> {
        let (was, now) = (&self.model.cell.tool, &self.rigid.cell.tool);
        let moved = (now.tcp - was.tcp).norm();
        let turned = (was.rotation.transpose() * now.rotation - nalgebra::Matrix3::identity()).norm();
        (moved > SAME || turned > SAME).then(|| {
            let tool = Pose { rotation: now.rotation, translation: now.tcp };
            format!(
                "The tool is not part of {files}, and was identified with the arm: behind the calibrated flange its TCP is at {}, {:.4} mm from where the \
                 cell file has it. Enter this tool in the program that uses the file.",
                in_words(&tool),
                moved * 1e3
            )
        })
    }

    /// What was written and what was left out, as JSON.
    #[must_use]
    pub fn json(&self, written: &[String], errors: Option<&MapSummary>, cautions: &[String]) -> serde_json::Value {
        json!({
            "written": written,
            "cautions": cautions,
            "error_map": errors,
            "robot": self.rigid.robot.name,
            "left_out": self.left_out.names,
            "left_out_rms_mm": self.left_out.rms_mm,
            "left_out_max_mm": self.left_out.max_mm,
            "same_frames": self.rigid.same_frames,
            "flange_from_tcp": self.flange_from_tcp(),
        })
    }

    fn flange_from_tcp(&self) -> serde_json::Value {
        let tool = &self.rigid.cell.tool;
        pose(&Pose { rotation: tool.rotation, translation: tool.tcp })
    }
}

/// A pose in mm and deg, in words.
fn in_words(p: &Pose) -> String {
    let [x, y, z] = [p.translation.x, p.translation.y, p.translation.z].map(|x| (x * 1e7).round() / 1e4 + 0.0);
    let [a, b, c] = angles_zyx(&p.rotation).map(|a| (a.to_degrees() * 1e4).round() / 1e4 + 0.0);
    format!("{x:.4}, {y:.4}, {z:.4} mm with zyx_deg {a:.4}, {b:.4}, {c:.4}")
}

/// A pose in mm and deg.
fn pose(p: &Pose) -> serde_json::Value {
    let xyz_mm = [p.translation.x, p.translation.y, p.translation.z].map(|x| tidy(x * 1e3));
    let zyx_deg = angles_zyx(&p.rotation).map(|a| tidy(a.to_degrees()));
    json!({ "xyz_mm": xyz_mm, "zyx_deg": zyx_deg })
}

/// The columns of the CSV; a limit has its own column for each unit, and one of them is empty.
const COLUMNS: [&str; 11] = [
    "joint",
    "kind",
    "alpha_deg",
    "a_mm",
    "beta_deg",
    "d_mm",
    "theta_offset_deg",
    "lower_deg",
    "upper_deg",
    "lower_mm",
    "upper_mm",
];

/// One line of the table: numbers by name, each with its unit.
fn line((i, j): (usize, &Joint)) -> serde_json::Value {
    let deg = |x: f64| json!(tidy(x.to_degrees()));
    let mm = |x: f64| json!(tidy(x * 1e3));
    let slides = j.kind == JointKind::Prismatic;
    let [in_deg, in_mm] = [(!slides).then_some(j.limits), slides.then_some(j.limits)];
    json!({
        "joint": i + 1,
        "kind": j.kind,
        "alpha_deg": deg(j.alpha),
        "a_mm": mm(j.a),
        "beta_deg": deg(j.beta),
        "d_mm": mm(j.d),
        "theta_offset_deg": deg(j.theta_offset),
        "lower_deg": in_deg.map(|l| deg(l[0])),
        "upper_deg": in_deg.map(|l| deg(l[1])),
        "lower_mm": in_mm.map(|l| mm(l[0])),
        "upper_mm": in_mm.map(|l| mm(l[1])),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::arm;
    use trical_model::calibrated::calibrated_by_maker;
    use trical_model::{Axis, Basis, Cell, Motion, Parameter, Shape, Site, Term, Variable};

    fn term(name: &str, site: Site, basis: Basis, value: f64) -> Term {
        Term { value, ..Term::new(name, "geometry", site, basis) }
    }

    /// A tool that goes to and fro with joint 1: rms and largest follow from the sine alone.
    #[test]
    fn what_a_table_cannot_hold_is_named_and_weighed() {
        let mut model = arm();
        let swing = Basis::new(Variable::Joint { joint: 1 }, Shape::Sine { cycles: 1.0 });
        model.terms.push(term("swing", Site::Tool(Motion::Along(Axis::X)), swing, 2e-3));
        let told = Export::of(&ModelFile::unmeasured(model.clone())).unwrap().json(&[], None, &[]);
        let a = model.robot.joints[0].limits[1];
        let rms = 2.0 * (0.5 - (2.0 * a).sin() / (4.0 * a)).sqrt();
        assert!((told["left_out_rms_mm"].as_f64().unwrap() - rms).abs() < 0.03 * rms, "{told} {rms}");
        let most = told["left_out_max_mm"].as_f64().unwrap();
        assert!(
            (1.99..=2.0 + 1e-9).contains(&most) && told["left_out"][0].as_str().unwrap().starts_with("swing ("),
            "{told}"
        );
        let nominal = ModelFile::unmeasured(arm());
        let rigid = Export::of(&nominal).unwrap();
        assert!(
            rigid.sentences()[0].starts_with("Nothing is left out")
                && rigid.json(&[], None, &[])["left_out_max_mm"] == 0.0
        );
    }

    /// The same tool whether it was identified as such or as the only target, which a tracker saw at the TCP.
    #[test]
    fn the_tcp_that_a_tracker_saw_is_the_exported_tool_and_files_without_a_tool_say_where_it_is() {
        let at = |site: Site| {
            let mut model = arm();
            model.cell.tool.targets = vec![model.cell.tool.tcp];
            model.terms.push(term("y", site, Basis::CONSTANT, 0.7e-3));
            ModelFile::unmeasured(model)
        };
        let files = [Site::Tool(Motion::Along(Axis::Y)), Site::Target { target: 1, axis: Axis::Y }].map(at);
        let [tool, seen] = [0, 1].map(|k| Export::of(&files[k]).unwrap());
        let moved = seen.rigid.cell.tool.tcp - seen.model.cell.tool.tcp;
        assert!((moved.y - 0.7e-3).abs() < 1e-12 && seen.urdf("m") == tool.urdf("m"), "{moved}");
        let to = Outputs { urdf: None, ur_kinematics: None, mdh: Some(Path::new("t.csv")), error_map: None, poses: 1 };
        let told = seen.cautions(&to, None).unwrap();
        assert!(
            told.len() == 1 && told[0].contains("not part of t.csv") && told[0].contains("0.7000 mm from"),
            "{told:?}"
        );
        // a new URDF and a table in JSON have the tool
        let with = Outputs { urdf: Some(Path::new("a.urdf")), mdh: Some(Path::new("t.json")), ..to };
        assert!(seen.cautions(&with, None).unwrap().is_empty());
    }

    #[test]
    fn what_a_controller_has_behind_joint_6_is_told_where_the_drivers_file_cannot_hold_it() {
        let ur5e = Robot::parse(include_str!("../../../robots/ur5e.toml"), "ur5e.toml").unwrap();
        let to = Outputs { urdf: None, ur_kinematics: Some(Path::new("k.yaml")), mdh: None, error_map: None, poses: 1 };
        let told = |a: f64| {
            let text =
                ["delta_theta", "delta_d", "delta_alpha"].map(|n| format!("{n} = [0, 0, 0, 0, 0, 0]\n")).concat();
            let text = format!("{text}delta_a = [0.0001, 0, 0, 0, 0, {a}]\n");
            let robot = calibrated_by_maker(&ur5e, &text, "calibration.conf").unwrap();
            let file = ModelFile::unmeasured(Model::nominal(robot, Cell::bare()));
            Export::of(&file).unwrap().cautions(&to, None).unwrap()
        };
        assert_eq!(told(0.0), [""; 0]);
        let said = told(0.0007);
        assert!(
            said.len() == 1
                && said[0].contains("k.yaml ends at wrist_3")
                && said[0].contains("0.7000, 0.0000, 0.0000 mm"),
            "{said:?}"
        );
    }

    #[test]
    fn a_row_of_the_table_is_the_calibrated_joint_in_degrees_and_millimetres() {
        let mut model = arm();
        // alpha and a of link i-1 stand in the row of joint i (Craig)
        model.terms.push(term("a_2", Site::Link { link: 2, parameter: Parameter::A }, Basis::CONSTANT, 1.5e-3));
        let site = Site::Link { link: 1, parameter: Parameter::Alpha };
        model.terms.push(term("alpha_1", site, Basis::CONSTANT, 0.25_f64.to_radians()));
        let file = ModelFile::unmeasured(model);
        let (nominal, export) = (&file.model.robot.joints, Export::of(&file).unwrap());
        let text = export.table(Path::new("t.csv")).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!((rows.len(), rows[0].clone()), (7, COLUMNS.to_vec()));
        let number = |joint: usize, name: &str| -> f64 {
            rows[joint][COLUMNS.iter().position(|c| *c == name).unwrap()].parse().unwrap()
        };
        for (k, j) in nominal.iter().enumerate() {
            let more = |joint: usize, by: f64| if k + 1 == joint { by } else { 0.0 };
            let expected = [
                ("joint", f64::from(u8::try_from(k).unwrap()) + 1.0),
                ("alpha_deg", j.alpha.to_degrees() + more(2, 0.25)),
                ("a_mm", j.a * 1e3 + more(3, 1.5)),
                ("d_mm", j.d * 1e3),
                ("theta_offset_deg", j.theta_offset.to_degrees()),
                ("lower_deg", j.limits[0].to_degrees()),
                ("upper_deg", j.limits[1].to_degrees()),
            ];
            for (name, value) in expected {
                assert!((number(k + 1, name) - value).abs() < 1e-6, "joint {} {name}: {}", k + 1, number(k + 1, name));
            }
            // limits in degrees have none in mm
            assert_eq!(rows[k + 1][9..], ["", ""]);
        }
    }

    #[test]
    fn a_joint_that_slides_has_its_limits_in_millimetres() {
        let mut robot = arm().robot;
        (robot.joints[0].kind, robot.joints[0].limits) = (JointKind::Prismatic, [-0.1, 0.25]);
        let row = line((0, &robot.joints[0]));
        let of = |name: &str| row[name].as_f64();
        assert_eq!(["lower_mm", "upper_mm", "lower_deg", "upper_deg"].map(of), [Some(-100.0), Some(250.0), None, None]);
    }
}
