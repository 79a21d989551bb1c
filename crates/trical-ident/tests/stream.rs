//! Files that are read pass by pass give what the same rows give in memory.

use std::fmt::Write;
use std::path::PathBuf;

use rand::{RngExt, SeedableRng};
use rand_distr::Distribution;
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::identifiability::independent_terms;
use trical_ident::{
    Choice, CsvStream, Dataset, ErrorSummary, JointSource, Options, ParameterSet, Streamed, calibrate_stream, identify,
    identify_stream, load_csv, reject_gross_errors,
};
use trical_model::{Cell, Forward, Measured, Model, Pose, Recording, Robot, Row, State, Task};
use trical_recording::RecordError;

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = "[base]\nxyz_mm = [100.0, 200.0, 50.0]\nzyx_deg = [30.0, 5.0, -4.0]\n[tool]\ntcp_mm = [31.0, -22.0, 118.0]\n\
                    mass_kg = 1.5\ncog_mm = [0.0, 0.0, 50.0]\n\
                    targets_mm = [[31.0, -22.0, 118.0], [-31.0, 40.0, 90.0]]\n";

fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

/// An arm with compliance that is off by chance, in a tracker's frame.
fn truth(frame: Pose) -> Model {
    let mut model = nominal();
    model.frames = vec![frame];
    let rows = (0..2)
        .map(|target| Row {
            state: State::at(&[]),
            measured: Measured::Point { target, position: [0.0; 3] },
            seq: None,
            line: 2,
        })
        .collect();
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    model.terms = independent_terms(&model, &data, &Choice::from(ParameterSet::Compliance)).unwrap().0;
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    for t in &mut model.terms {
        let size = if t.effect == "compliance" { 1e-5 } else { 1e-3 };
        t.value = rng.random_range(-size..size);
    }
    model
}

/// Tracker points of two targets, `noise` m; rows of `bad` are off by 2 mm.
fn write(
    name: &str,
    model: &Model,
    count: usize,
    noise: f64,
    seed: u64,
    bad: &[usize],
) -> (tempfile::TempDir, PathBuf) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = rand_distr::Normal::new(0.0, noise).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut text = String::from("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,x_mm,y_mm,z_mm\n");
    for k in 0..count {
        let q: Vec<f64> =
            model.robot.joints.iter().map(|j| rng.random_range(0.7 * j.limits[0]..0.7 * j.limits[1])).collect();
        let target = k % 2;
        let state = State::at(&q);
        forward.residual(&state, &Measured::Point { target, position: [0.0; 3] }, 0, &mut ws);
        write!(text, "{k}").unwrap();
        for v in &q {
            write!(text, ",{}", v.to_degrees()).unwrap();
        }
        write!(text, ",{}", target + 1).unwrap();
        for r in &ws.residual()[..3] {
            let off = if bad.contains(&k) { 2.0 } else { 0.0 };
            write!(text, ",{}", (r + normal.sample(&mut rng)) * 1e3 + off).unwrap();
        }
        text.push('\n');
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    (dir, path)
}

fn frame() -> Pose {
    Pose {
        rotation: trical_model::pose::rotation_zyx(0.4, -0.2, 0.1),
        translation: nalgebra::Vector3::new(1.5, -0.3, 0.2),
    }
}

fn streamed(paths: &[PathBuf]) -> Streamed {
    let model = nominal();
    let stream = CsvStream::open(paths, 6).unwrap();
    let sample = stream.sample().unwrap();
    let data = Dataset::build(&sample.recordings, JointSource::Read, None).unwrap();
    let data = reject_gross_errors(&model.robot, &model.cell, &data).unwrap();
    identify_stream(&model.robot, &model.cell, &stream, &data, ParameterSet::Compliance, false).unwrap()
}

/// Largest difference of two results, in standard deviations, and of their standard deviations, relative.
fn compare(paths: &[PathBuf]) -> (f64, f64) {
    let model = nominal();
    let recordings: Vec<_> = paths.iter().map(|p| load_csv(p, 6).unwrap()).collect();
    let data = Dataset::build(&recordings, JointSource::Read, None).unwrap();
    let data = reject_gross_errors(&model.robot, &model.cell, &data).unwrap();
    let whole = identify(&model.robot, &model.cell, &data, ParameterSet::Compliance).unwrap();
    let parts = streamed(paths);
    assert_eq!(parts.observations, data.observations.len());
    assert_eq!(parts.rejected, data.rejected.len());
    let lines = |r: &[trical_ident::Rejected]| r.iter().map(|r| (r.line, r.row)).collect::<Vec<_>>();
    assert_eq!(lines(&parts.named), lines(&data.rejected));
    // all but the median, which is the sample's
    let errors = ErrorSummary::of(&whole.errors().unwrap());
    let four = |e: &ErrorSummary| [e.mean_mm, e.max_mm, e.sd_mm, e.rms_mm];
    for (a, b) in four(&errors).iter().zip(four(&parts.errors)) {
        assert!((b / a - 1.0).abs() < 1e-3, "{errors:?} {:?}", parts.errors);
    }
    let (mut off, mut sd_off) = (0.0_f64, 0.0_f64);
    for k in &whole.free {
        let (a, b) = (&whole.model.terms[*k], &parts.identified.model.terms[*k]);
        assert_eq!(a.name, b.name);
        let sd = a.sd.unwrap();
        // the places of frames and targets that the fit starts from are part of the result
        if a.effect == "geometry" || a.effect == "compliance" {
            off = off.max((a.value - b.value).abs() / sd);
        }
        sd_off = sd_off.max((b.sd.unwrap() / sd - 1.0).abs());
    }
    (off, sd_off)
}

#[test]
fn a_file_read_in_blocks_gives_what_memory_gives_and_finds_the_same_gross_errors() {
    let (_dir, path) = write("points.csv", &truth(frame()), 40_000, 2e-5, 1, &[7, 12_345, 39_999]);
    assert!(std::fs::metadata(&path).unwrap().len() > 3 << 20, "several blocks are needed");
    let (off, sd_off) = compare(&[path]);
    assert!(off < 1e-3 && sd_off < 1e-5, "{off} {sd_off}");
}

#[test]
fn two_instruments_of_different_noise_are_weighted_as_in_memory() {
    let (_a, fine) = write("fine.csv", &truth(frame()), 12_000, 1e-5, 2, &[]);
    let (_b, coarse) = write("coarse.csv", &truth(Pose::identity()), 12_000, 8e-5, 3, &[]);
    let (off, sd_off) = compare(&[fine, coarse]);
    assert!(off < 1e-2 && sd_off < 1e-3, "{off} {sd_off}");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let (_dir, path) = write("points.csv", &truth(frame()), 24_000, 2e-5, 4, &[]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| streamed(std::slice::from_ref(&path))).identified;
        let values: Vec<u64> = found.model.terms.iter().map(|t| t.value.to_bits()).collect();
        (values, found.covariance.iter().map(|c| c.to_bits()).collect::<Vec<_>>())
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(5));
}

#[test]
fn a_bad_row_far_down_is_named_with_its_line() {
    let (_dir, path) = write("points.csv", &truth(frame()), 24_000, 2e-5, 5, &[]);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    let refused = |lines: &[&str]| {
        std::fs::write(&path, lines.join("\n")).unwrap();
        CsvStream::open(std::slice::from_ref(&path), 6).and_then(|s| s.sample()).unwrap_err().to_string()
    };
    let good = lines[20_000];
    let bad = good.replacen(',', ",x", 1);
    lines[20_000] = &bad;
    let message = refused(&lines);
    assert!(message.contains("line 20001, column q1_deg: found 'x"), "{message}");
    lines[20_000] = lines[19_990];
    let message = refused(&lines);
    assert!(message.contains("line 20001, column t_s: found 19989 after 19998"), "{message}");
    lines[20_000] = "1,2,3";
    let message = refused(&lines);
    assert!(message.contains("line 20001: found 3 fields, expected 11"), "{message}");
}

/// Both targets at each pose, and before them fixed references. From a tracker that stands elsewhere each time these are three, of which 2 was
/// bumped at pose 10, 3 is hidden at pose 2000, and all are at pose 2500. Target 1 is off by 2 mm at pose 2900.
fn write_with_references(poses: usize, seed: u64, stands_elsewhere: bool) -> (tempfile::TempDir, PathBuf) {
    let model = truth(frame());
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = rand_distr::Normal::new(0.0, 2e-5).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let references = [[0.0, 0.0, 0.0], [1.2, 0.1, 0.3], [-0.2, 0.9, 0.6]].map(nalgebra::Vector3::from);
    let mut text = String::from("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,reference,x_mm,y_mm,z_mm\n");
    for k in 0..poses {
        let q: Vec<f64> =
            model.robot.joints.iter().map(|j| rng.random_range(0.7 * j.limits[0]..0.7 * j.limits[1])).collect();
        let mut by = || rng.random_range(-0.05..0.05);
        let elsewhere = Pose {
            rotation: trical_model::pose::rotation_zyx(by(), by(), by()),
            translation: nalgebra::Vector3::new(by(), by(), by()),
        };
        let elsewhere = if stands_elsewhere { elsewhere } else { Pose::identity() };
        let mut seen: Vec<(String, nalgebra::Vector3<f64>)> = Vec::new();
        for (r, p) in references.iter().enumerate().take(if stands_elsewhere { 3 } else { 2 }) {
            let hidden = k == 2500 || (k, r) == (2000, 2);
            let bumped = if (k, r) == (10, 1) { 2e-3 } else { 0.0 };
            if !hidden {
                seen.push((format!(",{}", r + 1), p + nalgebra::Vector3::new(0.0, 0.0, bumped)));
            }
        }
        for target in 0..2 {
            forward.residual(&State::at(&q), &Measured::Point { target, position: [0.0; 3] }, 0, &mut ws);
            let mut p = nalgebra::Vector3::from_column_slice(&ws.residual()[..3]);
            p.x += if (k, target) == (2900, 0) { 2e-3 } else { 0.0 };
            seen.push((format!("{},", target + 1), p));
        }
        let joints: Vec<String> = q.iter().map(|v| v.to_degrees().to_string()).collect();
        for (which, p) in seen {
            let p = elsewhere.apply(&p).map(|v| (v + normal.sample(&mut rng)) * 1e3);
            writeln!(text, "{},{which},{},{},{}", joints.join(","), p.x, p.y, p.z).unwrap();
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("references.csv");
    std::fs::write(&path, text).unwrap();
    (dir, path)
}

#[test]
fn poses_with_references_are_registered_in_blocks_as_in_memory() {
    let (_dir, path) = write_with_references(5000, 8, true);
    assert!(std::fs::metadata(&path).unwrap().len() > 3 << 20, "several blocks are needed");
    let found = streamed(std::slice::from_ref(&path));
    let sample = CsvStream::open(std::slice::from_ref(&path), 6).unwrap().sample().unwrap();
    let rows = &sample.recordings[0].rows;
    let whole = rows.chunk_by(|a, b| a.state.q == b.state.q).filter(|pose| pose.len() == 5).count();
    assert!(whole > 1000 && 5 * whole + 6 >= rows.len(), "{whole} whole poses in {} rows", rows.len());
    let reasons: Vec<&str> = found.named.iter().map(|r| r.reason.as_str()).collect();
    assert_eq!(reasons.len(), 7, "{reasons:?}");
    assert!(reasons[0].starts_with("a reference is ") && reasons[1] == reasons[0], "{reasons:?}");
    assert!(reasons[2].starts_with("only 2 of 3 references were seen"), "{reasons:?}");
    assert_eq!(reasons[4], "no references were seen at this pose");
    // places of the references are those of the sample: they are as well known as the frame
    let (off, sd_off) = compare(&[path]);
    assert!(off < 0.05 && sd_off < 1e-3, "{off} {sd_off}");
}

#[test]
fn references_that_are_too_few_to_register_a_pose_by_are_passed_over() {
    let (_dir, path) = write_with_references(5000, 9, false);
    let (off, sd_off) = compare(&[path]);
    assert!(off < 1e-3 && sd_off < 1e-5, "{off} {sd_off}");
}

#[test]
fn a_pose_that_is_longer_than_a_block_is_not_cut() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("r.csv");
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,target,reference,x_mm,y_mm,z_mm\n";
    let rows = |q: u32, count| format!("{q},2,3,4,5,6,,1,0.25,0.5,0.75\n").repeat(count);
    std::fs::write(&path, header.to_owned() + &rows(0, 10) + &rows(1, 100_000) + &rows(2, 60_000)).unwrap();
    let mut blocks: Vec<Vec<f64>> = Vec::new();
    let stream = CsvStream::open(&[path], 6).unwrap();
    let of_block = |_, rows: &trical_recording::stream::BlockRows<'_>| {
        let mut q = Vec::new();
        rows.each_row(&mut |row| {
            q.push(row.state.q[0]);
            Ok::<_, RecordError>(())
        })?;
        Ok::<_, RecordError>(q)
    };
    let mut keep = |_, q| {
        blocks.push(q);
        Ok(())
    };
    stream.pass(of_block, &mut keep).unwrap();
    let last = |block: &Vec<f64>| block.last().copied();
    assert!(blocks.windows(2).all(|two| last(&two[0]) != two[1].first().copied()), "a pose is in two blocks");
    assert_eq!(blocks.iter().map(Vec::len).sum::<usize>(), 160_010);
    assert_eq!(blocks.len(), 3, "one for each pose");
}

#[test]
fn a_point_that_the_cell_does_not_have_is_refused_with_its_line() {
    let (_dir, path) = write("points.csv", &truth(frame()), 24_000, 2e-5, 6, &[]);
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let refused = |target: &str| {
        let mut lines = lines.clone();
        let mut fields: Vec<&str> = lines[20_000].split(',').collect();
        fields[7] = target;
        lines[20_000] = fields.join(",");
        std::fs::write(&path, lines.join("\n")).unwrap();
        let (model, stream) = (nominal(), CsvStream::open(std::slice::from_ref(&path), 6).unwrap());
        let options = Options::new(ParameterSet::Geometry);
        calibrate_stream(&model.robot, &model.cell, &stream, &options, &Task::silent()).unwrap_err().to_string()
    };
    let told = "points.csv, line 20001, column target: found target 3, but the cell's [tool] targets_mm has 2";
    assert!(refused("3").ends_with(told), "{}", refused("3"));
}

#[test]
fn points_of_another_arm_are_refused_in_passes_as_in_memory() {
    let (_dir, path) = write("points.csv", &truth(frame()), 20_000, 0.3, 7, &[]);
    let (model, stream) = (nominal(), CsvStream::open(std::slice::from_ref(&path), 6).unwrap());
    let options = Options::new(ParameterSet::Geometry);
    let e = calibrate_stream(&model.robot, &model.cell, &stream, &options, &Task::silent()).unwrap_err().to_string();
    assert!(
        e.starts_with("after identification the tool is still ") && e.contains("more than any arm: are units"),
        "{e}"
    );
}
